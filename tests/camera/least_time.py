"""The least time that the motors need for a path: both axes together, top speed, accelerations, no delays.

Computed from the true constants of whatever camera it is, outside the product. Pan takes the way round the dead arc
(there is no other). Zoom may go on at the same time: that no firmware of start and stop can do so is its loss.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, degrees, sqrt

Pose = tuple[float, float, float]


@dataclass(frozen=True)
class Constants:
    """Top speeds of pan, tilt (degrees/s) and zoom (levels/s), and the accelerations (degrees/s^2)."""

    speeds: tuple[float, float, float]
    accelerations: tuple[float, float, float]
    dead_arc: tuple[float, float] = (179.0, 186.0)


def alone(distance: float, speed: float, acceleration: float) -> float:
    """From rest to rest over a distance, seconds."""
    if distance * acceleration < speed * speed:
        return 2 * sqrt(distance / acceleration)  # it never reaches its top speed
    return distance / speed + speed / acceleration


def least_time(here: Pose, goal: Pose, constants: Constants) -> float:
    """Seconds from one pose to another, both as readings."""
    middle = sum(constants.dead_arc) / 2
    pans = [pan % 360 if pan % 360 <= middle else pan % 360 - 360 for pan in (here[0], goal[0])]
    ways = (abs(pans[1] - pans[0]), abs(goal[1] - here[1]), abs(goal[2] - here[2]))
    return max(map(alone, ways, constants.speeds, constants.accelerations))


@dataclass(frozen=True)
class Hops:
    """A relative form: the tangents of its whole scale at the widest zoom; answers, seconds, and what they vary by."""

    plane: tuple[float, float]
    answer: float
    varies: float
    near: float = 0.42  # degrees: as near as that a reading has arrived


def least_by_hops(here: Pose, goal: Pose, constants: Constants, hops: Hops) -> float:
    """Seconds that a goal takes by the relative form at least, as is to be expected, with a reading that verifies it.

    One answer before anything turns and one for the reading at rest. What one hop from rest does not reach needs one
    in flight, and that ends beside by the speed times what its answer was sooner or later: even over that whole range.
    So it needs another from rest, unless it was near; that one is taken to be answered at the very moment of rest.
    """
    larger = 1.0 + here[2] / 4.0
    middle = sum(constants.dead_arc) / 2
    pans = [pan % 360 if pan % 360 <= middle else pan % 360 - 360 for pan in (here[0], goal[0])]
    ways = (abs(pans[1] - pans[0]), abs(goal[1] - here[1]))
    least = least_time(here, goal, constants) + 2 * hops.answer
    reaches = [degrees(atan(tangent / larger)) for tangent in hops.plane]
    if all(way <= reach for way, reach in zip(ways, reaches, strict=True)):
        return least
    lead = max((0, 1), key=lambda axis: alone(ways[axis], constants.speeds[axis], constants.accelerations[axis]))
    most = min(constants.speeds[lead], sqrt(ways[lead] * constants.accelerations[lead])) * hops.varies
    steps = [most * (step + 0.5) / 100 for step in range(100)]
    again = [alone(off, constants.speeds[lead], constants.accelerations[lead]) for off in steps if off > hops.near]
    return least + sum(again) / len(steps)


@dataclass(frozen=True)
class ScanBound:
    """What a scan needs at least: `tour` of motion, `frames` of exposure, `switches` of the picture's mode, seconds."""

    tour: float
    frames: float
    switches: float

    @property
    def seconds(self) -> float:
        """All of it."""
        return self.tour + self.frames + self.switches


def least_scan(
    here: Pose, places: Sequence[Pose], constants: Constants, *, turns: int, frames: int, fps: float, switch_s: float
) -> ScanBound:
    """Every place seen in `turns` picture modes, `frames` each, from a camera that looks `here`; all in no time else.

    The best of two ways: one tour with a switch at each place, or tours there and back with a switch at each end (none
    needs a way, and the first mode is there already). Settling is none: a frame may be exposed as soon as all stands.
    """
    exposed = len(places) * turns * frames / fps
    once, again = _best_tour(here, places, constants, 1), _best_tour(here, places, constants, turns)
    there_and_back = ScanBound(again, exposed, (turns - 1) * switch_s)
    at_each = ScanBound(once, exposed, (turns - 1) * len(places) * switch_s)
    return min(there_and_back, at_each, key=lambda bound: bound.seconds)


def _best_tour(here: Pose, places: Sequence[Pose], constants: Constants, turns: int) -> float:
    """The quickest open tour through all, the ways between places as often as there are turns; all orders are tried."""
    ways = [[least_time(a, b, constants) for b in places] for a in places]
    begin = [least_time(here, place, constants) for place in places]

    def onward(last: int, left: frozenset[int], least: dict[tuple[int, frozenset[int]], float]) -> float:
        if not left:
            return 0.0
        if (last, left) not in least:
            least[last, left] = min(turns * ways[last][to] + onward(to, left - {to}, least) for to in left)
        return least[last, left]

    known: dict[tuple[int, frozenset[int]], float] = {}
    every = frozenset(range(len(places)))
    return min(begin[first] + onward(first, every - {first}, known) for first in every)
