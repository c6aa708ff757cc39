"""Corners to a few hundredths of a pixel: a line is fitted to each side of a dark square and neighbours are crossed.

The edge crosses each profile where its gradient has its centre of mass. A pixel averages the light that falls on it, so
that centre is exact wherever the edge lies between pixels, also where a digital zoom has enlarged them; the centre of
the squared gradient is up to 0.15 pixel aside. On small markers this is several times closer than `cornerSubPix`, whose
window reaches into the cells. Finding the squares is in `squares`.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.lens import Lens

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

ROUNDS = 3  # the profiles are centred on the last round's lines: what noise or a cut-off flank pulls is gone by then
TRIM = 0.12  # of a side left out at both ends, where the other side's edge is near
REACH_MODULES = 0.7  # how far profiles reach: not over the border into the cells or the quiet zone into the wall
REACH_PX = (1.5, 4.0)  # and the least and most of that in pixels; an edge is as wide as a pixel was enlarged
STEP_PX = 0.5  # along a profile
NOISE_GREY, NOISE_SHARE = 4.0, 0.2  # grey levels a pixel, and of a profile's steepest: what is below both is noise
WHOLE_PX = 1.5  # an edge that is nearer to the picture's own is cut off, and seems to lie elsewhere
WHOLE_STRENGTH = 0.3  # of a marker's strongest: at the picture's edge, what is weaker is none of its own
LEAST_SHOWN = 0.3  # of a side that leaves the picture: less tells the corner beyond to a few pixels only
PROFILES = (12, 64)  # least and most per side; about one for each pixel
TUKEY = 4.685  # cut-off of the robust line in standard deviations (95 % efficient, Huber 1981)
REWEIGHTINGS = 12  # of the robust line: a scratch over a tenth of a side is gone by then
OFFSET_FLOOR_PX = 0.03  # spread of edge points below which none counts as an outlier
FARTHEST_PX = 4.0  # a corner that walks farther than this from where it was found belongs to something else
FARTHEST_BEYOND_PX = 12.0  # the same of one beyond the picture, of which an outline shows nothing
QUICK = (2, 16, 4)  # rounds, profiles and reweightings where many squares are to be told apart


def sample(grey: Picture, x: NDArray[Any], y: NDArray[Any]) -> Picture:
    """Bilinear grey values of the picture at x, y (n, ...); beyond its edge the edge's value.

    OpenCV rounds where they are to a 32nd of a pixel and the values to whole ones: less than the picture's own noise.
    """
    if not x.size:
        return np.zeros(x.shape, np.uint8)
    each = len(x), -1
    across, down = x.reshape(each).astype(np.float32, copy=False), y.reshape(each).astype(np.float32, copy=False)
    values = cv2.remap(grey, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, np.uint8).reshape(x.shape)


def refine(grey: Picture, square: Array, modules: int) -> Array | None:
    """The corners (4, 2) of a dark square on light ground, from roughly right ones; None where no lines cross.

    `square` is clockwise in the picture; `modules` is the number of cells on its side, the border's included.
    """
    longest = np.linalg.norm(np.roll(square, -1, axis=0) - square, axis=1).max()
    profiles = int(np.clip(longest, *PROFILES))
    refined = _refined(grey, square[None], modules, ROUNDS, profiles, REWEIGHTINGS)[0]
    return None if np.isnan(refined).any() else refined


def refine_many(grey: Picture, squares: Array, modules: int) -> Array:
    """The same for many squares (n, 4, 2) at once, less exactly; NaN where no lines cross."""
    return _refined(grey, squares, modules, *QUICK)


def unbent(square: Array, lens: Lens) -> Array:
    """The corners (4, 2) of a square whose sides `lens` bends, from those that straight lines gave: they cross beside.

    Pixels, in the lens's picture; so far beside as lines do that are fitted to the sides as the lens bends them.
    """
    rays = lens.rays(square)
    share = np.linspace(TRIM, 1 - TRIM, PROFILES[0])[:, None]
    sides = rays[:, None] + share * (np.roll(rays, -1, axis=0) - rays)[:, None]  # (4, p, 2)
    bent = lens.project(np.column_stack((sides.reshape(-1, 2), np.ones(4 * len(share))))).reshape(1, 4, -1, 2)
    crossed = _cross(*_lines(bent[..., 0], bent[..., 1], np.ones(bent.shape[:3]), REWEIGHTINGS))[0]
    return np.asarray(2 * square - crossed, float)


def _refined(grey: Picture, squares: Array, modules: int, rounds: int, profiles: int, reweightings: int) -> Array:
    refined = squares
    for _ in range(rounds):
        edge = _edge_points(grey, np.nan_to_num(refined), modules, profiles)
        crossed = _cross(*_lines(*edge, reweightings))
        farthest = np.where(_shown(grey, crossed[..., 0], crossed[..., 1]), FARTHEST_PX, FARTHEST_BEYOND_PX)
        near = (np.abs(crossed - squares).max(axis=2) < farthest).all(axis=1)  # not so for NaN
        refined = np.where(near[:, None, None], crossed, np.nan)
    return refined


def _edge_points(grey: Picture, squares: Array, modules: int, profiles: int) -> tuple[Array, Array, Array]:
    """Where profiles across the sides meet the edge, x and y (n, 4, p), and how strong it is there (n, 4, p)."""
    along = np.roll(squares, -1, axis=1) - squares
    length = np.maximum(np.linalg.norm(along, axis=2), 1e-9)
    out_x, out_y = along[..., 1] / length, -along[..., 0] / length
    reach = np.clip(REACH_MODULES * length.min(axis=1) / modules, *REACH_PX)
    share = np.linspace(TRIM, 1 - TRIM, profiles)
    middle_x, middle_y = (squares[..., axis, None] + share * along[..., axis, None] for axis in (0, 1))
    count = round(float(reach.max(initial=REACH_PX[0])) / STEP_PX)
    steps = reach[:, None] * np.linspace(-1, 1, 2 * count + 1)
    x, y = _across(middle_x, out_x, steps), _across(middle_y, out_y, steps)
    profile = sample(grey, x, y)
    behind, ahead = profile[..., :-2], profile[..., 2:]
    rise = (np.maximum(ahead, behind) - behind).astype(np.float32)  # dark to light only: cells do the opposite
    cut = np.flatnonzero(~_shown(grey, x[..., [0, -1]], y[..., [0, -1]]).all(axis=(1, 2, 3)))
    inside = _shown(grey, x[cut], y[cut])
    rise[cut] *= inside[..., :-2] & inside[..., 2:]
    steepest = rise.max(axis=-1, keepdims=True)
    rise = np.maximum(rise - np.minimum(np.float32(NOISE_SHARE) * steepest, np.float32(NOISE_GREY)), 0)
    strength = rise.sum(axis=-1, dtype=float)
    offset = (rise * steps[:, None, None, 1:-1].astype(np.float32)).sum(axis=-1) / np.maximum(strength, 1e-9)
    x, y = middle_x + offset * out_x[..., None], middle_y + offset * out_y[..., None]
    strength[cut] *= _whole(grey, x[cut], y[cut], strength[cut])
    return x, y, strength


def _whole(grey: Picture, x: Array, y: Array, strength: Array) -> NDArray[np.bool_]:
    """Which edge points (n, 4, p) of squares at the picture's edge are of a side that is seen, and not cut off."""
    whole = _shown(grey, x, y, WHOLE_PX) & (strength > WHOLE_STRENGTH * strength.max(axis=(1, 2), keepdims=True))
    shown = whole.mean(axis=2, keepdims=True) > LEAST_SHOWN
    return np.asarray(whole & shown, np.bool_)


