"""Views of one marker, put together by where the camera stood: the frames of a place become one sight.

Their corners are averaged robustly, and their scatter tells the noise. Frames of one place in which the marker is
not where it was are another sight: it was moved, it is another one of the same kind, or one of them is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from math import asin, degrees, sqrt

import numpy as np
from numpy.typing import NDArray

from services.vision import corners, fit
from services.vision.frames import Transform
from services.vision.lens import Lens

Array = NDArray[np.float64]

RANDOM_PX = 0.02  # corner noise per axis of one frame, new in each, where their own scatter does not tell
FIXED_PX = 0.0125  # and what all frames of a place share, however noisy they are: the pixel grid
BLOOM_PX = 0.004  # shared by all sides too: how far a dark square seems larger or smaller than it is
NODES = 0.219  # of a side, from its middle: in two such places is a line, fitted to 0.76 of a side, off independently,
NODE_NOISE = 0.568  # by this share of what a corner is off, in which two such lines cross
KNOWN_FROM = 8.0  # numbers that RANDOM_PX counts as against the frames' own scatter
SAME_PLACE_M, SAME_PLACE_DEG = 0.005, 0.2  # readings that differ by less are one place, read with a jitter
SAME_FOCAL = 1e-3  # share; a zoom measured anew in each frame is the same zoom
STAYED_PX, STAYED_SIDES = 1.0, 0.03  # corners of one place that are farther apart are not of one marker at rest
COARSER = 2.0  # times; corners that are so much coarser add nothing to the others of a place
BENT_PX = 0.15  # that a lens bends a code by, as it is laid over
HUBER = 1.5  # standard deviations of a frame from where it weighs less
WEIGHINGS = 5


@dataclass(frozen=True, eq=False)
class View:
    """One sighting: `corners` (4, 2) as `detect` gives them, seen through `lens` from `camera` (T_AC), `at` seconds.

    `size_m` is the side of the printed black square, `angle_noise_deg` how well the readings are known of pan and tilt,
    which turn about `axes` (2, 3) in the apartment; None: about any. `focal_doubt` is the standard deviation of the
    lens's focal length as a share of it, `aside_deg` that of its axis in any direction. A picture that was `enlarged`,
    or is less exact for another reason, has coarser corners by that factor. All its sides may seem outwards or inwards
    alike, by `bloom_px`. `sides`: other ones, as `detect` gives them.
    """

    lens: Lens
    camera: Transform
    corners: Array
    size_m: float
    angle_noise_deg: float = 0.05
    focal_doubt: float = 0.0
    aside_deg: float = 0.0
    enlarged: float = 1.0
    bloom_px: float = BLOOM_PX
    axes: Array | None = None
    at: float = 0.0
    sides: Array | None = None

    @cached_property
    def straight(self) -> Array:
        """The corners, put right for how the lens bends the marker."""
        return straight(self.corners, self.sides, self.lens)


@dataclass(frozen=True, eq=False)
class Sights:
    """The views as arrays of g rows, those of one place averaged to one."""

    rays: Array  # (g, 4, 2), normalised
    rotation: Array  # (g, 3, 3), R_AC
    lens_at: Array  # (g, 3), m
    size: Array  # (g,), m
    noise: Array  # (g,), rad, of a corner
    bloom: Array  # (g,), rad, of all sides alike
    swing: Array  # (g, 3, 3), rad: columns are turns of the camera, in its own frame, of one standard deviation each
    focal_doubt: Array  # (g,), share

    def __len__(self) -> int:
        return len(self.rays)

    @cached_property
    def by_sides(self) -> Array:
        """What turns corners' errors (g, 8) in `noise` into as many that are independent: those of the sides.

        A corner is where two fitted lines cross: what it is off along one of them is in the next corner too, and how
        large a marker seems, which tells its distance, is known better than eight independent numbers would tell, as
        far as its sides are not off alike.
        """
        along = np.roll(self.rays, -1, axis=1) - self.rays
        normal = np.stack((along[..., 1], -along[..., 0]), axis=2) / np.linalg.norm(along, axis=2, keepdims=True)
        sides = np.zeros((len(self), 4, 2, 4, 2))  # of each side, at each node, by each corner's x and y
        for side in range(4):
            for node, share in enumerate((0.5 - NODES, 0.5 + NODES)):
                sides[:, side, node, side] = (1 - share) * normal[:, side] / NODE_NOISE
                sides[:, side, node, (side + 1) % 4] = share * normal[:, side] / NODE_NOISE
        alike = 1 - 1 / np.sqrt(1 + 8 * (self.bloom / (NODE_NOISE * self.noise)) ** 2)
        return (np.eye(8) - alike[:, None, None] / 8) @ sides.reshape(-1, 8, 8)

    def chosen(self, rows: Sequence[int]) -> Sights:
        """Only these."""
        index = np.asarray(rows, int)
        return Sights(**{field.name: getattr(self, field.name)[index] for field in fields(self)})


def straight(square: Array, sides: Array | None, lens: Lens) -> Array:
    """Corners (4, 2), pixels, of a marker that a lens bends: where they are, from where `detect` has found them.

    How a bent code is laid over is known to a quarter only: where it is bent a lot, its sides tell better.
    """
    by_sides = np.asarray(square if sides is None else sides, float)
    if sides is not None:
        by_code = fit.unbent(np.asarray(square, float), lens)
        if float(np.abs(by_code - square).max()) < BENT_PX:
            return by_code
    return corners.unbent(by_sides, lens)


def by_place(views: Sequence[View]) -> list[list[int]]:
    """Which views are of one place, and of a marker at rest: their indexes, in the order of their times."""
    places: list[list[int]] = []
    for index in sorted(range(len(views)), key=lambda index: views[index].at):
        view = views[index]
        known = next((p for p in places if _from_there(views[p[0]], view) and _stayed(views[p[-1]], view)), None)
        if known is None:
            places.append([index])
        else:
            known.append(index)
    return places


def gather(places: Sequence[Sequence[View]]) -> Sights:
    """The views of each place as one sight, of the clearest ones."""
    places = [_clearest(place) for place in places]
    first = [place[0] for place in places]
    averaged = [average(np.array([view.straight for view in p]), p[0].enlarged) for p in places]
    rays = [v.lens.rays(square) for v, (square, _) in zip(first, averaged, strict=True)]
    looking = [_mean(np.array([view.camera.rotation for view in place])) for place in places]
    return Sights(
        rays=np.array(rays).reshape(-1, 4, 2),
        rotation=np.array(looking).reshape(-1, 3, 3),
        lens_at=np.array([v.camera.translation for v in first]).reshape(-1, 3),
        size=np.array([v.size_m for v in first], float),
        noise=np.array([n / v.lens.focal for v, (_, n) in zip(first, averaged, strict=True)], float),
        bloom=np.array([v.bloom_px / v.lens.focal for v in first], float),
        swing=np.array([_swing(v, turned) for v, turned in zip(first, looking, strict=True)]).reshape(-1, 3, 3),
        focal_doubt=np.array([v.focal_doubt for v in first], float),
    )


def _clearest(place: Sequence[View]) -> list[View]:
    """Without those whose corners are known to be much coarser than of others from there."""
    coarse = [max(view.enlarged, view.bloom_px / BLOOM_PX) for view in place]
    return [view for view, factor in zip(place, coarse, strict=True) if factor < COARSER * min(coarse)]


def _swing(view: View, rotation: Array) -> Array:
    """Turns of the camera by which it may look beside its reading: a square root of their covariance."""
    axes = rotation.T if view.axes is None else rotation.T @ view.axes.T
    covariance = np.radians(view.angle_noise_deg) ** 2 * axes @ axes.T + np.radians(view.aside_deg) ** 2 * np.eye(3)
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)), float)


def average(corners: Array, enlarged: float = 1.0) -> tuple[Array, float]:
    """The corners (4, 2) of k frames (k, 4, 2), frames that are off weighing less; and their noise per axis, pixels.

    Of a picture that was `enlarged` so many times the noise is larger too.
    """
    frames = len(corners)
    centre = np.median(corners, axis=0)
    weights = np.ones(frames)
    for _ in range(WEIGHINGS if frames > 2 else 0):
        off = np.sqrt(((corners - centre) ** 2).mean(axis=(1, 2)))
        usual = max(float(np.median(off)), RANDOM_PX * enlarged)
        weights = np.minimum(1.0, HUBER * usual / np.maximum(off, 1e-9))
        centre = np.einsum("k,kij->ij", weights, corners) / weights.sum()
    if frames == 2:
        centre = corners.mean(axis=0)
    squares = float((weights[:, None, None] * (corners - centre) ** 2).sum())
    random = (KNOWN_FROM * (RANDOM_PX * enlarged) ** 2 + squares) / (KNOWN_FROM + 8 * (frames - 1))
    return centre, sqrt(random / float(weights.sum()) + (FIXED_PX * enlarged) ** 2)


def turned_deg(one: Array, other: Array) -> float:
    """The angle between two rotations; by its chord, which is exact for small angles too."""
    return degrees(2 * asin(min(1.0, float(np.linalg.norm(one - other)) / sqrt(8))))


def _from_there(one: View, other: View) -> bool:
    return (
        one.size_m == other.size_m
        and abs(one.lens.focal / other.lens.focal - 1) < SAME_FOCAL
        and float(np.linalg.norm(one.camera.translation - other.camera.translation)) < SAME_PLACE_M
        and turned_deg(one.camera.rotation, other.camera.rotation) < SAME_PLACE_DEG
    )


def _stayed(one: View, other: View) -> bool:
    corners = np.asarray(one.corners, float)
    side = float(np.linalg.norm(corners[0] - corners[2])) / sqrt(2)
    limit = max(STAYED_PX, STAYED_SIDES * side)
    return not float(np.abs(corners - other.corners).max()) > limit  # also what is not a number: refused later


def _mean(rotations: Array) -> Array:
    """The rotation nearest to all of them (n, 3, 3): a reading that jitters is better than each of its values."""
    left, _, right = np.linalg.svd(rotations.sum(axis=0))
    return np.asarray(left @ right, float)
