"""In which order a scan visits its places: the shortest way by what is known of the motors' speeds. Pure.

Pan is unwrapped (`ptz/goal.py`), so a way can never lead across the dead arc. Not here: the visits (`search.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from services.camera.device import Reading
from services.camera.ptz.drive import longest
from services.camera.ptz.goal import Limits, Pose
from services.camera.ptz.pace import HALF_CHANGE, Pace
from services.camera.ptz.skill import Skill
from services.payloads import Place

EXACT = 12  # up to this many places the order is the best there is; found in a tenth of a second

Matrix = NDArray[np.float64]


def shortest(
    places: Mapping[str, Place],
    limits: Limits,
    reading: Reading | None,
    skill: Skill,
    *,
    first: str | None = None,
    turns: int = 1,
    exact: int = EXACT,
) -> list[str]:
    """The names in the order of the quickest open tour from where the camera looks, or from anywhere if not known.

    `first` is visited before all others; with two `turns` the way back counts too.
    """
    names = list(places)
    if not names:
        return []
    poses = [_pose(limits, place) for place in places.values()]
    drives = [place.preset is not None for place in places.values()]
    ways = np.array([[hop_s(a, b, skill, drives=drive) for b, drive in zip(poses, drives, strict=True)] for a in poses])
    here = limits.pose(reading) if reading is not None else None
    begin = np.zeros(len(names))
    if here is not None:
        begin = np.array([hop_s(here, b, skill, drives=drive) for b, drive in zip(poses, drives, strict=True)])
    if first is not None and first in places:
        begin = np.where(np.arange(len(names)) == names.index(first), begin, np.inf)
    order = _exact(begin, turns * ways) if len(names) <= exact else _improved(begin, turns * ways, poses)
    return [names[index] for index in order]


def hop_s(here: Pose, there: Pose, skill: Skill, *, drives: bool) -> float:
    """How long the motors need from one pose to another, from rest to rest, at the widest zoom.

    `drives`: the firmware may do it by itself, to a preset; it does so too where it takes positions.
    """
    start, end = (*here[:2], 0.0), (*there[:2], 0.0)
    if drives or "yes" in (skill.honours.get("PositionABS"), skill.honours.get("moveAbsolutely")):
        return longest(skill, start, end)
    times = [_alone(pace, abs(b - a)) for pace, a, b in zip(skill.paces[:2], start, end, strict=False)]
    return max(times) if skill.diagonals else sum(times)


def detours(stop: Place, way: Sequence[Place], limits: Limits, skill: Skill) -> list[float]:
    """How many seconds a stop more costs after each of the places of a way, the last one included."""
    there, poses = _pose(limits, stop), [_pose(limits, place) for place in way]

    def hop(a: Pose, b: Pose, to: Place) -> float:
        return hop_s(a, b, skill, drives=to.preset is not None)

    onward = [hop(there, b, to) - hop(a, b, to) for (a, b), to in zip(pairwise(poses), way[1:], strict=True)]
    return [hop(pose, there, stop) + more for pose, more in zip(poses, [*onward, 0.0], strict=True)]


def _pose(limits: Limits, place: Place) -> Pose:
    return limits.pose(Reading(place.pan, place.tilt, limits.zoom[0]))


def _alone(pace: Pace, distance: float) -> float:
    """One axis at its top speed."""
    rate, slow = pace.rate(pace.speeds[-1]), 2 * pace.other(HALF_CHANGE)
    return 2 * sqrt(distance * slow) if distance < slow * rate * rate else distance / rate + slow * rate


def _exact(begin: Matrix, ways: Matrix) -> list[int]:
    """The best order of all, by dynamic programming over the sets of places already visited (Held and Karp 1962)."""
    count = len(begin)
    best = np.full((1 << count, count), np.inf)  # the least time to have visited a set, ending at a place
    came = np.zeros((1 << count, count), np.int64)
    for index in range(count):
        best[1 << index, index] = begin[index]
    for visited in range(1, 1 << count):
        onward = best[visited][:, None] + ways
        to, where = onward.min(axis=0), onward.argmin(axis=0)
        for index in range(count):
            larger = visited | 1 << index
            if larger != visited and to[index] < best[larger, index]:
                best[larger, index], came[larger, index] = to[index], where[index]
    visited = (1 << count) - 1
    order = [int(best[visited].argmin())]
    while len(order) < count:
        order.append(int(came[visited, order[-1]]))
        visited ^= 1 << order[-2]
    return order[::-1]


def _improved(begin: Matrix, ways: Matrix, poses: Sequence[Pose]) -> list[int]:
    """Along the pan, then stretches are reversed while that makes the tour shorter (2-opt; Croes 1958)."""

    def cost(order: Sequence[int]) -> float:
        return float(begin[order[0]] + ways[order[:-1], order[1:]].sum())

    order = sorted(range(len(poses)), key=lambda index: poses[index])
    order = min((order, order[::-1], sorted(order, key=lambda index: begin[index])), key=cost)
    better = True
    while better:
        better = False
        for start in range(len(order)):
            for end in range(start + 2, len(order) + 1):
                other = order[:start] + order[start:end][::-1] + order[end:]
                if cost(other) < cost(order) - 1e-9:
                    order, better = other, True
    return order
