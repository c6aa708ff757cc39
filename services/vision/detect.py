"""Markers in a picture: which, and where their corners are. Where they are in the apartment is in `pose`.

Dark squares are looked for (`squares`), in the picture and in smaller ones made of it, their corners made exact
(`corners`) and their cells matched with every code of the whole dictionary (`reading`, `codes`). The best code wins,
and only if it is wanted: a neighbour in the dictionary is never taken for the target. Who is believed is `belief`'s.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision import belief, codes, reading
from services.vision.codes import DICTIONARIES, Book
from services.vision.corners import refine, refine_many
from services.vision.squares import noise, squares

__all__ = ["DICTIONARIES", "Detection", "detect"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

SMALLEST_PX = 10.0  # side of the squares looked for; below 12 or so nothing can be decoded
SMALLEST_HALVED_PX = 16.0  # the same in a picture that was shrunk: smaller ones are in the one before
LEAST_PICTURE_PX = 110  # a picture with a shorter side than twice this is not shrunk
MOST_HALVINGS = 4
WIDE_WINDOW = 15  # px, in a picture that was shrunk: the border of a blurred marker, or one amid texture
OTHER_WINDOWS = (3, 23)  # px: a shadow's edge needs a narrow one
PART_WINDOWS = (9, 23)  # px, in an enlarged part
ENLARGED_PX = 80.0  # a doubtful square's side is enlarged to about this, if it is smaller
FAINT = 2.0  # grey levels: the threshold's step in an enlarged part
HOPEFUL = 4.0  # belief of a square that is worth another look
MOST_DOUBTFUL = 8  # of them


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

    `image` is grey (h, w) or BGR (h, w, 3). A marker shown twice is returned twice. Where something looks like a
    marker that could not be read, a slower look follows. ValueError for an unknown
    dictionary, a target that is not in it, or another kind of picture.
    """
    book, grey = codes.book(dictionary), _grey(image)
    wanted = None if targets is None else _known(targets, book, dictionary)
    if wanted is not None and not wanted:
        return []
    search = _Search(grey, dictionary, wanted)
    search.add(search.first())
    if search.worth_more():
        search.add(search.closer())
    return search.found()


def _known(targets: Collection[int], book: Book, dictionary: str) -> frozenset[int]:
    ids = range(book.ids)
    if not all(target in ids for target in targets):
        raise ValueError(f"targets: expected ids 0 to {ids[-1]} of {dictionary}, got {sorted(targets)}")
    return frozenset(targets)


def _grey(image: Picture) -> Picture:
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise ValueError(f"image: expected uint8 (h, w) or (h, w, 3), got {image.dtype} {image.shape}")
    grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
    return np.ascontiguousarray(grey)


