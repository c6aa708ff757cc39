"""Which way a marker is turned: the orientations that explain all sights of it, the best first, with their weights.

Every picture of a square has two poses that explain it almost equally (Collins and Bartoli, "Infinitesimal
Plane-based Pose Estimation", 2014). Each of a sight's two is refined over all of them, with the translations left
free: the readings of two places disagree by far more than the corners' noise. Where the marker is, is in `fusion`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import exp, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.prior import Prior
from services.vision.views import Sights, turned_deg

Array = NDArray[np.float64]

SAME_POSE_DEG = 2.0  # orientations that are refined to within this are one
SURE = 0.04  # the second orientation is left out when its weight is below this
CANDIDATES = 4  # orientations worth refining; two are the rule, more come from other places
# The share of wrong first poses by the ratio of the two reprojection errors, measured over simulated single views.
WRONG_BY_RATIO = ((0.05, 0.15, 0.25, 0.4, 0.6, 0.85, 1.0), (0.004, 0.02, 0.06, 0.11, 0.21, 0.39, 0.5))
SINGLE_VIEW_FREEDOM = 2  # eight numbers measured, six of the pose
REFINEMENTS, NUDGE, LONGEST_STEP = 8, 1e-5, 0.3  # steps at most; of the difference quotient and the longest, rad
ENOUGH = 1e-3  # variances; a step that gains less was the last
# IPPE_SQUARE returns no rotation for a square exactly parallel to the picture; a thousandth of a pixel off, it does.
OFF_PARALLEL = 1e-6 * np.array([[0.3, -1.1], [-0.7, 0.4], [1.3, 0.9], [-0.2, 0.6]])
SQUARE = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0]])  # side 1, order of the corners


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """An orientation of the marker, 3x3 T_AM, and what the sights make of it."""

    orientation: Array
    residuals: Array  # (8 g,) of the sides in standard deviations, and what the prior adds
    places: Array  # (g, 3) where each sight would have the marker, in the apartment
    possible: bool  # in front of every lens, its face to it

    @property
    def cost(self) -> float:
        """Squared error over all sights, in variances."""
        return float(self.residuals @ self.residuals)

    @property
    def seen(self) -> float:
        """That of the sides alone."""
        sides = self.residuals[: 8 * len(self.places)]
        return float(sides @ sides)


def ranked(sights: Sights, prior: Prior | None = None) -> list[Hypothesis]:
    """The possible orientations, each refined over all sights, the best first."""
    candidates = [_explain(sights, orientation, prior) for orientation in _orientations(sights)]
    candidates = sorted((c for c in candidates if c.possible), key=lambda c: c.cost)
    refined = [_refined(sights, c, prior) for c in _different(candidates)[:CANDIDATES]]
    return _different(sorted((c for c in refined if c.possible), key=lambda c: c.cost))


def weighed(best_first: Sequence[Hypothesis]) -> tuple[tuple[Array, float], ...]:
    """The orientations with their weights: the best alone when it is clearly better than the second."""
    if len(best_first) > 1:
        second = _doubt(best_first[0], best_first[1])
        if second >= SURE:
            return (best_first[0].orientation, 1 - second), (best_first[1].orientation, second)
    return ((best_first[0].orientation, 1.0),)


def turn(angles: Array) -> Array:
    """The rotation about an axis (3,), by its length in radians (Rodrigues)."""
    return np.asarray(cv2.Rodrigues(angles)[0], float)


def _different(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Without those that are as good as the same orientation as one before them."""
    kept: list[Hypothesis] = []
    for one in hypotheses:
        if all(turned_deg(one.orientation, other.orientation) > SAME_POSE_DEG for other in kept):
            kept.append(one)
    return kept


