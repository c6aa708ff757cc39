"""The codes of the dictionaries as a camera sees them: turned four ways, and with cells that run into one another.

A blurred cell takes some grey from its neighbours, the border and the paper. Codes that are blurred likewise are
matched to it, so that a marker is read where its cells cannot be told apart any more. Pictures are `reading`'s.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.float32]

DICTIONARIES = tuple(sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_")))
FINE = 8  # samples to a cell in which a blur is reckoned
SPOT = 0.5  # of a cell's side: the part whose mean grey is taken
BLURS = (0.0, 0.35, 0.55)  # standard deviations in cells that codes are matched at
CLIPPED = 0.5  # of the largest step: more is not believed to be the code's
GRAIN = 4  # samples to a cell where a whole square is compared
SHARPNESS = (0.15, 0.3, 0.45, 0.6)  # standard deviations in cells that whole squares are compared at


@dataclass(frozen=True, eq=False)
class Book:
    """A dictionary: row k * ids + id of `codes` holds its cells (0, 1) turned clockwise k times.

    `seen` are the same with mean 0 and length 1, once for each blur, and `steps` what `steps` makes of them. `edges`
    counts, for each row, the neighbouring cells that differ, the border's included: few make a figure that ordinary
    pictures hold too. `stripes`: whether all of a row's lines of cells are alike, along or across.
    """

    inner: int  # cells on a side without the border
    codes: Rows
    seen: tuple[Rows, ...]
    steps: Rows
    edges: NDArray[np.intp]
    stripes: NDArray[np.bool_]

    @property
    def modules(self) -> int:
        """Cells on a side with the border."""
        return self.inner + 2

    @property
    def ids(self) -> int:
        """How many codes there are."""
        return len(self.codes) // 4

    def rows(self, rows: Rows, ids: Collection[int] | None) -> Rows:
        """Those of these ids, turned four ways; None: all."""
        if ids is None:
            return rows
        return rows[[turns * self.ids + marker for turns in range(4) for marker in sorted(ids)]]


@lru_cache(maxsize=8)
def book(dictionary: str) -> Book:
    """The codes of a predefined dictionary; ValueError names the choices."""
    known = predefined(dictionary)
    inner = int(known.markerSize)
    to_bits = cv2.aruco.Dictionary.getBitsFromByteList
    bits = [to_bits(code[None], inner) for code in known.bytesList]
    codes = np.array([np.rot90(grid, -k).ravel() for k in range(4) for grid in bits], np.float32)
    seen = tuple(_through(codes, inner, _gauss(blur)) for blur in BLURS)
    whole = grid(codes, inner)[:, 1:-1, 1:-1] > 0.5
    edges = (whole[:, 1:] != whole[:, :-1]).sum(axis=(1, 2)) + (whole[:, :, 1:] != whole[:, :, :-1]).sum(axis=(1, 2))
    cells = codes.reshape(-1, inner, inner)
    stripes = (cells == cells[:, :1]).all(axis=(1, 2)) | (cells == cells[:, :, :1]).all(axis=(1, 2))
    return Book(inner, codes, seen, steps(codes, inner), np.asarray(edges, np.intp), stripes)


def predefined(dictionary: str) -> Any:
    """OpenCV's own dictionary of that name; ValueError names the choices."""
    if dictionary not in DICTIONARIES:
        raise ValueError(f"dictionary: expected one of {', '.join(DICTIONARIES)}, got {dictionary!r}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))


def normalised(rows: NDArray[Any]) -> NDArray[Any]:
    """Each row with mean 0 and length 1; a flat one is all 0."""
    centred = rows - rows.mean(axis=1, keepdims=True)
    return np.asarray(centred / np.maximum(np.linalg.norm(centred, axis=1, keepdims=True), 1e-6))


def steps(cells: NDArray[Any], size: int) -> Rows:
    """From each cell to the next, along and across, of cells (n, size * size): clipped, and each row of length 1.

    In whatever light: it takes hardly anything from the steps, and its own are clipped.
    """
    square = cells.reshape(-1, size, size)
    found = np.concatenate(
        [np.diff(square, axis=axis).reshape(len(square), size * (size - 1)) for axis in (1, 2)], axis=1
    )
    most = CLIPPED * np.abs(found).max(axis=1, keepdims=True)
    found = np.clip(found, -most, most)
    return np.asarray(found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-6), np.float32)


def grid(inner: Rows, size: int) -> NDArray[np.float32]:
    """Cells (n, size * size) within their dark border and one light cell of paper around: (n, size + 4, size + 4)."""
    cells = np.pad(inner.reshape(-1, size, size), ((0, 0), (1, 1), (1, 1)))
    return np.pad(cells, ((0, 0), (1, 1), (1, 1)), constant_values=1.0)


@lru_cache(maxsize=512)
def cells(dictionary: str, row: int) -> NDArray[np.float32]:
    """A row of the book as it is printed, border and a cell of paper included: (modules + 2, modules + 2); 0: dark."""
    known = book(dictionary)
    return np.asarray(grid(known.codes[row][None], known.inner)[0], np.float32)


def _through(codes: Rows, inner: int, kernel: Array | None) -> Rows:
    """The codes after a blur, which is linear: so that of each single cell, and of what is around them, will do."""
    if kernel is None:
        return np.asarray(normalised(codes), np.float32)
    single = grid(np.concatenate((np.zeros((1, inner * inner)), np.eye(inner * inner))).astype(np.float32), inner)
    blurred = np.array(
        [_spots(cv2.filter2D(_fine(cells), -1, kernel, borderType=cv2.BORDER_REPLICATE)) for cells in single]
    )
    around, of_cell = blurred[0], blurred[1:] - blurred[0]
    return np.asarray(normalised(codes @ of_cell + around), np.float32)


def _fine(cells: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.kron(cells, np.ones((FINE, FINE), np.float32))


def _spots(picture: NDArray[Any]) -> Array:
    """The mean grey of the middle of the inner cells."""
    cells = len(picture) // FINE
    out = round(FINE * (1 - SPOT) / 2)
    parts = picture.reshape(cells, FINE, cells, FINE)[:, out : FINE - out, :, out : FINE - out].mean(axis=(1, 3))
    return np.asarray(parts[2:-2, 2:-2].ravel(), float)


def _gauss(blur: float) -> Array | None:
    if blur == 0:
        return None
    kernel = cv2.getGaussianKernel(6 * FINE + 1, blur * FINE)
    return np.asarray(kernel @ kernel.T, float)


@lru_cache(maxsize=512)
def faces(dictionary: str, row: int) -> NDArray[np.float32]:
    """How a row of the book looks whole, border included: (sharpnesses, modules * GRAIN, modules * GRAIN), 0 to 1."""
    fine = _fine(cells(dictionary, row))
    blurred = np.array([cv2.GaussianBlur(fine, (0, 0), sharpness * FINE) for sharpness in SHARPNESS])
    count, step = len(fine) // FINE * GRAIN, FINE // GRAIN
    coarse = blurred.reshape(-1, count, step, count, step).mean(axis=(2, 4))
    return np.asarray(coarse[:, GRAIN:-GRAIN, GRAIN:-GRAIN], np.float32)
