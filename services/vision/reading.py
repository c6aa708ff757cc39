"""What stands in a square: the mean grey of its cells, the code nearest to them, and how much speaks for it.

A square that looks like a marker at a distance is common; the evidence here is what keeps a keyboard's keys, a
chessboard or a page of text from being one. Where squares come from is `squares`; who is believed is `detect`'s.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from services.vision import codes
from services.vision.codes import GRAIN, SPOT, Rows, normalised
from services.vision.corners import sample

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

SPOTS = SPOT * np.array([-0.5, 0.0, 0.5])  # where a cell is sampled, in cells from its middle
BESIDE = 0.3  # of a cell: how far outside the square the paper is looked for; some print with hardly a rim
BESIDE_PX = 1.2  # and at least: there the edge's own blur ends
AT_ONCE = 250_000  # products: of more, the matrix library makes threads, which wait for one another on a busy machine
VEIL = 5.0  # grey levels of stray light in the darkest print
SMOOTHED = 0.45  # of the noise's variance is left between pixels
NOISY = 0.8  # of a square's variance at most is believed to be noise
STEP = 0.25  # of the contrast: by this much a light cell is lighter than a dark one beside it, also in half a shadow
LIGHTER = 0.25  # of the contrast: by this much paper is lighter than the border, or it is no edge


@dataclass(frozen=True, eq=False)
class Cells:
    """The grey of squares: `grey` (n, modules, modules), `outside` (n, 4, modules): the paper beside each side."""

    grey: Array
    outside: Array

    @property
    def inner(self) -> Array:
        """The cells that carry the code, (n, cells)."""
        inner = self.grey.shape[1] - 2
        return self.grey[:, 1:-1, 1:-1].reshape(len(self.grey), inner * inner)

    @property
    def border(self) -> Array:
        """The border's cells along each side, (n, 4, modules), corners twice."""
        cells = self.grey
        return np.stack((cells[:, 0], cells[:, :, -1], cells[:, -1, ::-1], cells[:, ::-1, 0]), axis=1)


@dataclass(frozen=True, eq=False)
class Match:
    """For each square the best row of the book, its correlation, and that of the best row of another id."""

    row: NDArray[np.intp]
    correlation: Array
    second: Array


@dataclass(frozen=True, eq=False)
class Evidence:
    """For each square what does not depend on how well the code fits.

    `contrast`: grey levels between light and dark cells; `dark`: share of the border's cells nearer to dark than to
    light; `edged`: share of the outline with lighter paper beside it, `worst` the same of its worst side. `stepped`:
    share of the borders between a light and a dark cell at which the grey really steps; 1 where there are none. `deep`:
    how far below the light cells the dark ones lie, where the border lies 1 below. `uneven`: by how much the border's
    cells differ, as a share of the contrast.
    """

    contrast: Array
    dark: Array
    edged: Array
    worst: Array
    stepped: Array
    deep: Array
    uneven: Array


def cells(grey: Picture, squares: Array, modules: int) -> Cells:
    """Looks into squares (n, 4, 2)."""
    x, y = place(squares, *_spots(modules))
    spots = sample(grey, x, y).reshape(len(squares), len(SPOTS) ** 2, modules, modules)
    means = spots.sum(axis=1, dtype=np.uint16) / len(SPOTS) ** 2
    return Cells(means, _outside(grey, squares, (np.arange(modules) + 0.5) / modules))


@lru_cache(maxsize=8)
def _spots(modules: int) -> tuple[Array, Array]:
    """Where cells are sampled, as shares of the square: the first spot of every cell, then the second, ..."""
    middles = np.arange(modules) + 0.5
    down, across, row, column = np.meshgrid(SPOTS, SPOTS, middles, middles, indexing="ij")
    return ((column + across) / modules).ravel(), ((row + down) / modules).ravel()


def _outside(grey: Picture, squares: Array, share: Array) -> Array:
    along = np.roll(squares, -1, axis=1) - squares
    length = np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-9)
    outward = np.stack((along[..., 1], -along[..., 0]), axis=2) / length
    across = np.roll(length, 1, axis=1) / len(share) * BESIDE
    start = squares + outward * np.maximum(across, BESIDE_PX)
    at = start[:, :, None] + share[:, None] * along[:, :, None]
    return sample(grey, at[..., 0], at[..., 1]).astype(float)


def likely(inner: Array, size: int, rows: Rows) -> Array:
    """How much cells (n, cells) are like the likeliest code in whatever light: by the steps between them."""
    return np.asarray(_products(codes.steps(_unshaded(inner), size), rows).max(axis=1), float)


def fits(inner: Array, rows: Rows) -> NDArray[np.float32]:
    """How well cells (n, cells) correlate with each row, (n, rows)."""
    return _products(np.asarray(normalised(inner), np.float32), rows)


