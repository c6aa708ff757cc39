"""Markers in a picture: which, and where their corners are. Where they are in the apartment is in `pose`.

Dark squares are looked for (`squares`), in the picture and in smaller ones made of it, their corners made exact
(`corners`) and their cells matched with every code of the whole dictionary (`reading`, `codes`). The best code wins,
and only if it is wanted: a neighbour in the dictionary is never taken for the target. What lies half in a shadow is
read once more as if in one light (`shadow`). Who is believed is `belief`'s; the code of who is makes the corners more
exact (`fit`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision import belief, codes, reading
from services.vision.codes import DICTIONARIES, Book
from services.vision.corners import refine, refine_many
from services.vision.fit import fit
from services.vision.looks import Look, around, halved, longest, near
from services.vision.shadow import CHANGE, lit
from services.vision.squares import WINDOW, darker_by, squares, squares_at_levels

__all__ = ["DICTIONARIES", "Detection", "detect"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

SMALLEST_PX = 10.0  # side of the squares looked for; below 12 or so nothing can be decoded
SMALLEST_HALVED_PX = 16.0  # the same in a picture that was shrunk: smaller ones are in the one before
HALVED_WINDOWS = (WINDOW, 15)  # px, in a picture that was shrunk: the border of a blurred marker, or one amid texture
OTHER_WINDOWS = (3, 23)  # px: a shadow's edge needs a narrow one
PART_WINDOWS = (9, 23)  # px, in an enlarged part
ENLARGED_PX = 80.0  # a doubtful square's side is enlarged to about this, if it is smaller
FAINT = 2.0  # grey levels: the threshold's step in an enlarged part
HOPEFUL = 4.0  # belief of a square that is worth another look
MOST_DOUBTFUL = 8  # of them
LEVELS, LEVELS_PX = 5, 700  # grey levels that are thresholds too, in a picture of at most so many pixels a side
RIMMED, RIM = 0.85, (3.0, 2.0)  # share of a square's outline with paper beside it, lighter by grey levels, noises
LIKELY = 0.75  # likeness to a code, in whatever light, of a square that is worth to be seen in one light
MOST_LIKELY = 5  # of them
SURE = 30.0  # belief of a marker that needs no other light
EDGE_PX = 1.5  # a corner that is nearer to the picture's edge is as good as beyond it
SEARCHERS = 2  # threads: the picture itself has about as many outlines as all smaller ones


@dataclass(frozen=True, eq=False)
class Detection:
    """A marker in a picture: `corners` (4, 2) in pixels, clockwise from the marker's own top-left.

    Pixel centres are whole numbers. `confidence` is the correlation of the cells with the code, 0..1. The corners
    are those of the whole code as it lies in the picture (`fit`), and `sides` (4, 2) are where lines along its sides
    cross (`corners`); where the code does not tell, the corners are those, and `sides` is None.
    """

    marker: int
    corners: Array
    confidence: float
    sides: Array | None = None

    def whole(self, width: int, height: int) -> bool:
        """Whether all of it is in the picture: a corner beyond was told by what is seen of its sides, or not at all."""
        farthest = np.array([width, height]) - 1 - EDGE_PX
        return bool(((self.corners >= EDGE_PX) & (self.corners <= farthest)).all())


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
    if wanted is None or not search.found():
        search.add(search.levels())
        search.add(search.in_one_light())
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


def _rough(look: Look) -> Array:
    if look.scale == 1:
        return squares(look.grey, SMALLEST_PX, darker_by(look.noise))
    return squares(look.grey, SMALLEST_HALVED_PX, darker_by(look.noise), HALVED_WINDOWS)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A square with what could be read in it; corners in the given picture's pixels, from the code's top-left."""

    look: Look
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
        self.steps = self.book.rows(self.book.steps, wanted)
        self.looks = list(halved(grey))
        self.candidates: list[_Candidate] = []
        self.believed: list[_Candidate] = []
        self.shaded: list[tuple[float, Look, Array]] = []

    def first(self) -> Iterator[tuple[Look, Array]]:
        """The picture and smaller ones: each with its rough squares, which are looked for while others are read."""
        with ThreadPoolExecutor(SEARCHERS) as pool:
            yield from zip(self.looks, pool.map(_rough, self.looks), strict=True)

    def closer(self) -> Iterator[tuple[Look, Array]]:
        """Slower looks where something may be: enlarged, with other windows; everywhere if there is nothing at all."""
        whole = self.looks[0]
        for one in self._doubtful()[:MOST_DOUBTFUL]:
            part, corner = around(whole.grey, one.corners)
            larger = float(np.clip(ENLARGED_PX / longest(one.corners), 1.0, 3.0))
            grey = cv2.resize(part, None, fx=larger, fy=larger, interpolation=cv2.INTER_CUBIC)
            look = Look(np.asarray(grey, np.uint8), larger, whole.noise)
            yield whole, look.back(squares(look.grey, larger * SMALLEST_PX, FAINT, PART_WINDOWS)) + corner
        if self.wanted is None and not self.believed:
            yield whole, squares(whole.grey, SMALLEST_PX, darker_by(whole.noise), OTHER_WINDOWS)

    def levels(self) -> Iterator[tuple[Look, Array]]:
        """The squares that a shadow's edge tears: at levels of grey between the light in the shadow and the dark."""
        look = next((look for look in self.looks if max(look.grey.shape) <= LEVELS_PX), self.looks[-1])
        yield look, squares_at_levels(look.grey, SMALLEST_HALVED_PX, LEVELS)

    def in_one_light(self) -> Iterator[tuple[Look, Array]]:
        """The likeliest squares that lie in light of several kinds, as if in one."""
        shaded = sorted(self.shaded, key=lambda one: -one[0])
        there = np.array([look.back(rough) for _, look, rough in shaded]).reshape(-1, 4, 2)
        left = np.ones(len(shaded), bool)
        for one in self.believed:
            left &= (one.belief < SURE) | ~near(there, one.corners)
        for _ in range(MOST_LIKELY):
            if not left.any():
                return
            index = int(left.argmax())
            left &= ~near(there, there[index])
            _, look, rough = shaded[index]
            exact = refine_many(look.grey, rough[None], self.book.modules)
            for part, begin in () if np.isnan(exact).any() else lit(look.grey, exact[0], self.book.modules):
                yield Look(part, look.scale, look.noise, begin), exact - begin

    def _remember(self, look: Look, rough: Array, cells: reading.Cells) -> None:
        """Those that have paper all around and lie in light of several kinds, if they are like a wanted code."""
        step = cells.outside - cells.border
        rimmed = (step > max(RIM[0], RIM[1] * look.noise)).mean(axis=(1, 2)) > RIMMED
        change = np.maximum(np.ptp(cells.outside, axis=(1, 2)), np.ptp(cells.border, axis=(1, 2)))
        shaded = np.flatnonzero(rimmed & (change > CHANGE * step.mean(axis=(1, 2))))
        likely = reading.likely(cells.inner[shaded], self.book.inner, self.steps)
        self.shaded += [(much, look, rough[at]) for much, at in zip(likely, shaded, strict=True) if much > LIKELY]

    def worth_more(self) -> bool:
        """Whether something looks like a marker that could not be read, and is wanted."""
        return bool(self._doubtful())

    def _doubtful(self) -> list[_Candidate]:
        """The best of what may be markers that are wanted, each once."""
        doubtful: list[_Candidate] = []
        for one in sorted(self.candidates, key=lambda one: -one.belief):
            asked = self.wanted is None or one.marker in self.wanted
            if (
                asked
                and one.belief > HOPEFUL
                and not any(near(one.corners, other.corners) for other in (*self.believed, *doubtful))
            ):
                doubtful.append(one)
        return doubtful

    def add(self, seen: Iterator[tuple[Look, Array]]) -> None:
        """Reads the squares."""
        for look, rough in seen:
            self.candidates += self._read(look, rough)
        self.believed = []
        enough = belief.ENOUGH if self.wanted is None else belief.ENOUGH_OF_TARGETS
        for one in sorted(self.candidates, key=lambda one: -one.belief):
            if one.belief < enough:
                break
            if not any(near(one.corners, other.corners) for other in self.believed) and self._alike(one):
                self.believed.append(one)

    def _alike(self, one: _Candidate) -> bool:
        """Whether it looks like the code all over, not only in the middle of the cells."""
        faces = codes.faces(self.dictionary, one.marker)
        like = reading.likeness(one.look.grey, one.look.here(one.corners), faces, one.look.noise)
        return like >= belief.least_likeness(self.book, one.marker)

    def _read(self, look: Look, rough: Array) -> Iterator[_Candidate]:
        """Reads twice: roughly, to drop nearly all of them, and again with better corners."""
        modules = self.book.modules
        cells = reading.cells(look.grey, rough, modules)
        self._remember(look, rough, cells)
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
                detections.append(self._detection(one))
        return sorted(detections, key=lambda d: -d.confidence)

    def _detection(self, one: _Candidate) -> Detection:
        """By its code where that can be laid over the whole of it, else by its sides."""
        by_sides = Detection(one.marker, self._exact(one), min(one.correlation, 1.0))
        grey = self.looks[0].grey
        whole = by_sides.whole(*grey.shape[::-1])
        corners = fit(grey, by_sides.corners, codes.cells(self.dictionary, one.marker)) if whole else None
        return by_sides if corners is None else replace(by_sides, corners=corners, sides=by_sides.corners)

    def _exact(self, one: _Candidate) -> Array:
        """The corners that its sides have in the finest picture in which they can be told."""
        corners, modules = one.corners, self.book.modules
        for look in reversed([look for look in self.looks if look.scale > one.look.scale][1:]):
            here = refine_many(look.grey, look.here(corners)[None], modules)[0]
            corners = corners if np.isnan(here).any() else look.back(here)
        exact = refine(self.looks[0].grey, corners, modules)
        return corners if exact is None else exact
