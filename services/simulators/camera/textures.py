"""What surfaces look like: seeded pictures of walls, wood, cloth, books and print, in 8-bit BGR.

Each painter gets a canvas of its base colour and draws on it; `DENSITY` pixels to the metre. The clutter is meant:
tiles, book backs and print are what a marker detector must not fall for.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from services.simulators.world import XY, World

Image = NDArray[np.uint8]
Painter = Callable[[Image, str, Generator], None]
DENSITY = 240  # texture pixels per metre; the nearest surface, the floor below the camera, shows about 440 to the metre
SHADES = {"top": 1.0, "front": 0.86, "back": 0.82, "left": 0.78, "right": 0.9, "bottom": 0.8}
WORDS = "Kaffee Zeitung Brot Atlas Garten Reise Morgen Licht Haus Wetter Musik Sommer Rezept Regal".split()


def generator(seed: int, name: str) -> Generator:
    """A source of chance of its own for every surface, the same in every run."""
    return np.random.default_rng((seed, zlib.crc32(name.encode())))


def texture(look: str, side: str, size: XY, rng: Generator) -> Image:
    """The picture of one side of a box, `size` in metres; shaded as the ceiling's light falls."""
    height, width = (max(4, round(metres * DENSITY)) for metres in reversed(size))
    base, paint, grain = LOOKS.get(look, LOOKS["cupboard"])
    image = np.full((height, width, 3), base, np.uint8)
    paint(image, side, rng)
    return _grained(image, grain, SHADES[side], rng)


def _grained(image: Image, grain: float, shade: float, rng: Generator) -> Image:
    """Adds blotches and fine grain, and shades; walls and fronts get darker towards the floor."""
    height, width = image.shape[:2]
    coarse = rng.normal(0, grain, (height // 40 + 2, width // 40 + 2)).astype(np.float32)
    blotches = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    fine = rng.normal(0, grain * 0.6, (height, width)).astype(np.float32)
    lit = (image + (blotches + fine)[..., None]) * np.float32(shade)
    return np.clip(lit, 0, 255).astype(np.uint8)


def floor(world: World, origin: XY, size: XY, seed: int) -> Image:
    """The whole floor seen from above (north up), with the soft shadows of what stands on it."""
    rng = generator(seed, "floor")
    height, width = (round(metres * DENSITY) for metres in reversed(size))
    image = np.full((height, width, 3), (120, 156, 190), np.uint8)
    _planks(image, rng)
    tiles = np.full_like(image, (196, 200, 202))
    _tiles(tiles, rng)
    tiled = np.zeros((height, width), np.uint8)
    for name in ("Kitchen", "Bathroom"):
        if name in world.rooms:
            cv2.fillPoly(tiled, [_pixels(world.rooms[name].polygon, origin, height)], 255)
    cv2.copyTo(tiles, tiled, image)
    return _grained(_shadowed(image, world, origin), 3.0, 0.92, rng)


def _pixels(points: tuple[XY, ...] | NDArray[np.float64], origin: XY, height: int) -> NDArray[np.int32]:
    flat = (np.asarray(points, float) - origin) * DENSITY
    return np.round(np.stack([flat[:, 0], height - flat[:, 1]], axis=1)).astype(np.int32)


def _shadowed(image: Image, world: World, origin: XY) -> Image:
    light = np.full(image.shape[:2], 255, np.uint8)
    for piece in world.furniture:
        if piece.z < 0.2 and piece.kind != "rug":
            box = cv2.boxPoints(((0, 0), (piece.size[0] + 0.06, piece.size[1] + 0.06), piece.yaw_deg))
            cv2.fillPoly(light, [_pixels(box + (piece.x, piece.y), origin, image.shape[0])], 130)
    soft = cv2.GaussianBlur(light, (0, 0), 0.06 * DENSITY)
    return cv2.multiply(image, cv2.merge([soft] * 3), scale=1 / 255)  # type: ignore[return-value]


def _planks(image: Image, rng: Generator) -> None:
    wide, long = round(0.14 * DENSITY), round(1.3 * DENSITY)
    for y in range(0, image.shape[0], wide):
        for x in range(-int(rng.integers(long)), image.shape[1], long):
            shift = rng.normal(0, 2, 3) + rng.normal(0, 8)
            board = image[y : y + wide, max(x, 0) : max(x + long, 0)]
            board[:] = np.clip(board + shift, 0, 255).astype(np.uint8)
            cv2.rectangle(image, (x, y), (x + long, y + wide), (88, 116, 144), 1)


def _tiles(image: Image, rng: Generator) -> None:
    side = round(0.3 * DENSITY)
    for y in range(0, image.shape[0], side):
        for x in range(0, image.shape[1], side):
            tile = image[y : y + side, x : x + side]
            tile[:] = np.clip(tile + rng.normal(0, 4), 0, 255).astype(np.uint8)
            cv2.rectangle(image, (x, y), (x + side, y + side), (150, 154, 156), 2)


def _plain(image: Image, side: str, rng: Generator) -> None:
    """Only its colour."""


def _wall(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    fall = np.linspace(1.0, 0.9, height)[:, None, None]
    image[:] = (image * fall).astype(np.uint8)
    if height > 2.5 * DENSITY:  # only where it stands on the floor
        image[height - round(0.07 * DENSITY) :] = (222, 226, 228)
        cv2.line(image, (0, height - round(0.07 * DENSITY)), (width, height - round(0.07 * DENSITY)), (150, 152, 156), 1)


def _wood(image: Image, side: str, rng: Generator) -> None:
    height, width = image.shape[:2]
    rings = np.cumsum(rng.normal(0, 1.6, height)) * 0.6
    rings -= np.linspace(0, rings[-1], height)
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
    height, width = image.shape[:2]
    if side == "front":
        glow = np.linspace(40, 16, width)[None, :, None]
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
