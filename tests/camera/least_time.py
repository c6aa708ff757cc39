"""The least time that the motors need for a path: both axes together, top speed, accelerations, no delays.

Computed from the true constants of whatever camera it is, outside the product. Pan takes the way round the dead arc
(there is no other). Zoom may go on at the same time: that no firmware of start and stop can do so is its loss.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt


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


def least_time(here: tuple[float, float, float], goal: tuple[float, float, float], constants: Constants) -> float:
    """Seconds from one pose to another, both as readings."""
    middle = sum(constants.dead_arc) / 2
    pans = [pan % 360 if pan % 360 <= middle else pan % 360 - 360 for pan in (here[0], goal[0])]
    ways = (abs(pans[1] - pans[0]), abs(goal[1] - here[1]), abs(goal[2] - here[2]))
    return max(map(alone, ways, constants.speeds, constants.accelerations))
