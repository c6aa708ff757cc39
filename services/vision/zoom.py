"""How much a zoomed picture is magnified: measured from two pictures, or known from a calibrated table of levels.

A camera's zoom level is only a range, and this kind of zoom is a crop enlarged: every pixel of the zoomed picture is
one of the widest by a similarity, whatever is seen and however the lens bends it. With an optical zoom it is nearly
one. Turning the camera in between would shift the pictures, so both are taken from one place. How a lens is changed
by it is in `lens`; where markers are then, in `pose`.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import atan2, ceil, degrees, hypot, log, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.lens import Lens

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

SAME_LEVEL = 0.05  # readings of zoom that differ by less are one
MOST = 8.0  # magnification looked for
COARSE_PX = 384  # width of the small pictures in which the whole range is tried
STEP = 1.025  # between two magnifications tried: the edges are off by 5 of the small pixels at most
ROOM_PX = 16  # of the small pictures: how far the middle may have moved
EVEN_PX = 10.0  # sigma of what counts as brightness, not as detail, in the small pictures and in the large ones
FLAT = 1.5  # grey levels; what varies less is noise. A bare wall's clouds must weigh beside a title over the picture
LIKE = 0.3  # correlation of the small pictures below which they do not show the same
# The width at which points are followed: larger adds time, hardly detail. And how far, in each round, a point may be
# from the others' similarity, in pixels of the wide picture: one that is farther is none of them.
WORK_PX, FAR_PX = 1152, (6.0, 1.5)
SOFT_WORK_PX, SOFT_FAR_PX = 384, (12.0, 3.0)  # the same where outlines are few: a bare wall's clouds outlast the noise
SURE = 0.0003  # share; a magnification less sure than this by its outlines is measured softly
POINTS, APART_PX, WINDOW_PX = 600, 10, 21  # followed points: how many, how far apart, and what is compared around each
FEWEST = 20  # points that must agree
LEAST_SPREAD = 0.04  # of the zoomed picture's width that they must spread over (root mean square)
ROTATED_DEG = 0.2  # a zoom does not turn the picture; more is a mistake
ASIDE = 0.1  # of the picture's width: how far the middle may move
TUKEY, REWEIGHTINGS = 4.685, 15
RAYLEIGH_MEDIAN = 1.1774  # of a distance in the plane, in standard deviations of a coordinate
FLOOR_PX = 0.02  # scatter of the points below which none counts as an outlier
TOGETHER = 4.0  # points are not independent, neighbours err together: as if there were so many times fewer
MIDDLE_PX = 0.02  # how well the middle is known at best
SYSTEMATIC = 0.0002  # share of the magnification: interpolation, JPEG, the camera's own resize


@dataclass(frozen=True)
class Magnification:
    """`times` larger than at the widest zoom, with its standard deviation `sigma`.

    `right`, `down`: where the middle of the widest picture is in the zoomed one, off its middle as shares of the width;
    `aside` is the standard deviation of either.
    """

    times: float
    sigma: float
    right: float = 0.0
    down: float = 0.0
    aside: float = 0.0

    @property
    def relative(self) -> float:
        """The standard deviation as a share: as much as distances are uncertain by it."""
        return self.sigma / self.times

    def through(self, lens: Lens) -> Lens:
        """The lens of the zoomed picture, from that of the widest one of the same size."""
        middle = np.array([(lens.width - 1) / 2, (lens.height - 1) / 2])
        shift = middle * (1 - self.times) + lens.width * np.array([self.right, self.down])
        enlarge = np.array([[self.times, 0, shift[0]], [0, self.times, shift[1]], [0, 0, 1]])
        return replace(lens, matrix=enlarge @ lens.matrix)


WIDEST = Magnification(1.0, 0.0)


@dataclass(frozen=True)
class Level:
    """A level of zoom as the camera reads it, and what a visit to it is magnified by: its `sigma` is between visits."""

    zoom: float
    seen: Magnification


def at_level(levels: Sequence[Level], zoom: float) -> Magnification | None:
    """What is known of a reading without a picture: between two levels of the table in proportion, None outside it.

    The uncertainty is that of the worse neighbour, and more between two.
    """
    known = sorted(levels, key=lambda level: level.zoom)
    below = [level for level in known if level.zoom <= zoom + SAME_LEVEL]
    above = [level for level in known if level.zoom >= zoom - SAME_LEVEL]
    if not below or not above:
        return None
    low, high = below[-1], above[0]
    if low.zoom >= high.zoom:
        return low.seen
    share = (zoom - low.zoom) / (high.zoom - low.zoom)
    times, right, down = (
        (1 - share) * getattr(low.seen, name) + share * getattr(high.seen, name) for name in ("times", "right", "down")
    )
    between = share * (1 - share) * (high.seen.times - low.seen.times)  # no camera's zoom need be even
    return Magnification(times, hypot(max(low.seen.sigma, high.seen.sigma), between), right, down)


def measure(wide: Picture, zoomed: Picture, between: tuple[float, float] = (1.0, MOST)) -> Magnification:
    """The magnification of the second picture over the first, which shows the same from the same place.

    8-bit pictures of one aspect, grey or BGR. ValueError says why it cannot be told.
    """
    first, second = _grey(wide), _grey(zoomed)
    if abs(first.shape[1] * second.shape[0] / (first.shape[0] * second.shape[1]) - 1) > 0.01:
        raise ValueError("the zoomed picture has another shape than the wide one")
    height, width = first.shape
    second = second if second.shape == first.shape else _resized(second, width, height)
    roughly = _coarse(first, second, between)
    with suppress(ValueError):
        by_outlines = _agreed(first, second, roughly, WORK_PX, FAR_PX)
        if by_outlines.relative <= SURE:
            return by_outlines
    return _agreed(first, second, roughly, SOFT_WORK_PX, SOFT_FAR_PX)


def _agreed(wide: Picture, zoomed: Picture, roughly: Array, work_px: int, far_px: Sequence[float]) -> Magnification:
    """What points of both agree on, followed in pictures of this width; ValueError when they do not."""
    height, width = wide.shape
    sure = roughly
    for far in far_px:
        here, there = _followed(wide, zoomed, sure, work_px)
        sure, scatter, weights = _similarity(here, there, far * max(1.0, _times(sure)))
        spread = _spread(there, weights)
        if len(here) < FEWEST or spread < LEAST_SPREAD * width or weights.sum() < FEWEST:
            raise ValueError("the zoomed picture and the wide one have too little in common")
    moved = scatter * sqrt(TOGETHER / weights.sum())
    times, share = _times(sure), moved / spread
    middle, (start, end) = np.array([(width - 1) / 2, (height - 1) / 2]), (weights @ (here, there) / weights.sum())
    right, down = (times * (middle - start) + end - middle) / width  # as without a turn, which is noise of the points
    turned = abs(degrees(atan2(sure[1, 0], sure[0, 0])))
    if turned > ROTATED_DEG + degrees(3 * share) or hypot(right, down) > ASIDE * times:
        raise ValueError(f"no zoom turns the picture by {turned:.1f} degrees and moves it by {hypot(right, down):.0%}")
    lever = float(np.linalg.norm(end - middle))
    aside = hypot(moved, lever * share, MIDDLE_PX) / width
    return Magnification(times, times * hypot(share, SYSTEMATIC), float(right), float(down), aside)


def _times(similar: Array) -> float:
    return float(hypot(similar[0, 0], similar[1, 0]))


def _grey(image: Picture) -> Picture:
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def _resized(image: Picture, width: int, height: int) -> Picture:
    how = cv2.INTER_AREA if width < image.shape[1] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=how), np.uint8)


def _evened(image: Picture) -> Picture:
    """Detail alone, in equal strength everywhere: exposure, contrast and colour may change between two pictures."""
    grey = image.astype(np.float32)
    detail = grey - cv2.GaussianBlur(grey, (0, 0), EVEN_PX)
    strength = cv2.sqrt(cv2.GaussianBlur(detail * detail, (0, 0), EVEN_PX)) + FLAT
    return np.asarray(np.clip(128 + 42 * detail / strength, 0, 255), np.uint8)


def _coarse(wide: Picture, zoomed: Picture, between: tuple[float, float]) -> Array:
    """The similarity (2, 3) from pixels of the wide picture to the zoomed one's, roughly.

    The zoomed picture, shrunk by every magnification of the range, is looked for everywhere in the wide one.
    """
    height, width = wide.shape
    low = round(COARSE_PX * height / width)
    around = ((ROOM_PX, ROOM_PX), (ROOM_PX, ROOM_PX))
    small = np.pad(_evened(_resized(wide, COARSE_PX, low)), around, constant_values=128)
    medium = _resized(zoomed, 2 * COARSE_PX, 2 * low)  # shrinking the large one again and again is what takes time
    likest = (LIKE, 0.0, 0, 0)
    for times in between[0] * STEP ** np.arange(ceil(log(between[1] / between[0]) / log(STEP)) + 1):
        part = _evened(_resized(medium, round(COARSE_PX / times), round(low / times)))
        _, like, _, (x, y) = cv2.minMaxLoc(cv2.matchTemplate(small, part, cv2.TM_CCOEFF_NORMED))
        likest = max(likest, (like, COARSE_PX / part.shape[1], x - ROOM_PX, y - ROOM_PX))
    _, times, x, y = likest
    if times == 0.0:
        raise ValueError("the zoomed picture and the wide one do not show the same, or nothing with an outline")
    left, top = (times * edge * width / COARSE_PX for edge in (x, y))
    return np.array([[times, 0, 0.5 * times - left - 0.5], [0, times, 0.5 * times - top - 0.5]])


def _followed(wide: Picture, zoomed: Picture, similar: Array, work_px: int) -> tuple[Array, Array]:
    """Points (n, 2) of the wide picture and where they are in the zoomed one (Lucas and Kanade's method).

    The zoomed one is brought to the wide one's scale first, so that the ways are short.
    """
    first, second, to_wide = _together(wide, zoomed, similar, work_px)
    found = cv2.goodFeaturesToTrack(first, POINTS, 0.02, APART_PX, blockSize=7)
    if found is None or len(found) < FEWEST:
        return np.zeros((0, 2)), np.zeros((0, 2))
    window = (WINDOW_PX, WINDOW_PX)
    start = np.asarray(found, np.float32)
    moved, good, _ = cv2.calcOpticalFlowPyrLK(first, second, start, np.array(start), winSize=window, maxLevel=3)
    back, well, _ = cv2.calcOpticalFlowPyrLK(second, first, moved, np.array(moved), winSize=window, maxLevel=3)
    returned = np.linalg.norm(back - start, axis=2)[:, 0] < 0.5
    kept = (good[:, 0] > 0) & (well[:, 0] > 0) & returned
    here, there = (points[kept, 0].astype(float) @ to_wide[:, :2].T + to_wide[:, 2] for points in (start, moved))
    return here, there @ similar[:, :2].T + similar[:, 2]


def _together(wide: Picture, zoomed: Picture, similar: Array, work_px: int) -> tuple[Picture, Picture, Array]:
    """The part of the wide picture that the zoomed one shows, both at one scale; and from there to the wide (2, 3)."""
    height, width = wide.shape
    times = _times(similar)
    corners = np.array([[-0.5, -0.5], [width - 0.5, height - 0.5]])
    (left, top), (right, bottom) = (corners - similar[:, 2]) @ np.linalg.inv(similar[:, :2]).T
    low = np.clip(np.floor((left, top)), 0, None).astype(int)
    high = np.clip(np.ceil((right, bottom)), None, (width, height)).astype(int)
    part = wide[low[1] : high[1], low[0] : high[0]]
    shrink = min(1.0, work_px / max(part.shape[1], 1))
    if min(part.shape) < WINDOW_PX:
        raise ValueError("the zoomed picture and the wide one have too little in common")
    size = (round(part.shape[1] * shrink), round(part.shape[0] * shrink))
    scale = np.array(part.shape[::-1]) / size
    to_wide = np.column_stack((np.diag(scale), 0.5 * scale - 0.5 + low))
    to_zoomed = np.column_stack((similar[:, :2] @ to_wide[:, :2], similar[:, :2] @ to_wide[:, 2] + similar[:, 2]))
    blur = 0.4 * sqrt(max((times * scale[0]) ** 2 - 1, 0.0))
    soft = cv2.GaussianBlur(zoomed, (0, 0), blur) if blur > 0.3 else zoomed
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    brought = cv2.warpAffine(soft, to_zoomed, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return _evened(_resized(part, *size)), _evened(np.asarray(brought, np.uint8)), to_wide


def _similarity(start: Array, end: Array, far_px: float) -> tuple[Array, float, Array]:
    """The similarity (2, 3) between points (n, 2), robustly; the scatter of a coordinate, and every point's weight."""
    similar, scatter = np.eye(2, 3), FLOOR_PX
    weights = np.ones(len(start))
    if np.isfinite(far_px) and len(start) >= FEWEST:
        _, inside = cv2.estimateAffinePartial2D(start, end, ransacReprojThreshold=far_px)
        weights = inside[:, 0].astype(float)
    for _ in range(REWEIGHTINGS):
        if weights.sum() <= 2:
            break
        similar = _fitted(start, end, weights)
        off = np.linalg.norm(start @ similar[:, :2].T + similar[:, 2] - end, axis=1)
        scatter = max(float(np.median(off[weights > 0])) / RAYLEIGH_MEDIAN, FLOOR_PX)
        weights = np.clip(1 - (off / min(TUKEY * scatter, far_px)) ** 2, 0, None) ** 2
    return similar, scatter, weights


def _fitted(start: Array, end: Array, weights: Array) -> Array:
    """The similarity with the least weighted squares, in closed form (Umeyama 1991)."""
    total = weights.sum()
    first, second = weights @ start / total, weights @ end / total
    a, b = start - first, end - second
    size = weights @ (a * a).sum(axis=1)
    cosine = weights @ (a * b).sum(axis=1) / size
    sine = weights @ (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / size
    turn = np.array([[cosine, -sine], [sine, cosine]])
    return np.column_stack((turn, second - turn @ first))


def _spread(points: Array, weights: Array) -> float:
    """Root mean square distance of points (n, 2) from their middle."""
    total = max(float(weights.sum()), 1e-9)
    off = points - weights @ points / total if len(points) else points
    return sqrt(float(weights @ (off * off).sum(axis=1)) / total) if len(points) else 0.0
