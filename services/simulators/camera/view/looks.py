"""The painters of surfaces: wood, cloth, books, print, screens. Each draws on a canvas of its base colour.

The clutter is meant: tiles, book backs and print are what a marker detector must not fall for.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Painter = Callable[[Image, str, Generator], None]
DENSITY = 240  # texture pixels per metre; the nearest surface, the floor below the camera, shows about 440 to the metre
WORDS = ("Kaffee", "Zeitung", "Brot", "Atlas", "Garten", "Reise", "Morgen", "Licht", "Haus", "Wetter", "Musik")


def _plain(image: Image, side: str, rng: Generator) -> None:
    """Only its colour."""


def _wall(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    fall = np.linspace(1.0, 1.0 - 0.1 * height / (2.6 * DENSITY), height)[:, None, None]
    image[:] = (image * fall).astype(np.uint8)
    if height > 2.5 * DENSITY:  # only where it stands on the floor
        image[height - round(0.07 * DENSITY) :] = (222, 226, 228)
        cv2.line(
            image, (0, height - round(0.07 * DENSITY)), (width, height - round(0.07 * DENSITY)), (150, 152, 156), 1
        )


def _wood(image: Image, side: str, rng: Generator) -> None:
    rings = np.cumsum(rng.normal(0, 1.6, len(image))) * 0.6
    rings -= np.linspace(0, rings[-1], len(image))
    image[:] = np.clip(image + np.clip(rings, -14, 14)[:, None, None], 0, 255).astype(np.uint8)


def _fabric(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    image[::3] = (image[::3] * 0.95).astype(np.uint8)
    image[:, ::3] = (image[:, ::3] * 0.95).astype(np.uint8)
    if side in ("top", "front") and width > DENSITY:
        cv2.line(image, (width // 2, 0), (width // 2, height), (70, 66, 60), 2)
    cv2.rectangle(image, (0, 0), (width - 1, height - 1), (92, 88, 80), 2)


def _panels(image: Image, side: str, rng: Generator) -> None:
    if side != "front":
        return
    height, width = image.shape[:2]
    count = max(1, round(width / (0.5 * DENSITY)))
    for i in range(count):
        left, right = i * width // count, (i + 1) * width // count
        cv2.rectangle(image, (left + 2, 2), (right - 3, height - 3), (150, 156, 160), 2)
        cv2.line(image, (right - 16, height // 3), (right - 16, height // 2), (90, 92, 96), 4)


def _counter(image: Image, side: str, rng: Generator) -> None:
    if side == "top":
        image[:] = (96, 104, 112)
        _wood(image, side, rng)
    else:
        _panels(image, side, rng)
        image[: round(0.04 * DENSITY)] = (80, 86, 92)


def _fridge(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    if side == "front":
        cv2.line(image, (0, height // 3), (width, height // 3), (120, 120, 120), 3)
        cv2.rectangle(image, (width - 24, height // 3 + 20), (width - 16, height // 2 + 40), (110, 110, 112), -1)
        _lines_of_text(image[height // 2 : height // 2 + 60, 20:100], rng, 9)


def _hob(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    for x, y, r in ((0.27, 0.3, 0.2), (0.73, 0.3, 0.15), (0.27, 0.72, 0.15), (0.73, 0.72, 0.2)):
        cv2.circle(image, (round(x * width), round(y * height)), round(r * height), (110, 112, 116), 1, cv2.LINE_AA)


def _books(image: Image, side: str, rng: Generator) -> None:
    if side != "front":
        return
    height, width = image.shape[:2]
    shelf = round(0.39 * DENSITY)
    for base in range(height - 4, 0, -shelf):
        x = 6
        while x < width - 14:
            x += _book(image, x, base, shelf, rng)
        cv2.rectangle(image, (0, base), (width, base + 5), (96, 128, 158), -1)
    cv2.rectangle(image, (0, 0), (width - 1, height - 1), (96, 128, 158), 6)


def _book(image: Image, x: int, base: int, shelf: int, rng: Generator) -> int:
    """Draws one book's back that stands at x and returns how much room it took."""
    wide, tall = int(rng.integers(5, 14)), int(rng.uniform(0.55, 0.9) * shelf)
    if rng.random() < 0.12:
        return wide * 2
    grey = rng.integers(40, 170)
    colour = tuple(int(c) for c in np.clip(grey + rng.normal(0, 28, 3), 20, 220))
    cv2.rectangle(image, (x, base - tall), (x + wide - 1, base), colour, -1)
    cv2.rectangle(image, (x + 1, base - tall + 8), (x + wide - 3, base - tall + 8 + tall // 4), (215, 222, 226), -1)
    for y in range(base - tall + 12, base - tall + tall // 4, 4):
        cv2.line(image, (x + 2, y), (x + wide - 4, y), (40, 40, 40), 1)
    return wide


def _lines_of_text(image: Image, rng: Generator, step: int) -> None:
    height, width = image.shape[:2]
    for y in range(step, height - 2, step):
        words = " ".join(rng.choice(WORDS, 8))
        cv2.putText(image, words, (3, y), cv2.FONT_HERSHEY_SIMPLEX, step / 32, (50, 50, 54), 1, cv2.LINE_AA)
    image[:, width - 4 :] = image[0, 0]


def _print(image: Image, side: str, rng: Generator) -> None:
    if side != "top":
        return
    height, width = image.shape[:2]
    cv2.putText(image, str(rng.choice(WORDS)), (3, 12), cv2.FONT_HERSHEY_DUPLEX, 0.42, (20, 20, 120), 1, cv2.LINE_AA)
    cv2.rectangle(image, (width // 2, 18), (width - 5, height // 2), (110, 130, 90), -1)
    cv2.circle(image, (3 * width // 4, height // 3), width // 9, (60, 90, 170), -1, cv2.LINE_AA)
    _lines_of_text(image[18:, : width // 2 - 2], rng, 7)
    _lines_of_text(image[height // 2 + 2 :, width // 2 :], rng, 7)


def _poster(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    sky = np.linspace((200, 170, 120), (190, 210, 235), height)[:, None]
    image[:] = sky.astype(np.uint8)
    for level in (0.55, 0.7, 0.85):
        ridge = np.cumsum(rng.normal(0, 2.2, 12)) + level * height
        hill = [(0, height), *zip(np.linspace(0, width, 12), ridge, strict=True), (width, height)]
        cv2.fillPoly(image, [np.array(hill, np.int32)], tuple(int(180 - 130 * level + d) for d in (20, 30, 0)))
    cv2.putText(image, "ATLAS", (width // 12, height // 5), cv2.FONT_HERSHEY_DUPLEX, 1.0, (60, 50, 40), 2, cv2.LINE_AA)
    cv2.rectangle(image, (0, 0), (width - 1, height - 1), (40, 52, 60), 8)


def _screen(image: Image, side: str, rng: Generator) -> None:
    if side == "front":
        glow = np.linspace(40, 16, image.shape[1])[None, :, None]
        image[6:-6, 6:-6] = np.broadcast_to(glow, image.shape)[6:-6, 6:-6].astype(np.uint8)


def _keyboard(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    for y in range(3, height - 4, 7):
        for x in range(3 + y % 3, width - 5, 7):
            cv2.rectangle(image, (x, y), (x + 4, y + 4), (180, 182, 184), -1)


def _rug(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    for inset, colour in ((6, (150, 160, 176)), (14, (84, 92, 120)), (24, (150, 160, 176))):
        if min(height, width) > 3 * inset:
            cv2.rectangle(image, (inset, inset), (width - inset, height - inset), colour, 3)
    image[::2] = (image[::2] * 0.96).astype(np.uint8)


def _leaves(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    for _ in range(height * width // 220):
        centre = (int(rng.integers(width)), int(rng.integers(height)))
        green = (int(rng.integers(20, 60)), int(rng.integers(70, 150)), int(rng.integers(20, 70)))
        cv2.ellipse(image, centre, (11, 4), float(rng.uniform(0, 180)), 0, 360, green, -1, cv2.LINE_AA)


def _glass(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    image[:] = np.linspace((255, 246, 232), (214, 226, 214), height)[:, None].astype(np.uint8)
    cv2.rectangle(image, (0, 0), (width - 1, height - 1), (236, 238, 238), 24)
    cv2.rectangle(image, (width // 2 - 8, 0), (width // 2 + 8, height), (236, 238, 238), -1)
    cv2.rectangle(image, (12, 12), (width - 13, height - 13), (170, 172, 174), 1)


def _door(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    for top, bottom in ((0.08, 0.45), (0.52, 0.93)):
        corners = (width // 6, round(top * height)), (width - width // 6, round(bottom * height))
        cv2.rectangle(image, *corners, (120, 134, 146), 3)
    cv2.circle(image, (width // 10, height // 2), 7, (70, 80, 84), -1, cv2.LINE_AA)


def _radiator(image: Image, side: str, rng: Generator) -> None:
    for x in range(0, image.shape[1], 12):
        image[:, x : x + 3] = (176, 178, 180)


LOOKS: dict[str, tuple[tuple[int, int, int], Painter, float]] = {  # base colour (BGR), painter, strength of the grain
    "wall": ((214, 222, 226), _wall, 1.6),
    "ceiling": ((232, 234, 236), _plain, 1.2),
    "cupboard": ((206, 212, 216), _panels, 1.5),
    "counter": ((198, 204, 208), _counter, 2.0),
    "fridge": ((222, 222, 220), _fridge, 1.5),
    "hob": ((34, 34, 36), _hob, 1.0),
    "wood": ((98, 142, 178), _wood, 3.0),
    "dark wood": ((52, 74, 98), _wood, 2.0),
    "fabric": ((116, 110, 100), _fabric, 4.0),
    "linen": ((224, 222, 218), _fabric, 2.5),
    "print": ((232, 236, 238), _print, 1.5),
    "poster": ((200, 200, 200), _poster, 1.5),
    "screen": ((24, 24, 24), _screen, 1.0),
    "keyboard": ((60, 60, 62), _keyboard, 1.0),
    "books": ((54, 76, 96), _books, 2.0),
    "rug": ((110, 120, 148), _rug, 3.0),
    "lamp": ((60, 60, 60), _plain, 1.0),
    "shade": ((190, 220, 236), _plain, 2.0),
    "pot": ((86, 108, 150), _plain, 3.0),
    "leaves": ((28, 70, 36), _leaves, 3.0),
    "dark": ((40, 40, 42), _plain, 1.5),
    "glass": ((240, 240, 236), _glass, 0.6),
    "door": ((150, 164, 176), _door, 1.5),
    "radiator": ((226, 228, 228), _radiator, 1.0),
}
