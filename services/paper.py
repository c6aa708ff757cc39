"""Something to draw on: lines, boxes and words on a white sheet that becomes a PNG. Not here: what is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from services.apartment.floor import XY

SCALE = 2  # pixels of the file per unit of the sheet, for screens that show fine print
FINE = 4  # bits behind the point of a coordinate
Colour = tuple[int, int, int]  # red, green, blue
INK, GREY, PALE, WHITE = (38, 43, 51), (120, 128, 140), (226, 230, 235), (255, 255, 255)


class Paper:
    """A sheet of `width` x `height` units, the origin at the top left."""

    def __init__(self, width: int, height: int) -> None:
        self.height = height
        self._pixels = np.full((height * SCALE, width * SCALE, 3), 255, np.uint8)
        self._font = cv2.FontFace("sans") if hasattr(cv2, "FontFace") else None  # since OpenCV 5

    def png(self) -> bytes:
        """The sheet as a file."""
        return bytes(cv2.imencode(".png", self._pixels)[1])

    def line(self, points: Sequence[XY], colour: Colour, width: float = 1.0, *, closed: bool = False) -> None:
        """Straight from point to point."""
        cv2.polylines(self._pixels, [_fixed(points)], closed, _bgr(colour), _pixels(width), cv2.LINE_AA, FINE)

    def dashes(self, one: XY, other: XY, colour: Colour, width: float = 1.0, dash: float = 5.0) -> None:
        """A broken line."""
        start, way = np.array(one), np.array(other) - np.array(one)
        length = float(np.hypot(*way))
        for begin in np.arange(0, length, 2 * dash):
            last = min(length, begin + dash)
            self.line([_at(start + way * begin / length), _at(start + way * last / length)], colour, width)

    def shape(self, points: Sequence[XY], colour: Colour) -> None:
        """A filled polygon."""
        cv2.fillPoly(self._pixels, [_fixed(points)], _bgr(colour), cv2.LINE_AA, FINE)

    def box(self, left: float, top: float, width: float, height: float, colour: Colour) -> None:
        """A filled rectangle."""
        self.shape([(left, top), (left + width, top), (left + width, top + height), (left, top + height)], colour)

    def dot(self, at: XY, radius: float, colour: Colour, rim: Colour | None = None) -> None:
        """A filled circle."""
        if rim is not None:
            self.dot(at, radius + 1.5, rim)
        self.shape(
            [(at[0] + radius * cos(turn), at[1] + radius * sin(turn)) for turn in np.linspace(0, 6.283, 33)], colour
        )

    def arrow(self, at: XY, yaw_deg: float, colour: Colour, size: float = 9.0) -> None:
        """A pointed triangle; the yaw counter-clockwise from the right."""
        turns = ((0.0, 1.0), (140.0, 0.75), (180.0, 0.3), (220.0, 0.75))
        angles = [(radians(yaw_deg + turn), size * far) for turn, far in turns]
        self.shape([(at[0] + far * cos(a), at[1] - far * sin(a)) for a, far in angles], colour)

    def image(self, left: float, top: float, width: float, height: float, pixels: NDArray[np.uint8]) -> None:
        """A small picture (rows, columns, RGB), each of its pixels a sharp rectangle."""
        x, y, w, h = (round(number * SCALE) for number in (left, top, width, height))
        self._pixels[y : y + h, x : x + w] = cv2.resize(pixels[..., ::-1], (w, h), interpolation=cv2.INTER_NEAREST)

    def text(
        self, at: XY, words: str, colour: Colour = INK, size: float = 11.0, weight: int = 400, align: str = "left"
    ) -> None:
        """One line of words, `at` the left (or right, or middle) end of its foot."""
        left = at[0] - {"left": 0.0, "right": 1.0, "middle": 0.5}[align] * self.width(words, size, weight)
        where = (round(left * SCALE), round(at[1] * SCALE))
        if self._font is not None:
            cv2.putText(self._pixels, words, where, _bgr(colour), self._font, round(size * SCALE), weight)
        else:
            plain = cv2.FONT_HERSHEY_SIMPLEX
            cv2.putText(self._pixels, words, where, plain, size / 24 * SCALE, _bgr(colour), SCALE - 1, cv2.LINE_AA)

    def label(self, at: XY, words: str, colour: Colour = INK, size: float = 11.0, weight: int = 500) -> None:
        """Words on a white plate, for places where there is something below."""
        width = self.width(words, size, weight)
        self.box(at[0] - 3, at[1] - size, width + 6, size + 4, WHITE)
        self.text(at, words, colour, size, weight)

    def width(self, words: str, size: float, weight: int = 400) -> float:
        """How wide words are."""
        if self._font is None:
            return float(cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, size / 24, 1)[0][0])
        sheet = (self._pixels.shape[1], self._pixels.shape[0])
        rectangle = cv2.getTextSize(sheet, words, (0, 0), self._font, round(size * SCALE), weight)
        return float(rectangle[2]) / SCALE

    def fitting(self, words: str, size: float, most: float) -> str:
        """The words, shortened to a width."""
        if self.width(words, size) <= most:
            return words
        while words and self.width(f"{words}…", size) > most:
            words = words[:-1]
        return f"{words.rstrip()}…"


def _at(point: NDArray[np.float64]) -> XY:
    return float(point[0]), float(point[1])


def _fixed(points: Sequence[XY]) -> NDArray[np.int32]:
    fixed = np.round(np.array(points, float) * SCALE * 2**FINE)
    return np.asarray(fixed, np.int32).reshape(-1, 1, 2)


def _pixels(width: float) -> int:
    return max(1, round(width * SCALE))


def _bgr(colour: Colour) -> Colour:
    return colour[2], colour[1], colour[0]