@dataclass(frozen=True, eq=False)
class _Look:
    """A picture to look at: the given one `scale` times as large."""

    grey: Picture
    scale: float
    noise: float

    def back(self, points: Array) -> Array:
        """From this picture's pixels to the given one's."""
        return (points + 0.5) / self.scale - 0.5

    def here(self, points: Array) -> Array:
        """The other way round."""
        return (points + 0.5) * self.scale - 0.5


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A square with what could be read in it; corners in the given picture's pixels, from the code's top-left."""

    look: _Look
    corners: Array
    marker: int
    belief: float
    correlation: float


class _Search:
    """One picture, what has been found in it so far, and what is worth another look."""

    def __init__(self, grey: Picture, dictionary: str, wanted: frozenset[int] | None) -> None:
        self.dictionary = dictionary
        self.book = codes.book(dictionary)
        self.wanted = wanted
        self.likely = self.book.rows(self.book.seen[1], wanted)
        self.looks = list(_halved(grey))
        self.candidates: list[_Candidate] = []
        self.believed: list[_Candidate] = []

    def first(self) -> Iterator[tuple[_Look, Array]]:
        """The picture and smaller ones: each with its rough squares."""
        for look in self.looks:
            whole = look.scale == 1
            yield look, squares(look.grey, SMALLEST_PX if whole else SMALLEST_HALVED_PX)
            if not whole:
                yield look, squares(look.grey, SMALLEST_HALVED_PX, window=WIDE_WINDOW)

    def closer(self) -> Iterator[tuple[_Look, Array]]:
        """Slower looks where something may be: enlarged, with other windows; everywhere if there is nothing at all."""
        for one in self._doubtful()[:MOST_DOUBTFUL]:
            part, corner = _part(self.looks[0].grey, one.corners)
            larger = float(np.clip(ENLARGED_PX / _longest(one.corners), 1.0, 3.0))
            grey = cv2.resize(part, None, fx=larger, fy=larger, interpolation=cv2.INTER_CUBIC)
            look = _Look(np.asarray(grey, np.uint8), larger, self.looks[0].noise)
            for window in PART_WINDOWS:
                found = squares(look.grey, larger * SMALLEST_PX, window=window, step=FAINT)
                yield self.looks[0], look.back(found) + corner
        if self.wanted is None and not self.believed:
            for window in OTHER_WINDOWS:
                yield self.looks[0], squares(self.looks[0].grey, SMALLEST_PX, window=window)

    def worth_more(self) -> bool:
        """Whether something looks like a marker that could not be read, and is wanted."""
        return bool(self._doubtful())

    def _doubtful(self) -> list[_Candidate]:
        """The best of what may be markers that are wanted, each once."""
        doubtful: list[_Candidate] = []
        for one in sorted(self.candidates, key=lambda one: -one.belief):
            asked = self.wanted is None or one.marker in self.wanted
            if asked and one.belief > HOPEFUL and not any(_near(one, other) for other in (*self.believed, *doubtful)):
                doubtful.append(one)
        return doubtful

    def add(self, seen: Iterator[tuple[_Look, Array]]) -> None:
        """Reads the squares."""
        for look, rough in seen:
            self.candidates += self._read(look, rough)
        self.believed = []
        enough = belief.ENOUGH if self.wanted is None else belief.ENOUGH_OF_TARGETS
        for one in sorted(self.candidates, key=lambda one: -one.belief):
            if one.belief < enough:
                break
            if not any(_near(one, other) for other in self.believed) and self._alike(one):
                self.believed.append(one)

    def _alike(self, one: _Candidate) -> bool:
        """Whether it looks like the code all over, not only in the middle of the cells."""
        faces = codes.faces(self.dictionary, one.marker)
        like = reading.likeness(one.look.grey, one.look.here(one.corners), faces, one.look.noise)
        return like >= belief.LIKENESS

    def _read(self, look: _Look, rough: Array) -> Iterator[_Candidate]:
        """Reads twice: roughly, to drop nearly all of them, and again with better corners."""
        modules = self.book.modules
        cells = reading.cells(look.grey, rough, modules)
        maybe = belief.plausible(reading.appearance(cells))
        fits = reading.fits(cells.inner[maybe], self.likely).max(axis=1)
        rough = rough[maybe][fits > belief.FIRST_CORRELATION]
        exact = refine_many(look.grey, rough, modules)
        exact = np.where(np.isnan(exact).any(axis=(1, 2), keepdims=True), rough, exact)
        cells = reading.cells(look.grey, exact, modules)
        match = reading.match(cells.inner, self.book.seen)
        proof = reading.evidence(cells, self.book.codes[match.row] > 0.5)
        beliefs = belief.beliefs(self.book, match, proof, exact, look.noise, self._ids())
        for index in np.flatnonzero(beliefs > 0):
            row = int(match.row[index])
            turns, marker = divmod(row, self.book.ids)
            corners = np.roll(look.back(exact[index]), -turns, axis=0)
            yield _Candidate(look, corners, marker, float(beliefs[index]), float(match.correlation[index]))

    def _ids(self) -> int:
        """How many codes would do: the more, the more easily one fits by chance."""
        return self.book.ids if self.wanted is None else len(self.wanted)

    def found(self) -> list[Detection]:
        """Those that are believed and wanted, with corners as exact as can be, best first."""
        detections = []
        for one in self.believed:
            if self.wanted is None or one.marker in self.wanted:
                detections.append(Detection(one.marker, self._exact(one), min(one.correlation, 1.0)))
        return sorted(detections, key=lambda d: -d.confidence)

    def _exact(self, one: _Candidate) -> Array:
        """Its corners in the finest picture in which they can be told."""
        corners, modules = one.corners, self.book.modules
        for look in reversed([look for look in self.looks if look.scale > one.look.scale][1:]):
            here = refine_many(look.grey, look.here(corners)[None], modules)[0]
            corners = corners if np.isnan(here).any() else look.back(here)
        exact = refine(self.looks[0].grey, corners, modules)
        return corners if exact is None else exact


def _halved(grey: Picture) -> Iterator[_Look]:
    scale = 1.0
    for _ in range(MOST_HALVINGS + 1):
        yield _Look(grey, scale, noise(grey))
        if min(grey.shape) < 2 * LEAST_PICTURE_PX:
            return
        even = grey[: grey.shape[0] // 2 * 2, : grey.shape[1] // 2 * 2]
        grey, scale = (
            np.asarray(cv2.resize(even, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8),
            scale / 2,
        )


def _part(grey: Picture, corners: Array) -> tuple[Picture, Array]:
    """The picture around a square, half as much again on each side, and where it begins."""
    reach = _longest(corners) / 2
    height, width = grey.shape
    start = np.clip(np.floor(corners.min(axis=0) - reach), 0, (width - 1, height - 1)).astype(int)
    end = np.ceil(corners.max(axis=0) + reach).astype(int) + 1
    return np.ascontiguousarray(grey[start[1] : end[1], start[0] : end[0]]), start.astype(float)


def _longest(corners: Array) -> float:
    return float(np.linalg.norm(np.roll(corners, 1, axis=0) - corners, axis=1).max())


def _near(one: _Candidate, other: _Candidate) -> bool:
    """Whether the middle of either square lies within half the other's side of its middle."""
    apart = np.linalg.norm(one.corners.mean(axis=0) - other.corners.mean(axis=0))
    return bool(apart < max(_longest(one.corners), _longest(other.corners)) / 2)
