"""Markers in a picture: which, and where their corners are. Where they are in the apartment is in `pose`.

OpenCV proposes dark squares, also those that it could not decode itself. Each is decoded softly: the mean grey of
every cell is correlated with every code of the whole dictionary in its four rotations, and the best one wins only
if it is wanted. A marker at the limit is read at half the size that whole bits need, and a neighbour in the
dictionary is never taken for the target. `corners` then makes the corners exact.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.corners import refine, sample

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

DICTIONARIES = tuple(sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_")))
SMALLEST_PX = 10.0  # side of the squares looked for; below 12 or so nothing can be decoded
TARGET_CORRELATION = 0.65  # with targets: no false one in some 7000 squares at 0.6, and 0.7 costs small markers
ANY_CORRELATION = 0.85  # with no targets, any of a thousand codes may fit by chance: be strict
FIRST_CORRELATION = 0.45  # of a square worth refining: the unrefined corners are half a pixel off
DARK_BORDER = 0.8  # share of the border cells that must be darker than the middle between dark and light
LEAST_CONTRAST = 8.0  # grey levels between light and dark cells; below is noise
CELL_SPOTS = (-0.25, 0.0, 0.25)  # where a cell is sampled, in cells from its middle: its neighbours blur in outside


@dataclass(frozen=True, eq=False)
class Detection:
    """A marker in a picture: `corners` (4, 2) in pixels, clockwise from the marker's own top-left.

    Pixel centres are whole numbers. `confidence` is the correlation of the cells with the code, 0..1.
    """

    marker: int
    corners: Array
    confidence: float


def detect(image: Picture, dictionary: str, targets: Collection[int] | None = None) -> list[Detection]:
    """Every marker of the dictionary (`DICT_5X5_1000`, ...) in the picture, or only the targets; best first.

    `image` is grey (h, w) or BGR (h, w, 3). A marker shown twice is returned twice. When targets are given and one
    is missing, a slower look for small and dark ones follows. ValueError for an unknown dictionary, a target that
    is not in it, or another kind of picture.
    """
    book, grey = _book(dictionary), _grey(image)
    wanted = None if targets is None else _known(targets, book, dictionary)
    found: list[Detection] = []
    for look in (_squares, _closely):
        found = _distinct([*found, *_read(grey, look(grey, dictionary), book, wanted)])
        if wanted is None or wanted <= {d.marker for d in found}:
            break
    return found


def _known(targets: Collection[int], book: _Book, dictionary: str) -> frozenset[int]:
    ids = range(len(book.codes) // 4)
    if not all(target in ids for target in targets):
        raise ValueError(f"targets: expected ids 0 to {ids[-1]} of {dictionary}, got {sorted(targets)}")
    return frozenset(targets)


@dataclass(frozen=True, eq=False)
class _Book:
    """The codes of a dictionary: row 4 * id + k holds it turned clockwise k times, mean 0 and length 1."""

    inner: int  # cells on a side without the border
    codes: NDArray[np.float32]

    @property
    def modules(self) -> int:
        return self.inner + 2


@lru_cache(maxsize=8)
def _book(dictionary: str) -> _Book:
    predefined = _predefined(dictionary)
    inner = int(predefined.markerSize)
    to_bits = cv2.aruco.Dictionary.getBitsFromByteList
    bits = [to_bits(code[None], inner) for code in predefined.bytesList]
    turned = np.array([np.rot90(grid, -k).ravel() for grid in bits for k in range(4)], np.float32)
    return _Book(inner, _normalised(turned))


def _predefined(dictionary: str) -> Any:
    if dictionary not in DICTIONARIES:
        raise ValueError(f"dictionary: expected one of {', '.join(DICTIONARIES)}, got {dictionary!r}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))


def _normalised(rows: NDArray[Any]) -> NDArray[Any]:
    centred = rows - rows.mean(axis=1, keepdims=True)
    normalised: NDArray[Any] = centred / np.maximum(np.linalg.norm(centred, axis=1, keepdims=True), 1e-6)
    return normalised


def _grey(image: Picture) -> Picture:
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise ValueError(f"image: expected uint8 (h, w) or (h, w, 3), got {image.dtype} {image.shape}")
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def _closely(grey: Picture, dictionary: str) -> Array:
    """Squares (n, 4, 2) in the picture with its contrast evened out and enlarged twice: small and dark ones."""
    even = cv2.createCLAHE(clipLimit=2.0, tileGridSize=(8, 8)).apply(grey)
    twice = cv2.resize(even, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    return (_squares(np.asarray(twice, np.uint8), dictionary, enlarged=2) + 0.5) / 2 - 0.5


def _squares(grey: Picture, dictionary: str, enlarged: int = 1) -> Array:
    """Squares (n, 4, 2) in the picture as it is, roughly, clockwise; nested and doubled ones too."""
    detector = _detector(dictionary, max(grey.shape), enlarged)
    accepted, _, rejected = detector.detectMarkers(grey)
    squares = [np.asarray(square, float).reshape(4, 2) for square in (*accepted, *rejected)]
    return np.array(squares).reshape(-1, 4, 2)


@lru_cache(maxsize=8)
def _detector(dictionary: str, longest_px: int, enlarged: int) -> Any:
    wanted = cv2.aruco.DetectorParameters()
    wanted.adaptiveThreshWinSizeMin, wanted.adaptiveThreshWinSizeMax, wanted.adaptiveThreshWinSizeStep = 7, 21, 14
    wanted.minMarkerPerimeterRate = 4 * SMALLEST_PX * enlarged / longest_px
    wanted.minMarkerDistanceRate = 0.0  # hand out nested squares too, the paper's rim may hide the marker
    wanted.minDistanceToBorder = 1
    return cv2.aruco.ArucoDetector(_predefined(dictionary), wanted)


def _read(grey: Picture, squares: Array, book: _Book, targets: frozenset[int] | None) -> list[Detection]:
    """Decodes the squares twice: roughly, to drop nearly all of them, and again with exact corners."""
    every = np.arange(len(book.codes))
    wanted = every if targets is None else np.array([4 * marker + k for marker in targets for k in range(4)], int)
    first = _match(grey, squares, book, wanted)
    found: list[Detection] = []
    for index in np.argsort(-first.correlation):
        if first.correlation[index] < FIRST_CORRELATION or any(_overlap(d.corners, squares[index]) for d in found):
            continue
        corners = refine(grey, squares[index], book.modules)
        detection = None if corners is None else _decode(grey, corners, book, every)
        if detection and _accepted(detection, targets):
            found.append(detection)
    return found


def _decode(grey: Picture, corners: Array, book: _Book, rows: NDArray[np.intp]) -> Detection:
    match = _match(grey, corners[None], book, rows)
    marker, turns = divmod(int(match.row[0]), 4)
    return Detection(marker, np.roll(corners, -turns, axis=0), float(np.clip(match.correlation[0], 0, 1)))


def _accepted(detection: Detection, targets: frozenset[int] | None) -> bool:
    if targets is None:
        return detection.confidence >= ANY_CORRELATION
    return detection.marker in targets and detection.confidence >= TARGET_CORRELATION


@dataclass(frozen=True, eq=False)
class _Match:
    """For each square the best row of the book and its correlation, 0 where the border is not dark."""

    row: NDArray[np.intp]
    correlation: Array


def _match(grey: Picture, squares: Array, book: _Book, rows: NDArray[np.intp]) -> _Match:
    if not len(squares) or not len(rows):
        return _Match(np.zeros(len(squares), np.intp), np.zeros(len(squares)))
    cells = _cells(grey, squares, book.modules)
    inner = cells[:, 1:-1, 1:-1].reshape(len(squares), -1)
    correlations = _normalised(inner) @ book.codes[rows].T
    best = correlations.argmax(axis=1)
    row = rows[best]
    correlation = np.take_along_axis(correlations, best[:, None], axis=1)[:, 0]
    return _Match(row, np.where(_bordered(cells, inner, book.codes[row] > 0), correlation, 0.0))


def _bordered(cells: Array, inner: Array, light_bits: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether the border is as dark as the code's dark cells, and these darker than its light ones."""
    high = (inner * light_bits).sum(axis=1) / light_bits.sum(axis=1)
    low = (inner * ~light_bits).sum(axis=1) / (~light_bits).sum(axis=1)
    ring = np.ones(cells.shape[1:], bool)
    ring[1:-1, 1:-1] = False
    dark = (cells[:, ring] < (high + low)[:, None] / 2).mean(axis=1)
    sound: NDArray[np.bool_] = (dark >= DARK_BORDER) & (high - low >= LEAST_CONTRAST)
    return sound


