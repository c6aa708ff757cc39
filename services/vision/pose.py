"""Where a marker is: its corners in one or many pictures to a position in the apartment, with what is sure about it.

Frames as in `frames`; the marker's is x right, y up, z out of the print towards the viewer.

Every picture of a square has two poses that explain it almost equally (Collins and Bartoli, "Infinitesimal
Plane-based Pose Estimation", 2014). Both are kept to the end: as orientations in the apartment each must explain all
views, and when neither is clearly better both are told. The position hardly depends on which is right.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import asin, degrees, exp, hypot, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.frames import Transform
from services.vision.lens import Lens

Array = NDArray[np.float64]

RANDOM_PX = 0.06  # corner noise per axis of one frame, new in each; measured .02 to .06 on rendered markers
FIXED_PX = 0.05  # and what all frames of a place share: print, paper, the pixel grid, the lens calibration
SAME_PLACE_M, SAME_PLACE_DEG = 0.005, 0.2  # readings that differ by less are one place, read with a jitter
SAME_POSE_DEG = 2.0  # orientations that are refined to within this are one
SURE = 0.04  # the second orientation is left out when its weight is below this
CANDIDATES = 4  # orientations worth refining; two are the rule, more come from other places
# The share of wrong first poses by the ratio of the two reprojection errors, measured over simulated single views.
WRONG_BY_RATIO = ((0.05, 0.15, 0.25, 0.4, 0.6, 0.85, 1.0), (0.004, 0.02, 0.06, 0.11, 0.21, 0.39, 0.5))
SINGLE_VIEW_FREEDOM = 2  # eight numbers measured, six of the pose
REFINEMENTS, NUDGE, LONGEST_STEP = 8, 1e-5, 0.3  # steps at most; of the difference quotient and the longest, rad
# IPPE_SQUARE returns no rotation for a square exactly parallel to the picture; a thousandth of a pixel off, it does.
OFF_PARALLEL = 1e-6 * np.array([[0.3, -1.1], [-0.7, 0.4], [1.3, 0.9], [-0.2, 0.6]])
SQUARE = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0]])  # side 1, order of the corners


@dataclass(frozen=True, eq=False)
class View:
    """One sighting: `corners` (4, 2) as `detect` gives them, seen through `lens` from `camera` (T_AC).

    `size_m` is the side of the printed black square, `angle_noise_deg` how well the pan and tilt readings are known,
    `focal_doubt` the standard deviation of the lens's focal length as a share of it.
    """

    lens: Lens
    camera: Transform
    corners: Array
    size_m: float
    angle_noise_deg: float = 0.05
    focal_doubt: float = 0.0


@dataclass(frozen=True, eq=False)
class Located:
    """A marker in the apartment: `position` (3,) in metres with its `covariance` (3, 3) in square metres.

    `orientations` holds (rotation 3x3 T_AM, weight), best first, weights adding up to 1: one entry when it is clear,
    two when it is not. `distance` is that from the nearest lens in metres; `frames` counts the views used.
    """

    position: Array
    covariance: Array
    orientations: tuple[tuple[Array, float], ...]
    distance: float
    frames: int


def locate(views: Sequence[View]) -> Located:
    """The marker's place from all views of it; it must not have moved between them.

    ValueError without views, and when no marker whose face is turned to every lens explains them (mirrored corners).
    """
    sights = _gather(views)
    ranked = _ranked(sights) if np.isfinite(sights.rays).all() else []
    if not ranked:
        raise ValueError("expected clockwise corners of squares turned to the camera: no pose explains them")
    position, covariance = _fused(sights, ranked[0].places)
    distance = float(np.linalg.norm(ranked[0].places - sights.lens_at, axis=1).min())
    return Located(position, covariance, _weighed(ranked), distance, len(views))


@dataclass(frozen=True, eq=False)
class _Sights:
    """The views as arrays of g rows, those of one place averaged to one."""

    rays: Array  # (g, 4, 2), normalised
    rotation: Array  # (g, 3, 3), R_AC
    lens_at: Array  # (g, 3), m
    size: Array  # (g,), m
    noise: Array  # (g,), rad, of a corner
    angle_noise: Array  # (g,), rad, of the camera
    focal_doubt: Array  # (g,), share


def _gather(views: Sequence[View]) -> _Sights:
    places: list[list[View]] = []
    for view in views:
        known = next((place for place in places if _same_place(place[0], view)), None)
        if known is None:
            places.append([view])
        else:
            known.append(view)
    first = [place[0] for place in places]
    corners = [np.mean([view.corners for view in place], axis=0) for place in places]
    noise_px = [hypot(RANDOM_PX / sqrt(len(place)), FIXED_PX) for place in places]
    return _Sights(
        rays=np.array([v.lens.rays(c) for v, c in zip(first, corners, strict=True)]).reshape(-1, 4, 2),
        rotation=np.array([v.camera.rotation for v in first]).reshape(-1, 3, 3),
        lens_at=np.array([v.camera.translation for v in first]).reshape(-1, 3),
        size=np.array([v.size_m for v in first], float),
        noise=np.array([n / v.lens.focal for n, v in zip(noise_px, first, strict=True)], float),
        angle_noise=np.radians([v.angle_noise_deg for v in first]),
        focal_doubt=np.array([v.focal_doubt for v in first], float),
    )


def _same_place(one: View, other: View) -> bool:
    return (
        one.size_m == other.size_m
        and np.array_equal(one.lens.matrix, other.lens.matrix)
        and float(np.linalg.norm(one.camera.translation - other.camera.translation)) < SAME_PLACE_M
        and _angle_deg(one.camera.rotation, other.camera.rotation) < SAME_PLACE_DEG
    )


def _angle_deg(one: Array, other: Array) -> float:
    """Of the rotation between two rotations; by its chord, which is exact for small angles too."""
    return degrees(2 * asin(min(1.0, float(np.linalg.norm(one - other)) / sqrt(8))))


@dataclass(frozen=True, eq=False)
class _Hypothesis:
    """An orientation of the marker, 3x3 T_AM, and what the sights make of it."""

    orientation: Array
    residuals: Array  # (8 g,) in standard deviations
    places: Array  # (g, 3) where each sight would have the marker, in the apartment
    possible: bool  # in front of every lens, its face to it

    @property
    def cost(self) -> float:
        return float(self.residuals @ self.residuals)


def _ranked(sights: _Sights) -> list[_Hypothesis]:
    """The possible orientations, each refined over all sights, the best first."""
    candidates = [_explain(sights, orientation) for orientation in _orientations(sights)]
    candidates = sorted((c for c in candidates if c.possible), key=lambda c: c.cost)
    refined = [_refined(sights, c) for c in _different(candidates)[:CANDIDATES]]
    return _different(sorted((c for c in refined if c.possible), key=lambda c: c.cost))


def _different(hypotheses: Sequence[_Hypothesis]) -> list[_Hypothesis]:
    """Without those that are as good as the same orientation as one before them."""
    kept: list[_Hypothesis] = []
    for one in hypotheses:
        if all(_angle_deg(one.orientation, other.orientation) > SAME_POSE_DEG for other in kept):
            kept.append(one)
    return kept


def _orientations(sights: _Sights) -> Iterable[Array]:
    """Both orientations that each sight on its own allows, in the apartment."""
    for rays, size, rotation in zip(sights.rays, sights.size, sights.rotation, strict=True):
        flags = cv2.SOLVEPNP_IPPE_SQUARE
        _, turns, _, _ = cv2.solvePnPGeneric(SQUARE * size, rays + OFF_PARALLEL, np.eye(3), np.zeros(5), flags=flags)
        yield from (rotation @ _turn(np.asarray(turn, float)) for turn in turns)


def _explain(sights: _Sights, orientation: Array) -> _Hypothesis:
    """The translation of each sight that fits best with this orientation (linear), and what remains.

    The translations are free because the readings of two places disagree by far more than the corners' noise.
    """
    spread = np.einsum("gji,jk,gck->gci", sights.rotation, orientation, SQUARE * sights.size[:, None, None])
    system = np.concatenate((np.broadcast_to(np.eye(2), (*sights.rays.shape, 2)), -sights.rays[..., None]), axis=-1)
    shift = (sights.rays * spread[..., 2:] - spread[..., :2]).reshape(-1, 8)
    centre = np.einsum("gij,gj->gi", np.linalg.pinv(system.reshape(-1, 8, 3)), shift)
    corners = spread + centre[:, None]
    with np.errstate(all="ignore"):
        residuals = (corners[..., :2] / corners[..., 2:] - sights.rays) / sights.noise[:, None, None]
    facing = np.einsum("gji,j,gi->g", sights.rotation, orientation[:, 2], centre) < 0
    places = np.einsum("gij,gj->gi", sights.rotation, centre) + sights.lens_at
    possible = bool(facing.all() and (corners[..., 2] > 0).all() and np.isfinite(residuals).all())
    return _Hypothesis(orientation, residuals.ravel(), places, possible)


def _refined(sights: _Sights, start: _Hypothesis) -> _Hypothesis:
    """The nearest orientation with the least residuals over all sights (Gauss-Newton over the three angles)."""
    best = start
    for _ in range(REFINEMENTS):
        nudged = [_explain(sights, best.orientation @ _turn(axis)).residuals for axis in NUDGE * np.eye(3)]
        slope = (np.array(nudged) - best.residuals).T / NUDGE
        step = np.asarray(np.linalg.lstsq(slope, -best.residuals, rcond=1e-6)[0], float)
        step *= min(1.0, LONGEST_STEP / max(float(np.linalg.norm(step)), 1e-12))
        tried = _explain(sights, best.orientation @ _turn(step))
        if not tried.possible or tried.cost >= best.cost:
            break
        best = tried
    return best


def _turn(angles: Array) -> Array:
    return np.asarray(cv2.Rodrigues(angles)[0], float)


def _weighed(ranked: Sequence[_Hypothesis]) -> tuple[tuple[Array, float], ...]:
    """The orientations with their weights: the best alone when it is clearly better than the second."""
    if len(ranked) > 1:
        second = _doubt(ranked[0], ranked[1])
        if second >= SURE:
            return (ranked[0].orientation, 1 - second), (ranked[1].orientation, second)
    return ((ranked[0].orientation, 1.0),)


def _doubt(best: _Hypothesis, second: _Hypothesis) -> float:
    """How likely the second best is the right one: the greater of two estimates.

    By the ratio of their errors, as measured for single views; with more sights the noise in it is that of one, so that
    agreement adds up. And by the likelihood with the corner noise as assumed, for residuals that are small by luck.
    """
    more = second.cost - best.cost
    noise = best.cost / (5 * len(best.places) - 3) * SINGLE_VIEW_FREEDOM
    ratio = sqrt(noise / max(noise + more, 1e-12))
    return max(float(np.interp(ratio, *WRONG_BY_RATIO)), 1 / (1 + exp(min(more / 2, 500.0))))


def _fused(sights: _Sights, places: Array) -> tuple[Array, Array]:
    """The mean of the sights' places weighted by their information, and its covariance.

    Where they disagree by more than they should, the covariance grows to match (Birge 1932).
    """
    covariances = [_covariance(sights, index, place) for index, place in enumerate(places)]
    information = np.linalg.inv(covariances)
    covariance = np.linalg.inv(information.sum(axis=0))
    position = covariance @ np.einsum("gij,gj->i", information, places)
    off = places - position
    freedom = max(3 * (len(places) - 1), 1)
    return position, covariance * max(1.0, float(np.einsum("gi,gij,gj", off, information, off)) / freedom)


def _covariance(sights: _Sights, index: int, place: Array) -> Array:
    """Of one sight's place, (3, 3) in the apartment: along the ray from the marker's size in the picture, across it
    from the corners and the camera's angles."""
    to_marker = place - sights.lens_at[index]
    distance = float(np.linalg.norm(to_marker))
    noise = sights.noise[index]
    along = noise * distance**2 / sights.size[index]
    across = distance * hypot(noise / 2, sights.angle_noise[index])
    ray = np.outer(to_marker, to_marker) / distance**2
    axis = sights.rotation[index][:, 2]
    stretched = sights.focal_doubt[index] * float(axis @ to_marker) * axis  # a longer lens moves the depth alone
    return np.asarray(along**2 * ray + across**2 * (np.eye(3) - ray) + np.outer(stretched, stretched), float)
