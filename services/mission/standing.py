"""From where a robot can look at a marker: poses on free floor, facing it, that it can drive to. Pure geometry."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, degrees, hypot, inf, pi, radians, tan

import numpy as np
from numpy.typing import NDArray

from services.apartment.floor import XY, Grid

RANGE_M = (0.45, 2.3)  # to the marker
BEST_M, NEAREST_M = 1.2, 0.8  # as a rule; nearer to a print that lies high, and where there is no other place
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

    def costs(self, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """What distances are worse than the best, metres."""
        near = np.where(distances < min(NEAREST_M, self.best_m), TOO_NEAR, 0.0)
        return np.abs(distances - self.best_m) + np.where(distances > self.farthest_m, TOO_FLAT, near)


ANY = View()


def stands(
    grid: Grid, robot: Body, target: XY, facing_deg: float | None = None, view: View = ANY, most: int = 4
) -> list[Pose]:
    """Poses from which the robot faces `target` (map frame, metres), best first, none when there are none.

    `facing_deg`: the direction in which the marker's print faces, where it hangs; None: it can be read from all sides.
    Each keeps the robot's radius to what is not free, can be driven to, and has no occupied cell in its line of sight.
    """
    at, costs = _possible(grid, robot, target, facing_deg, view)
    chosen: list[Pose] = []
    for index in np.argsort(costs, kind="stable"):
        x, y = (float(part) for part in at[index])
        if len(chosen) == most:
            break
        if all(hypot(x - other.x, y - other.y) >= APART_M for other in chosen) and grid.sees((x, y), target):
            chosen.append(Pose(x, y, degrees(atan2(target[1] - y, target[0] - x))))
    return chosen


def _possible(
    grid: Grid, robot: Body, target: XY, facing_deg: float | None, view: View
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The middles of cells (n, 2) that the robot comes to, with the target in range and its face to them; the costs."""
    at = grid.origin + (np.argwhere(robot.reach)[:, ::-1] + 0.5) * grid.resolution
    away = np.hypot(*(at - target).T)
    in_range = (away >= RANGE_M[0]) & (away <= RANGE_M[1])
    at, away = at[in_range], away[in_range]
    aside = np.zeros(len(at))
    if facing_deg is not None:
        aside = _between(np.arctan2(*(at - target).T[::-1]), radians(facing_deg))
    way = np.hypot(*(at - robot.at).T)
    costs = view.costs(away) + WAY_COST * way + 0.5 * aside
    kept = aside <= OBLIQUE
    return at[kept], costs[kept]


def _between(one: NDArray[np.float64], other: float) -> NDArray[np.float64]:
    return np.asarray(np.abs((one - other + pi) % (2 * pi) - pi))
