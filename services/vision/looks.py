"""The pictures that markers are looked for in: the given one, smaller ones made of it, parts of them; pure geometry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.squares import noise

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

LEAST_PICTURE_PX = 110  # a picture with a shorter side than twice this is not shrunk
MOST_HALVINGS = 4


@dataclass(frozen=True, eq=False)
class Look:
    """A picture to look at: the given one `scale` times as large, or a part of that which begins at `begin` (x, y)."""

    grey: Picture
    scale: float
    noise: float
    begin: Array = field(default_factory=lambda: np.zeros(2))

    def back(self, points: Array) -> Array:
        """From this picture's pixels to the given one's."""
        return (points + self.begin + 0.5) / self.scale - 0.5

    def here(self, points: Array) -> Array:
        """The other way round."""
        return (points + 0.5) * self.scale - 0.5 - self.begin


def halved(grey: Picture) -> Iterator[Look]:
    """The picture, and smaller ones, each half as large as the one before."""
    scale = 1.0
    for _ in range(MOST_HALVINGS + 1):
        yield Look(grey, scale, noise(grey))
        if min(grey.shape) < 2 * LEAST_PICTURE_PX:
            return
        even = grey[: grey.shape[0] // 2 * 2, : grey.shape[1] // 2 * 2]
        grey = np.asarray(cv2.resize(even, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
        scale /= 2


def around(grey: Picture, corners: Array) -> tuple[Picture, Array]:
    """The picture around a square, half as much again on each side, and where it begins."""
    reach = longest(corners) / 2
    height, width = grey.shape
    start = np.clip(np.floor(corners.min(axis=0) - reach), 0, (width - 1, height - 1)).astype(int)
    end = np.ceil(corners.max(axis=0) + reach).astype(int) + 1
    return np.ascontiguousarray(grey[start[1] : end[1], start[0] : end[0]]), start.astype(float)


def longest(squares: Array) -> Any:
    """The longest side of one (4, 2) or of each (n, 4, 2)."""
    return np.linalg.norm(np.roll(squares, 1, axis=-2) - squares, axis=-1).max(axis=-1)


def near(squares: Array, other: Array) -> Any:
    """Whether the middle of either square, or of each (n, 4, 2), lies within half the other's side of its middle."""
    apart = np.linalg.norm(squares.mean(axis=-2) - other.mean(axis=-2), axis=-1)
    return apart < np.maximum(longest(squares), longest(other)) / 2