def _orientations(sights: Sights) -> Iterable[Array]:
    """Both orientations that each sight on its own allows, in the apartment."""
    for rays, size, rotation in zip(sights.rays, sights.size, sights.rotation, strict=True):
        flags = cv2.SOLVEPNP_IPPE_SQUARE
        _, turns, _, _ = cv2.solvePnPGeneric(SQUARE * size, rays + OFF_PARALLEL, np.eye(3), np.zeros(5), flags=flags)
        yield from (rotation @ turn(np.asarray(angles, float)) for angles in turns)


def _explain(sights: Sights, orientation: Array, prior: Prior | None) -> Hypothesis:
    """The translation of each sight that fits best with this orientation (linear), and what remains."""
    spread = np.einsum("gji,jk,gck->gci", sights.rotation, orientation, SQUARE * sights.size[:, None, None])
    system = np.concatenate((np.broadcast_to(np.eye(2), (*sights.rays.shape, 2)), -sights.rays[..., None]), axis=-1)
    shift = (sights.rays * spread[..., 2:] - spread[..., :2]).reshape(-1, 8)
    weighed = np.linalg.pinv(sights.by_sides @ system.reshape(-1, 8, 3)) @ sights.by_sides
    centre = np.einsum("gij,gj->gi", weighed, shift)
    corners = spread + centre[:, None]
    with np.errstate(all="ignore"):
        off = (corners[..., :2] / corners[..., 2:] - sights.rays) / sights.noise[:, None, None]
        residuals = np.einsum("gij,gj->gi", sights.by_sides, off.reshape(-1, 8))
    facing = np.einsum("gji,j,gi->g", sights.rotation, orientation[:, 2], centre) < 0
    places = np.einsum("gij,gj->gi", sights.rotation, centre) + sights.lens_at
    possible = bool(facing.all() and (corners[..., 2] > 0).all() and np.isfinite(residuals).all())
    known = prior.residuals(orientation[:, 2]) if prior else np.zeros(0)
    return Hypothesis(orientation, np.concatenate((residuals.ravel(), known)), places, possible)


def _refined(sights: Sights, start: Hypothesis, prior: Prior | None) -> Hypothesis:
    """The nearest orientation with the least residuals over all sights (Gauss-Newton over the three angles)."""
    best = start
    for _ in range(REFINEMENTS):
        nudged = [_explain(sights, best.orientation @ turn(axis), prior).residuals for axis in NUDGE * np.eye(3)]
        slope = (np.array(nudged) - best.residuals).T / NUDGE
        step = np.asarray(np.linalg.lstsq(slope, -best.residuals, rcond=1e-6)[0], float)
        step *= min(1.0, LONGEST_STEP / max(float(np.linalg.norm(step)), 1e-12))
        tried = _explain(sights, best.orientation @ turn(step), prior)
        if not tried.possible or tried.cost >= best.cost:
            break
        best, gained = tried, best.cost - tried.cost
        if gained < ENOUGH:
            break
    return best


def _doubt(best: Hypothesis, second: Hypothesis) -> float:
    """How likely the second best is the right one: what the pictures say, times what was known before."""
    by_pictures = _unlike(best.seen, second.seen, len(best.places))
    known = (second.cost - second.seen) - (best.cost - best.seen)
    odds = by_pictures / (1 - by_pictures) * exp(-float(np.clip(known / 2, -500, 500)))
    return odds / (1 + odds)


def _unlike(one: float, other: float, sights: int) -> float:
    """How likely the pose with the other squared error is the right one of two: the nearer to a half of two estimates.

    By the ratio of their errors, as measured for single views; with more sights the noise in it is that of one, so that
    agreement adds up. And by the likelihood with the corner noise as assumed, for residuals that are small by luck.
    """
    if other < one:
        return 1 - _unlike(other, one, sights)
    noise = one / (5 * sights - 3) * SINGLE_VIEW_FREEDOM
    ratio = sqrt(noise / max(noise + other - one, 1e-12))
    return max(float(np.interp(ratio, *WRONG_BY_RATIO)), 1 / (1 + exp(min((other - one) / 2, 500.0))))
