"""How move_base takes a goal to its end: plans, drives, and gives up in its own words. Pure; time is passed in.

Not here: goals that come and go on ROS (`nodes.py`), the way (`route.py`) and the wheels (`body.py`).
"""

from __future__ import annotations

from itertools import pairwise
from math import dist, hypot
from random import Random

from services.apartment.floor import XY, Grid
from services.simulators.robot.body import Body
from services.simulators.robot.route import route

RECOVERY_S = 3.0  # of turning and clearing, until it gives up
YAW_SIGMA_DEG = 2.0  # it is content within some tolerance
NO_PLAN = "Failed to find a valid plan. Even after executing recovery behaviors."
NO_CONTROL = "Failed to find a valid control. Even after executing recovery behaviors."
REACHED = "Goal reached."


class Navigation:
    """One goal at a time. `fails`: so many goals are hindered half way, as when somebody stands in the way."""

    def __init__(self, grid: Grid, radius: float, body: Body, fails: int, seed: int) -> None:
        self.body, self.fails = body, fails
        self._grid, self._radius, self._draw = grid, radius, Random(seed)
        self._left: float | None = None  # metres until it is hindered
        self._gives_up: float | None = None  # seconds until it does
        self._why = ""

    def begin(self, to: XY, yaw_deg: float) -> None:
        """A new goal; the one before is forgotten. Map frame, metres, degrees."""
        self.stop()
        way = route(self._grid, (self.body.x, self.body.y), to, self._radius)
        if way is None:
            self._gives_up, self._why = RECOVERY_S, NO_PLAN
            return
        if self.fails > 0:
            self.fails -= 1
            self._left = sum(dist(one, other) for one, other in pairwise(way)) / 2
        self.body.set_out(way[1:], yaw_deg + self._draw.gauss(0, YAW_SIGMA_DEG))

    def stop(self) -> None:
        """Stands where it is, without a goal."""
        self.body.stop()
        self._left = self._gives_up = None

    def advance(self, seconds: float) -> tuple[bool, str] | None:
        """Lets time pass; whether the goal was reached, and its words, when it has just ended."""
        if self._gives_up is not None:
            self._gives_up -= seconds
            return (False, self._why) if self._gives_up <= 0 else None
        at = (self.body.x, self.body.y)
        self.body.advance(seconds)
        if self._left is not None:
            self._left -= hypot(self.body.x - at[0], self.body.y - at[1])
            if self._left <= 0 or not self.body.moving:
                self.stop()
                self._gives_up, self._why = RECOVERY_S, NO_CONTROL
                return None
        return None if self.body.moving else (True, REACHED)