def _shown(grey: Picture, x: NDArray[Any], y: NDArray[Any], within: float = 0.0) -> NDArray[np.bool_]:
    """Whether x, y lie in the picture, and so far from its edge: there is nothing to be learnt beyond."""
    height, width = grey.shape
    shown = (x >= within) & (x <= width - 1 - within) & (y >= within) & (y <= height - 1 - within)
    return np.asarray(shown, np.bool_)


def _across(middle: Array, outward: Array, steps: Array) -> NDArray[np.float32]:
    """One coordinate of every step (n, s) of every profile (n, 4, p): (n, 4, p, s)."""
    reach = (outward[:, :, None] * steps[:, None]).astype(np.float32)
    return middle.astype(np.float32)[..., None] + reach[:, :, None]


def _lines(x: Array, y: Array, strength: Array, reweightings: int) -> tuple[Array, Array]:
    """A robust line through each row of points (n, 4, p): a point on it (n, 4, 2) and its direction (n, 4, 2)."""
    trust = np.sqrt(strength)
    weights = trust
    for _ in range(reweightings):
        total = weights.sum(axis=2)
        total = np.where(total > 0, total, np.nan)  # no line where there is no edge
        middle_x, middle_y = ((weights * at).sum(axis=2) / total for at in (x, y))
        right, down = x - middle_x[..., None], y - middle_y[..., None]
        weighted = weights * right
        across = (weighted * down).sum(axis=2)
        angle = np.arctan2(2 * across, (weighted * right - weights * down * down).sum(axis=2)) / 2
        ahead_x, ahead_y = np.cos(angle), np.sin(angle)
        off = np.abs(right * ahead_y[..., None] - down * ahead_x[..., None])
        half = off.shape[2] // 2
        sigma = np.maximum(1.4826 * np.partition(off, half, axis=2)[..., half], OFFSET_FLOOR_PX)
        off /= TUKEY * sigma[..., None]
        weights = trust * np.maximum(1 - off * off, 0) ** 2
    return np.stack((middle_x, middle_y), axis=2), np.stack((ahead_x, ahead_y), axis=2)


def _cross(centre: Array, direction: Array) -> Array:
    """Where each line meets the one before it: the corners in the order of the sides that start there."""
    normal = np.stack((-direction[..., 1], direction[..., 0]), axis=2)
    distance = (normal * centre).sum(axis=2)
    before_normal, before_distance = np.roll(normal, 1, axis=1), np.roll(distance, 1, axis=1)
    with np.errstate(all="ignore"):
        slant = before_normal[..., 0] * normal[..., 1] - before_normal[..., 1] * normal[..., 0]
        x = (before_distance * normal[..., 1] - distance * before_normal[..., 1]) / slant
        y = (before_normal[..., 0] * distance - normal[..., 0] * before_distance) / slant
    return np.stack((x, y), axis=2)
