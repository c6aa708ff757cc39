"""Where the apartment lies in a robot's map, from points that are known in both: a turn and a shift in the plane.

Points come in pairs, metres, each from a tape, a map viewer, or what robot and house both see; here is what they tell,
how well, and which of them cannot be right. Where the answer is kept: `services/apartment/robot_places.py`.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, sqrt

import numpy as np
from numpy.typing import NDArray

XY = tuple[float, float]
FEWEST = 2
APART_M = 0.2  # points that lie within this of each other tell no direction
SCALES = (0.8, 1.25)  # beyond it one of the two is not in metres
MISPLACED = 4.0  # standard deviations from where the others say that it is
AGREE = 3.0  # standard deviations that a fit may leave


@dataclass(frozen=True)
class Pair:
    """One point in both frames, metres."""

    name: str
    apartment: XY
    map: XY


@dataclass(frozen=True)
class MapFit:
    """The apartment frame's pose in the map frame: metres and degrees, with standard deviations.

    `off_m` of each pair, in their order: from where the pose puts its point to where the map has it. `misplaced` is the
    pair that the others speak against, and `misplaced_m` how far from where they put it.
    """

    x: float
    y: float
    yaw_deg: float
    sigma_m: float  # of x and of y
    sigma_deg: float
    off_m: tuple[float, ...]
    misplaced: str | None = None
    misplaced_m: float = 0.0


def fit(pairs: Sequence[Pair], doubt_m: float) -> MapFit:
    """The turn and shift that leave the least squares (Umeyama 1991, in the plane and without a scale).

    `doubt_m`: how well each point was measured. ValueError with the reason where the pairs tell no pose. Two pairs fit
    mirrored as well as turned: only a third tells that an axis is the wrong way round.
    """
    if len(pairs) < FEWEST:
        raise ValueError(f"expected {FEWEST} pairs of points or more, got {len(pairs)}: one point tells no direction")
    here, there = (_plane(points) for points in zip(*((one.apartment, one.map) for one in pairs), strict=True))
    for points, what in ((here, "the apartment"), (there, "the map")):
        if _width(points) < APART_M:
            raise ValueError(
                f"expected points at least {APART_M} m apart, all lie within {_width(points):.2f} m in {what}"
            )
    _must_not_be_mirrored(here, there, doubt_m)
    name, misplaced_m = _misplaced(pairs, here, there, doubt_m)
    scale = sqrt(_spread(there) / _spread(here))
    if name is None and not SCALES[0] <= scale <= SCALES[1]:
        raise ValueError(f"expected metres in both, the map's points lie {scale:.3g} times as far apart")
    turn, shift = _pose(here, there)
    off = np.abs(there - (turn * here + shift))
    freedom = 2 * len(pairs) - 3
    sigma = max(doubt_m, sqrt(float(off @ off) / freedom))
    spread = _spread(here)
    lever = abs(here.mean()) ** 2 / spread  # a turn about the middle of the points moves the apartment's origin
    return MapFit(
        float(shift.real), float(shift.imag), degrees(phase(turn)),
        sigma * sqrt(1 / len(pairs) + lever), degrees(sigma / sqrt(spread)),
        tuple(map(float, off)), name, misplaced_m,
    )  # fmt: skip


Points = NDArray[np.complex128]  # of the plane: x + iy, so that a turn is a product


def _plane(points: Sequence[XY]) -> Points:
    return np.array([complex(x, y) for x, y in points])


def _width(points: Points) -> float:
    return float(np.abs(points[:, None] - points[None, :]).max())


def _spread(points: Points) -> float:
    return float((np.abs(points - points.mean()) ** 2).sum())


def _pose(here: Points, there: Points) -> tuple[complex, complex]:
    """The turn (of length 1) about the apartment's origin, and the shift after it."""
    product = complex((there - there.mean()) @ np.conj(here - here.mean()))
    turn = product / abs(product) if product else 1.0 + 0.0j
    return turn, complex(there.mean()) - turn * complex(here.mean())


def _left(here: Points, there: Points) -> float:
    """Root mean square of what the best pose leaves."""
    turn, shift = _pose(here, there)
    return sqrt(float((np.abs(there - (turn * here + shift)) ** 2).mean()))


def _must_not_be_mirrored(here: Points, there: Points, doubt_m: float) -> None:
    turned, mirrored = _left(here, there), _left(np.conj(here), there)
    if mirrored < AGREE * doubt_m < turned:
        raise ValueError(
            f"expected x to the right and y up in both, one of them is mirrored: so the points agree to "
            f"{mirrored:.2f} m, and as they are to {turned:.2f} m"
        )


def _misplaced(pairs: Sequence[Pair], here: Points, there: Points, doubt_m: float) -> tuple[str | None, float]:
    """The pair that is farthest from where the others put it, if that is too far, and how far."""
    worst, named, distance = MISPLACED, None, 0.0
    for index in range(len(pairs) if len(pairs) > FEWEST else 0):
        rest = np.arange(len(pairs)) != index
        if _width(here[rest]) < APART_M or _width(there[rest]) < APART_M:
            continue
        turn, shift = _pose(here[rest], there[rest])
        off = abs(there[index] - (turn * here[index] + shift))
        far = abs(here[index] - here[rest].mean()) ** 2 / _spread(here[rest])
        sigma = max(doubt_m, _left(here[rest], there[rest])) * sqrt(1 + 1 / rest.sum() + far)
        if off > worst * sigma:
            worst, named, distance = off / sigma, pairs[index].name, float(off)
    return named, distance
