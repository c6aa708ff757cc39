"""From where a robot can look at a marker: poses on free floor, facing it, that it can drive to. Pure geometry."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, inf, pi, radians, sin, tan

import numpy as np
from numpy.typing import NDArray

from services.floor import XY, Grid

DISTANCES_M = (0.5, 0.7, 0.9, 1.2, 1.5, 1.9, 2.3)  # to the marker that are tried
BEST_M, NEAREST_M = 1.2, 0.8  # as a rule; nearer to a print that lies high, and where there is no other place
BEARINGS = 24  # directions round it that are tried
APART_M = 0.6  # stands nearer to each other than this show the same
OBLIQUE = radians(60)  # farther from the marker's face it is hard to read
SLANT, STEEP = radians(50), radians(65)  # from above, to a print that lies: to be had at best, and at most
TOO_FLAT, TOO_NEAR = 3.0, 1.5  # metres of distance that a stand beyond these costs
WAY_COST = 0.15  # a metre of way more is worth so many metres of distance to the marker


@dataclass(frozen=True)
class Pose:
    """On the floor, in the map frame: metres, and degrees counter-clockwise from x."""

    x: float
    y: float
    yaw_deg: float


@dataclass(frozen=True)
class Body:
    """The robot's size and where it is: radius in metres, and what it can drive to from there."""

    radius: float
    at: XY
    reach: NDArray[np.bool_]


def body(grid: Grid, radius: float, at: XY) -> Body:
    """A round robot at a place of the map."""
    return Body(radius, at, grid.reachable(at, radius + grid.resolution / 2))


@dataclass(frozen=True)
class View:
    """From how far something is best looked at, metres; farther than `farthest_m` it shows hardly anything."""

    best_m: float = BEST_M
    farthest_m: float = inf

    @classmethod
    def down(cls, above_m: float) -> View:
        """On a print that lies so far below the robot's camera."""
        return cls(above_m * tan(SLANT), above_m * tan(STEEP))

    def cost(self, distance: float) -> float:
        """What a distance is worse than the best, metres."""
        near = TOO_NEAR if distance < min(NEAREST_M, self.best_m) else 0.0
        return abs(distance - self.best_m) + (TOO_FLAT if distance > self.farthest_m else near)


ANY = View()


def stands(
    grid: Grid, robot: Body, target: XY, facing_deg: float | None = None, view: View = ANY, most: int = 4
) -> list[Pose]:
    """Poses from which the robot faces `target` (map frame, metres), best first, none when there are none.

    `facing_deg`: the direction in which the marker's print faces, where it hangs; None: it can be read from all sides.
    Each keeps the robot's radius to what is not free, can be driven to, and has no occupied cell in its line of sight.
    """
    found = sorted(_possible(grid, robot, target, facing_deg, view), key=lambda one: one[0])
    chosen: list[Pose] = []
    for _, pose in found:
        if len(chosen) < most and all(hypot(pose.x - other.x, pose.y - other.y) >= APART_M for other in chosen):
            chosen.append(pose)
    return chosen


def _possible(grid: Grid, robot: Body, target: XY, facing_deg: float | None, view: View) -> list[tuple[float, Pose]]:
    possible = []
    for distance in DISTANCES_M:
        for bearing in np.arange(BEARINGS) * 2 * pi / BEARINGS:
            aside = 0.0 if facing_deg is None else _between(bearing, radians(facing_deg))
            x, y = float(target[0] + distance * cos(bearing)), float(target[1] + distance * sin(bearing))
            if aside <= OBLIQUE and _may_stand(grid, robot, (x, y)) and grid.sees((x, y), target):
                way = hypot(x - robot.at[0], y - robot.at[1])
                cost = view.cost(distance) + WAY_COST * way + 0.5 * aside
                possible.append((cost, Pose(x, y, degrees(atan2(target[1] - y, target[0] - x)))))
    return possible


def _may_stand(grid: Grid, robot: Body, at: XY) -> bool:
    row, column = grid.cell(*at)
    return grid.inside(row, column) and bool(robot.reach[row, column]) and grid.clear(*at, robot.radius)


def _between(one: float, other: float) -> float:
    return abs((one - other + pi) % (2 * pi) - pi)