def _products(looks: Rows, rows: Rows) -> NDArray[np.float32]:
    found = np.empty((len(looks), len(rows)), np.float32)
    few = max(1, AT_ONCE // max(1, looks.size))
    for start in range(0, len(rows), few):
        found[:, start : start + few] = looks @ rows[start : start + few].T
    return found


def _unshaded(grey: Array) -> Array:
    """Grey levels as logarithms: there a shadow takes the same from light and dark, and can be lived with."""
    return np.asarray(np.log(np.maximum(grey, 0) + VEIL))


def match(inner: Array, seen: tuple[Rows, ...]) -> Match:
    """The rows that the cells (n, cells) correlate with best, at whatever blur."""
    best = fits(inner, seen[0])
    for rows in seen[1:]:
        np.maximum(best, fits(inner, rows), out=best)
    np.maximum(best, fits(_unshaded(inner), seen[0]), out=best)
    each, count = np.arange(len(best)), best.shape[1] // 4
    row = best.argmax(axis=1)
    others = np.maximum.reduce([best[:, turn * count : (turn + 1) * count] for turn in range(4)])
    others[each, row % count] = -1.0
    return Match(row, np.asarray(best[each, row], float), np.asarray(others.max(axis=1), float))


def evidence(found: Cells, light: NDArray[np.bool_]) -> Evidence:
    """How much each square looks like a marker whose cells (n, cells) are light where told."""
    inner = found.inner
    high = (inner * light).sum(axis=1) / np.maximum(light.sum(axis=1), 1)
    low = (inner * ~light).sum(axis=1) / np.maximum((~light).sum(axis=1), 1)
    low = np.where(light.all(axis=1), found.border.mean(axis=(1, 2)), low)
    return _evidence(found, high, low, _stepped(found.grey[:, 1:-1, 1:-1], light, STEP * (high - low)))


def appearance(found: Cells) -> Evidence:
    """The same before any code is known: the lightest and darkest cells stand for the light and the dark ones."""
    inner = np.sort(found.inner, axis=1)
    few = max(1, inner.shape[1] // 8)
    return _evidence(found, inner[:, -few:].mean(axis=1), inner[:, :few].mean(axis=1), np.ones(len(inner)))


def _stepped(inner: Array, light: NDArray[np.bool_], least: Array) -> Array:
    """A picture that grows lighter from one side to the other is like many codes, but it has no steps."""
    there, good, light = np.zeros(len(inner)), np.zeros(len(inner)), light.reshape(inner.shape)
    for axis in (1, 2):
        change = np.diff(light.astype(np.int8), axis=axis)
        step = np.diff(inner, axis=axis) * change
        there += (change != 0).sum(axis=(1, 2))
        good += (step > np.maximum(least, 0)[:, None, None]).sum(axis=(1, 2))
    return np.where(there > 0, good / np.maximum(there, 1), 1.0)


def _evidence(found: Cells, high: Array, low: Array, stepped: Array) -> Evidence:
    contrast = high - low
    dark = (found.border < ((high + low) / 2)[:, None, None]).mean(axis=(1, 2))
    edged = found.outside - found.border > LIGHTER * np.maximum(contrast, 1.0)[:, None, None]
    sides = edged.mean(axis=2)
    deep = contrast / np.maximum(high - found.border.mean(axis=(1, 2)), 1.0)
    uneven = np.ptp(found.border, axis=(1, 2)) / np.maximum(contrast, 1.0)
    return Evidence(contrast, dark, sides.mean(axis=1), sides.min(axis=1), stepped, deep, uneven)


def likeness(grey: Picture, square: Array, faces: NDArray[np.float32], noise: float) -> float:
    """Share of what is seen within the border, pixel by pixel, that the code explains at its best sharpness: 0 to 1.

    Letters and pictures in a frame have other shapes than cells. `noise`: the picture's, which explains nothing.
    """
    size = faces.shape[1]
    shares = (np.arange(size) + 0.5) / size
    across, down = np.meshgrid(shares, shares)
    x, y = place(square[None], across.ravel(), down.ravel())
    within = slice(GRAIN, -GRAIN)
    seen = sample(grey, x, y).astype(float).reshape(size, size)[within, within]
    wanted = faces[:, within, within]
    return max(_explained(seen, wanted, noise), _explained(_unshaded(seen), wanted[:1], 0.0))


def _explained(seen: Array, faces: NDArray[np.float32], noise: float) -> float:
    seen = seen - seen.mean()
    wanted = faces - faces.mean(axis=(1, 2), keepdims=True)
    total = float((seen**2).sum())
    total = max(total - SMOOTHED * noise**2 * seen.size, (1 - NOISY) * total, 1e-9)
    together = np.clip((wanted * seen).sum(axis=(1, 2)), 0, None) ** 2
    return float(np.max(together / np.maximum((wanted**2).sum(axis=(1, 2)), 1e-9)) / total)


def place(squares: Array, u: Array, v: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Points (u, v) of the unit square in each of the squares: x and y, (n, len(u)) (Heckbert 1989, section 2.2.3).

    In single precision: a ten-thousandth of a pixel in the largest picture.
    """
    a, b, c, d = np.moveaxis(squares, 1, 0)
    bend, right, low = a - b + c - d, b - c, d - c
    area = right[:, 0] * low[:, 1] - low[:, 0] * right[:, 1]
    area = np.where(np.abs(area) < 1e-9, 1e-9, area)
    g = (bend[:, 0] * low[:, 1] - low[:, 0] * bend[:, 1]) / area
    h = (right[:, 0] * bend[:, 1] - bend[:, 0] * right[:, 1]) / area
    along, across = b - a + g[:, None] * b, d - a + h[:, None] * d
    u, v = u.astype(np.float32), v.astype(np.float32)

    def mixed(*parts: Array) -> NDArray[np.float32]:
        there, onward, down = (part.astype(np.float32)[:, None] for part in parts)
        return np.asarray(there + onward * u + down * v, np.float32)

    over = mixed(np.ones(len(squares)), g, h)
    x, y = (mixed(a[:, axis], along[:, axis], across[:, axis]) / over for axis in (0, 1))
    return x, y
