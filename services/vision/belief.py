"""Whether a square is a marker: how unlikely chance is, against what ordinary pictures hold. Pure numbers.

The measure is the logarithm of the odds against a square of no marker fitting one of the codes that well. A fit among
a thousand codes of sixteen cells proves little, one among fifty of thirty-six a lot; simple figures (a white box in a
dark frame is 1023 of the original dictionary) and squares of a few pixels need more of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.vision.codes import Book
from services.vision.reading import Evidence, Match

Array = NDArray[np.float64]

ENOUGH = 16.0  # belief (natural logarithm of odds) of any marker
ENOUGH_OF_TARGETS = 14.0  # of one that was asked for: what looks like any marker is rarely that one
FIRST_CORRELATION = 0.3  # of a rough square with a code in question: its corners are half a pixel off
FIRST_CONTRAST = 5.0  # grey levels
FIRST_DARK, FIRST_EDGED = 0.5, 0.4  # shares, as below
LEAST_CONTRAST = 6.0  # grey levels between light and dark cells; below is noise
CONTRAST_NOISES = 1.0  # and in standard deviations of the noise
DARK_BORDER = 0.75  # share of the border's cells that must be dark: a finger may lie over one side
EDGED = 0.7  # share of the outline with lighter paper beside it
EDGED_SIDE = 0.2  # of the worst side
STEPPED = 0.5  # share of the borders within the code at which there is a step; half hidden markers have 0.64
DEEP = 0.45  # as deep as the border are the dark cells, by this much: in a dark frame, a photograph's shades are not
STEPPED_AND_DEEP = 1.35  # both together: of 11,000 markers that are found none had less than 1.47
MARGIN = 0.09  # of the correlation above the next id's
SURE_CORRELATION = 0.97  # above which neighbours in the dictionary may be nearer
LIKENESS = 0.62  # share of what is seen within the border that the code explains; one in a hundred markers is below 0.7
SIMPLER = 3.0  # edges fewer than the dictionary's average that need no more proof
STRIPES = 12.0  # belief that they take: blinds, shelves and flags are striped
PER_EDGE = 3.0  # belief that each further one takes
SMALL_CELL_PX = 2.2  # side of a cell below which proof is taken off
PER_PX = 20.0
NARROW = 1.15  # the narrow side of a square counts so much, where that is less than the root of its area
SIMPLE = 12.0  # a code with so much taken off is one that pictures imitate:
SIMPLE_CELL_PX = 3.0  # it must be this large,
SIMPLE_LIKENESS = 0.76  # and what is seen so much like it;
STRIPED_LIKENESS = 0.9  # or so much, where it is stripes: those of a picture in a frame are as long as the frame,
STRIPED_UNEVEN = 0.25  # and the frame is narrower than a cell, so that its cells differ more than so


def plausible(look: Evidence) -> NDArray[np.bool_]:
    """Which rough squares may be markers, whatever is in them."""
    return np.asarray((look.contrast > FIRST_CONTRAST) & (look.dark > FIRST_DARK) & (look.edged > FIRST_EDGED))


def beliefs(book: Book, match: Match, proof: Evidence, squares: Array, noise: float, ids: int) -> Array:
    """For each square (n, 4, 2), how far it is from chance; 0 for what is none. `ids`: how many codes would do."""
    cells = book.inner**2
    left = np.maximum(1 - match.correlation**2, 1e-6)
    chance = np.log(4 * ids) + (cells - 2) / 2 * np.log(left)
    simple = _simple(book, match.row)
    cell_px = _side(squares) / book.modules
    belief = -chance - simple - PER_PX * np.maximum(SMALL_CELL_PX - cell_px, 0)
    sound = (proof.dark >= DARK_BORDER) & (proof.edged >= EDGED) & (proof.worst >= EDGED_SIDE)
    sound &= (proof.stepped >= STEPPED) & (proof.deep >= DEEP) & (proof.stepped + proof.deep >= STEPPED_AND_DEEP)
    sound &= proof.contrast >= np.maximum(LEAST_CONTRAST, CONTRAST_NOISES * noise)
    sound &= (match.correlation - match.second >= MARGIN) | (match.correlation >= SURE_CORRELATION)
    sound &= ~book.stripes[match.row] | (proof.uneven <= STRIPED_UNEVEN)
    sound &= (simple < SIMPLE) | (cell_px >= SIMPLE_CELL_PX)
    return np.where(sound, np.maximum(belief, 0), 0.0)


def least_likeness(book: Book, marker: int) -> float:
    """How much like a marker what is seen must be, pixel by pixel (`reading.likeness`)."""
    if book.stripes[marker]:
        return STRIPED_LIKENESS
    return SIMPLE_LIKENESS if _simple(book, np.array([marker]))[0] >= SIMPLE else LIKENESS


def _simple(book: Book, rows: NDArray[np.intp]) -> Array:
    """What is taken off for simple figures."""
    edges = np.maximum(book.edges.mean() - SIMPLER - book.edges[rows], 0)
    return np.asarray(PER_EDGE * edges + STRIPES * book.stripes[rows], float)


def _side(squares: Array) -> Array:
    """The root of each one's area; less where it is seen so much from aside that its cells run together one way."""
    x, y = squares[..., 0], squares[..., 1]
    area = np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)) / 2
    sides = np.linalg.norm(np.roll(squares, -1, axis=1) - squares, axis=2)
    longest = np.maximum(sides[:, 0] + sides[:, 2], sides[:, 1] + sides[:, 3]) / 2
    return np.asarray(np.minimum(np.sqrt(area), NARROW * area / np.maximum(longest, 1e-6)))