def _cells(grey: Picture, squares: Array, modules: int) -> Array:
    """Mean grey of the middle of every cell, (n, modules, modules), border included."""
    spots = (np.arange(modules)[:, None] + 0.5 + CELL_SPOTS).ravel() / modules
    across, down = np.meshgrid(spots, spots)
    x, y = _place(squares, across.ravel(), down.ravel())
    count = len(CELL_SPOTS)
    means: Array = sample(grey, x, y).reshape(-1, modules, count, modules, count).mean(axis=(2, 4))
    return means


def _place(squares: Array, u: Array, v: Array) -> tuple[Array, Array]:
    """Points (u, v) of the unit square in each of the squares: x and y, (n, len(u)) (Heckbert 1989, section 2.2.3)."""
    a, b, c, d = np.moveaxis(squares, 1, 0)
    bend, right, low = a - b + c - d, b - c, d - c
    area = right[:, 0] * low[:, 1] - low[:, 0] * right[:, 1]
    area = np.where(np.abs(area) < 1e-9, 1e-9, area)
    g = (bend[:, 0] * low[:, 1] - low[:, 0] * bend[:, 1]) / area
    h = (right[:, 0] * bend[:, 1] - bend[:, 0] * right[:, 1]) / area
    along, across = b - a + g[:, None] * b, d - a + h[:, None] * d
    over = 1 + g[:, None] * u + h[:, None] * v
    x = (along[:, :1] * u + across[:, :1] * v + a[:, :1]) / over
    y = (along[:, 1:] * u + across[:, 1:] * v + a[:, 1:]) / over
    return x, y


def _distinct(detections: list[Detection]) -> list[Detection]:
    """Best first, and of those that overlap only the best."""
    kept: list[Detection] = []
    for detection in sorted(detections, key=lambda d: -d.confidence):
        if not any(_overlap(detection.corners, other.corners) for other in kept):
            kept.append(detection)
    return kept


def _overlap(one: Array, other: Array) -> bool:
    """Whether the middle of either square lies within half the other's side of its middle."""
    apart = np.linalg.norm(one.mean(axis=0) - other.mean(axis=0))
    sides = [np.linalg.norm(np.roll(square, 1, axis=0) - square, axis=1).max() for square in (one, other)]
    return bool(apart < max(sides) / 2)
