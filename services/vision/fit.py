"""Corners from the whole marker: the code, as the camera should see it, is laid over the picture until both agree.

A line along a side is as exact as that side's edge, which an encoder that packs blocks of 16 pixels moves by several
hundredths of a pixel as a whole. The edges of the cells within are as sharp, are more than those of the outline, and
lie in other blocks. Least squares over all pixels (Lucas and Kanade 1981, Gauss and Newton's method) weighs them as
they deserve: unknown are the homography, the light, the contrast and how blurred it is. Where the code explains the
picture badly (a shadow's edge, a finger), there is no answer, and the sides alone have to do (`corners`). Pure.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.lens import Lens

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]

GRAINS = (4, 48)  # samples to a cell of the code that is laid over: about as many as the picture is reckoned at
SMOOTH = 0.6  # of a sample, standard deviation: between steps as sharp as samples, edges would lie on a grid
RIM = 0.5  # of a cell around the square that is compared too; beyond, prints end
SIDE_PX = (8.0, 240.0)  # of a square: below there is nothing to be gained, above it takes long, and sides are exact
SAMPLES_PX, MOST_SAMPLES = 320, 3  # a patch is reckoned at up to so many samples a side, and to a pixel
BLUR_PX, BLURS_PX = 0.6, (0.25, 4.0)  # standard deviation to begin with, and what it may be
STEPS, CONVERGED_PX = 12, 1e-3
FEWEST = 20  # pixels that are compared
HUBER = 2.5  # standard deviations of a pixel from where it weighs less
LEAST = 0.03  # of the contrast: in a picture without noise edges would be doubted, which are all that tells
FARTHEST_PX, FARTHEST_SIDES = 0.8, 0.02  # a corner that walks farther from that of the sides is none, one of them is
LOST_SIDES = 0.25  # of the shortest side: what has walked so far on the way does not come back
EXPLAINED = 0.95  # share of what is seen that the code must explain, after both were smoothed
SCHARR = 32.0  # what OpenCV's slope is multiplied with
LINES = 8  # of edges across a marker, as far as it matters for how a lens bends it: those of a code of five by five

UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def fit(grey: Picture, square: Array, cells: Floats) -> Array | None:
    """The corners (4, 2) of a marker, clockwise from its own top-left, from nearly right ones; None: it is not so.

    `cells` (modules + 2, modules + 2) are 0 for dark, 1 for light, with the border and one cell of paper around.
    """
    modules = len(cells) - 2
    sides = np.linalg.norm(np.roll(square, -1, axis=0) - square, axis=1)
    side = float(sides.max())
    if not (SIDE_PX[0] <= side <= SIDE_PX[1] and sides.min() > SIDE_PX[0] / 4):
        return None
    begin = np.maximum(np.floor(square.min(axis=0) - side / modules).astype(int), 0)
    end = np.maximum(np.ceil(square.max(axis=0) + side / modules).astype(int) + 1, 0)
    patch = grey[begin[1] : end[1], begin[0] : end[0]].astype(np.float32)
    if patch.size < FEWEST:
        return None
    try:
        found = _laid_over(_Patch(patch, cells, _root_of_area(square) / modules), square - begin)
    except np.linalg.LinAlgError:  # corners in a line
        found = None
    if found is None or np.abs(found + begin - square).max() >= max(FARTHEST_PX, FARTHEST_SIDES * side):
        return None
    return np.asarray(found + begin, float)


def unbent(square: Array, lens: Lens) -> Array:
    """The corners (4, 2) of a square that `lens` bends, from those that `fit` gave: all of it lies a little beside.

    Pixels, in the lens's picture; so far beside as the homography that is nearest to all edges there may be.
    """
    points, slopes, weights = _edges(LINES)
    flat, straight = _homography(lens.rays(square), 1), _homography(square, 1)
    bent = lens.project(np.column_stack((_through(flat, points), np.ones(len(points)))))
    seen = _through(straight, points)
    ahead = _through(straight, points + 1e-4 * slopes) - seen
    normal = np.column_stack((-ahead[:, 1], ahead[:, 0])) / np.linalg.norm(ahead, axis=1, keepdims=True)
    depth = points @ straight[2, :2] + straight[2, 2]
    rows = weights[:, None] * _by_numbers(points, seen, normal / depth[:, None])
    step = np.linalg.lstsq(rows, weights * (normal * (bent - seen)).sum(axis=1), rcond=None)[0]
    return np.asarray(2 * square - _through(straight + np.append(step, 0.0).reshape(3, 3), UNIT), float)


def _edges(lines: int) -> tuple[Array, Array, Array]:
    """Points (n, 2) on the edges of the unit square and of the cells in it, which way those run, and their weights.

    Of the edges within, every other one is there.
    """
    at, along = np.meshgrid(np.linspace(0, 1, lines), (np.arange(4 * lines) + 0.5) / (4 * lines))
    down = np.column_stack((at.ravel(), along.ravel()))
    weights = np.where(np.isin(down[:, 0], (0.0, 1.0)), 1.0, 0.5**0.5)
    slopes = np.tile((0.0, 1.0), (len(down), 1))
    return np.vstack((down, down[:, ::-1])), np.vstack((slopes, slopes[:, ::-1])), np.tile(weights, 2)


@dataclass(frozen=True, eq=False)
class _Rendered:
    """What the camera should see: `grey` (h * w,) from 0 to 1, its slopes, and how it changes with the blur."""

    grey: Array
    across: Array
    down: Array
    bend: Array


class _Patch:
    """The picture around a marker, and the code that is laid over it."""

    def __init__(self, seen: Floats, cells: Floats, cell_px: float) -> None:
        self.seen, self.modules = seen, len(cells) - 2
        self.height, self.width = seen.shape
        self._samples = int(np.clip(SAMPLES_PX // max(seen.shape), 1, MOST_SAMPLES))
        grain = int(np.clip(np.ceil(cell_px * self._samples), *GRAINS))
        sharp = np.kron(cells, np.ones((grain, grain), np.float32))
        self._fine = cv2.GaussianBlur(sharp, (0, 0), SMOOTH, borderType=cv2.BORDER_REPLICATE)
        self._to_cells = np.array([[1 / grain, 0, 0.5 / grain - 1], [0, 1 / grain, 0.5 / grain - 1], [0, 0, 1]])
        across, down = np.meshgrid(np.arange(self.width, dtype=float), np.arange(self.height, dtype=float))
        self.pixels = np.column_stack((across.ravel(), down.ravel()))

    def rendered(self, homography: Array, blur: float) -> _Rendered:
        """The code as it would be seen through a homography from cells to pixels."""
        often = self._samples
        finer = np.array([[often, 0, (often - 1) / 2], [0, often, (often - 1) / 2], [0, 0, 1]])
        size, whole = (self.width * often, self.height * often), finer @ homography @ self._to_cells
        sharp = cv2.warpPerspective(self._fine, whole, size, borderMode=cv2.BORDER_REPLICATE)
        fine = cv2.GaussianBlur(sharp, (0, 0), blur * often)
        grey, across, down, bend = (
            cv2.resize(one, (self.width, self.height), interpolation=cv2.INTER_AREA).ravel().astype(float)
            for one in (fine, cv2.Scharr(fine, -1, 1, 0), cv2.Scharr(fine, -1, 0, 1), cv2.Laplacian(fine, -1))
        )
        return _Rendered(grey, across * often / SCHARR, down * often / SCHARR, bend * often**2)

    def compared(self, homography: Array) -> tuple[NDArray[np.bool_], Array]:
        """Which pixels show the marker, (h * w,), and where those are on it, in cells."""
        there = _through(np.asarray(np.linalg.inv(homography), float), self.pixels)
        within = np.asarray(((there > -RIM) & (there < self.modules + RIM)).all(axis=1), np.bool_)
        return within, there[within]

    def explained(self, within: NDArray[np.bool_], residuals: Array) -> float:
        """The share of what is seen that is not left over, without what neighbouring pixels do not share."""
        left = np.zeros(self.seen.size, np.float32)
        left[within] = residuals
        smooth = [cv2.blur(part, (3, 3)).ravel()[within] for part in (left.reshape(self.seen.shape), self.seen)]
        return 1.0 - float(smooth[0].var()) / max(float(smooth[1].var()), 1e-9)


def _laid_over(patch: _Patch, square: Array) -> Array | None:
    """The corners, in the patch's pixels, at which both agree best; None where they do not.

    Raises LinAlgError where no code can be laid over.
    """
    sides = np.linalg.norm(np.roll(square, -1, axis=0) - square, axis=1)
    blur, most = BLUR_PX, min(BLURS_PX[1], max(BLUR_PX, float(sides.max()) / patch.modules / 2))
    homography, corners, far = _homography(square, patch.modules), square, float(sides.min()) * LOST_SIDES
    for _ in range(STEPS):
        rendered = patch.rendered(homography, blur)
        within, cells = patch.compared(homography)
        if len(cells) < FEWEST:
            return None
        grey = rendered.grey[within]
        light = np.column_stack((np.ones(len(grey)), grey))
        seen = np.asarray(patch.seen.ravel()[within], float)
        level = np.linalg.lstsq(light, seen, rcond=None)[0]
        residuals = seen - light @ level
        slope = np.column_stack((_slope(homography, cells, rendered, within), blur * rendered.bend[within]))
        slope = np.column_stack((level[1] * slope, light))
        weighed = slope * _weights(residuals, LEAST * abs(float(level[1])))[:, None]
        step = np.linalg.lstsq(weighed.T @ slope, weighed.T @ residuals, rcond=None)[0]
        homography = homography + np.append(step[:8], 0.0).reshape(3, 3)
        blur = float(np.clip(blur + step[8], BLURS_PX[0], most))
        before, corners = corners, _through(homography, UNIT * patch.modules)
        if not float(np.abs(corners - square).max()) < far:
            return None
        if float(np.abs(corners - before).max()) < CONVERGED_PX:
            break
    sound = level[1] > 0 and patch.explained(within, residuals) > EXPLAINED
    return corners if sound else None


def _weights(residuals: Array, least: float) -> Array:
    spread = max(least, 1.4826 * float(np.median(np.abs(residuals))))
    return np.minimum(1.0, HUBER * spread / np.maximum(np.abs(residuals), 1e-9))


def _slope(homography: Array, cells: Array, rendered: _Rendered, within: NDArray[np.bool_]) -> Array:
    """How the rendered grey changes with the homography's numbers but the last, (n, 8)."""
    seen = cells @ homography[:, :2].T + homography[:, 2]
    slopes = -np.column_stack((rendered.across[within], rendered.down[within]))
    return _by_numbers(cells, seen[:, :2] / seen[:, 2:], slopes / seen[:, 2:])


def _by_numbers(points: Array, seen: Array, slopes: Array) -> Array:
    """How what has these slopes (n, 2), divided by the depth, at `seen` changes with the homography of points."""
    across, down, nearer = slopes[:, :1], slopes[:, 1:], -(slopes * seen).sum(axis=1, keepdims=True)
    return np.hstack((across * points, across, down * points, down, nearer * points))


def _root_of_area(square: Array) -> float:
    return sqrt(cv2.contourArea(square.astype(np.float32)))


def _homography(square: Array, modules: int) -> Array:
    """From the cells of a square to its pixels; the last number is 1."""
    to_pixels = cv2.getPerspectiveTransform((UNIT * modules).astype(np.float32), square.astype(np.float32))
    return np.asarray(to_pixels, float)


def _through(homography: Array, points: Array) -> Array:
    """Where a homography puts points (n, 2)."""
    moved = points @ homography[:, :2].T + homography[:, 2]
    with np.errstate(all="ignore"):  # what lies at infinity is found out by whoever asks
        return np.asarray(moved[:, :2] / moved[:, 2:], float)
