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
from services.vision.squares import WINDOW, noise, squares

__all__ = ["DICTIONARIES", "Detection", "detect"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

SMALLEST_PX = 10.0  # side of the squares looked for; below 12 or so nothing can be decoded
SMALLEST_HALVED_PX = 16.0  # the same in a picture that was shrunk: smaller ones are in the one before
LEAST_PICTURE_PX = 110  # a picture with a shorter side than twice this is not shrunk
MOST_HALVINGS = 4
CLOSER_WINDOWS = (3, 23)  # px: a shadow's edge needs a narrow one, a border amid texture a wide one
FAINT = 1.5  # grey levels: the step where nothing else was found, in a picture that was smoothed
ENLARGED_PX = 4_500_000  # pictures with more pixels are not enlarged
NEAR = 0.35  # of a side: squares whose middles are nearer are looks at the same thing
LOOKS = 4  # at the same thing that are weighed
HOPEFUL = 6.0  # belief of a square that is worth another look


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

    `image` is grey (h, w) or BGR (h, w, 3). A marker shown twice is returned twice. When a target is missing, or
    something looks like a marker that could not be read, a slower look follows. ValueError for an unknown
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
        self.looks = list(_halved(grey))
        self.candidates: list[_Candidate] = []
        self.believed: list[_Candidate] = []

    def first(self) -> Iterator[tuple[_Look, Array]]:
        """The picture and smaller ones: each with its rough squares."""
        for look in self.looks:
            yield look, squares(look.grey, SMALLEST_PX if look.scale == 1 else SMALLEST_HALVED_PX)

    def closer(self) -> Iterator[tuple[_Look, Array]]:
        """Slower looks: with other windows, smoothed for faint ones, enlarged for small ones."""
        for look in self.looks[:2]:
            for window in CLOSER_WINDOWS:
                yield look, squares(look.grey, SMALLEST_PX, window=window)
        look = self.looks[0]
        smooth = np.asarray(cv2.GaussianBlur(look.grey, (0, 0), 1.0), np.uint8)
        yield look, squares(smooth, SMALLEST_PX, window=WINDOW + 2, step=FAINT)
        if look.grey.size <= ENLARGED_PX:
            twice = cv2.resize(look.grey, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
            large = _Look(np.asarray(twice, np.uint8), 2.0, look.noise)
            found = squares(large.grey, 2 * SMALLEST_PX, window=WINDOW + 2)
            yield look, large.back(found)

    def worth_more(self) -> bool:
        """Whether a target is missing, or something looks like a marker and could not be read."""
        if self.wanted is not None:
            return not self.wanted <= {one.marker for one in self.believed}
        doubtful = (one for one in self.candidates if one.belief > HOPEFUL)
        return any(not any(_near(one, other) for other in self.believed) for one in doubtful)

    def add(self, seen: Iterator[tuple[_Look, Array]]) -> None:
        """Reads the squares."""
        for look, rough in seen:
            self.candidates += self._read(look, rough)
        self.believed = []
        for one in sorted(self.candidates, key=lambda one: -one.belief):
            if one.belief < belief.ENOUGH:
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
        fits = reading.fits(cells.inner[maybe], self.book.seen[1]).max(axis=1)
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


def _near(one: _Candidate, other: _Candidate) -> bool:
    """Whether the middle of either square lies within half the other's side of its middle."""
    apart = np.linalg.norm(one.corners.mean(axis=0) - other.corners.mean(axis=0))
    sides = [np.linalg.norm(np.roll(each.corners, 1, axis=0) - each.corners, axis=1).max() for each in (one, other)]
    return bool(apart < max(sides) / 2)
