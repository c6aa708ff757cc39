"""Corners to a few hundredths of a pixel: a line is fitted to each side of a dark square and neighbours are crossed.

The edge crosses each profile where its squared gradient has its centre of mass. On small markers that is several
times closer than `cornerSubPix`, whose window reaches into the cells. Finding the squares is in `detect`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

ROUNDS = 3  # the profiles are centred on the last round's lines: what noise or a cut-off flank pulls is gone by then
TRIM = 0.12  # of a side left out at both ends, where the other side's edge is near
REACH_MODULES = 0.7  # how far profiles reach: not over the border into the cells or the quiet zone into the wall
REACH_PX = (1.5, 3.0)  # and the least and most of that in pixels
STEP_PX = 0.5  # along a profile
PROFILES = (12, 64)  # least and most per side; about one for each pixel
TUKEY = 4.685  # cut-off of the robust line in standard deviations (95 % efficient, Huber 1981)
OFFSET_FLOOR_PX = 0.03  # spread of edge points below which none counts as an outlier
FARTHEST_PX = 4.0  # a corner that walks farther than this from where it was found belongs to something else


def sample(grey: Picture, x: Array, y: Array) -> Array:
    """Bilinear grey values of the picture at x, y (any one shape); beyond its edge the edge's value."""
    height, width = grey.shape
    x, y = np.clip(x, 0, width - 1.001), np.clip(y, 0, height - 1.001)
    column, row = x.astype(np.intp), y.astype(np.intp)
    u, v = x - column, y - row
    at = row * width + column
    flat = grey.reshape(-1)
    upper = flat[at] * (1 - u) + flat[at + 1] * u
    lower = flat[at + width] * (1 - u) + flat[at + width + 1] * u
    values: Array = upper * (1 - v) + lower * v
    return values


def refine(grey: Picture, square: Array, modules: int) -> Array | None:
    """The corners (4, 2) of a dark square on light ground, from roughly right ones; None where the edges are not.

    `square` is clockwise in the picture; `modules` is the number of cells on its side, the border's included.
    """
    refined = square
    for _ in range(ROUNDS):
        points, strength = _edge_points(grey, refined, modules)
        crossed = _cross(*_lines(points, strength))
        if not np.abs(crossed - square).max() < FARTHEST_PX:  # also true for NaN
            return None
        refined = crossed
    return refined


def _edge_points(grey: Picture, square: Array, modules: int) -> tuple[Array, Array]:
    """Where profiles across the four sides meet the edge: points (4, n, 2) and how strong it is there (4, n)."""
    along = np.roll(square, -1, axis=0) - square
    length = np.linalg.norm(along, axis=1)
    outward = np.column_stack((along[:, 1], -along[:, 0])) / length[:, None]
    reach = float(np.clip(REACH_MODULES * length.min() / modules, *REACH_PX))
    count = int(np.clip(length.max(), *PROFILES))
    share = np.linspace(TRIM, 1 - TRIM, count)
    middle = square[:, None] + share[:, None] * along[:, None]
    steps = np.linspace(-reach, reach, 2 * round(reach / STEP_PX) + 1)
    at = middle[:, :, None] + steps[:, None] * outward[:, None, None]
    profile = sample(grey, at[..., 0], at[..., 1])
    rise = np.clip(profile[..., 2:] - profile[..., :-2], 0, None) ** 2  # dark to light only: cells do the opposite
    strength = rise.sum(axis=-1)
    offset = (rise @ steps[1:-1]) / np.maximum(strength, 1e-9)
    return middle + offset[..., None] * outward[:, None], strength


def _lines(points: Array, strength: Array) -> tuple[Array, Array]:
    """A robust line through each row of points: a point on it (4, 2) and its direction (4, 2)."""
    weights = np.sqrt(strength)
    for _ in range(4):
        total = np.maximum(weights.sum(axis=1), 1e-9)
        centre = np.einsum("ip,ipk->ik", weights, points) / total[:, None]
        spread = points - centre[:, None]
        moments = np.einsum("ip,ipk,ipl->ikl", weights, spread, spread)
        direction = np.linalg.eigh(moments)[1][:, :, 1]
        off = spread[..., 0] * direction[:, None, 1] - spread[..., 1] * direction[:, None, 0]
        sigma = np.maximum(1.4826 * np.median(np.abs(off), axis=1), OFFSET_FLOOR_PX)
        weights = np.sqrt(strength) * np.clip(1 - (off / (TUKEY * sigma[:, None])) ** 2, 0, None) ** 2
    return centre, direction


def _cross(centre: Array, direction: Array) -> Array:
    """Where each line meets the one before it: the corners in the order of the sides that start there."""
    normal = np.column_stack((-direction[:, 1], direction[:, 0]))
    distance = (normal * centre).sum(axis=1)
    before_normal, before_distance = np.roll(normal, 1, axis=0), np.roll(distance, 1)
    with np.errstate(all="ignore"):
        slant = before_normal[:, 0] * normal[:, 1] - before_normal[:, 1] * normal[:, 0]
        x = (before_distance * normal[:, 1] - distance * before_normal[:, 1]) / slant
        y = (before_normal[:, 0] * distance - normal[:, 0] * before_distance) / slant
    return np.column_stack((x, y))
