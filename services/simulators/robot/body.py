"""How the robot moves: it turns on the spot towards the next point of its way, then drives there, at finite speeds."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2, cos, degrees, hypot, radians, sin

from services.apartment.floor import XY

SPEED = 0.45  # m/s, of a careful robot in a flat
TURN = 60.0  # degrees per second
NEAR_M, NEAR_DEG = 0.005, 0.5


@dataclass
class Body:
    """Where it is (metres, degrees, map frame) and where it is going; `heading` is wanted at the end of the way."""

    x: float
    y: float
    yaw_deg: float
    way: list[XY] = field(default_factory=list)
    heading: float | None = None

    @property
    def moving(self) -> bool:
        """Whether there is some way left."""
        return bool(self.way) or self.heading is not None

    def set_out(self, way: list[XY], heading: float | None) -> None:
        """Begins a new way; the old one is forgotten."""
        self.way, self.heading = list(way), heading

    def stop(self) -> None:
        """Stands where it is."""
        self.way, self.heading = [], None

    def advance(self, seconds: float) -> None:
        """Lets time pass."""
        while seconds > 1e-9 and self.moving:
            seconds = self._step(seconds)

    def _step(self, seconds: float) -> float:
        """One straight piece or one turn; the seconds that are left."""
        while self.way and hypot(self.way[0][0] - self.x, self.way[0][1] - self.y) < NEAR_M:
            self.way.pop(0)
        if not self.way:
            return self._turn(self.heading, seconds) if self.heading is not None else 0.0
        dx, dy = self.way[0][0] - self.x, self.way[0][1] - self.y
        if abs(_turn_to(self.yaw_deg, degrees(atan2(dy, dx)))) > NEAR_DEG:
            return self._turn(degrees(atan2(dy, dx)), seconds)
        far = min(hypot(dx, dy), SPEED * seconds)
        self.x += far * cos(radians(self.yaw_deg))
        self.y += far * sin(radians(self.yaw_deg))
        if far >= hypot(dx, dy) - 1e-9:
            self.x, self.y = self.way.pop(0)
        return seconds - far / SPEED

    def _turn(self, to: float, seconds: float) -> float:
        left = _turn_to(self.yaw_deg, to)
        turned = max(-TURN * seconds, min(TURN * seconds, left))
        self.yaw_deg = (self.yaw_deg + turned + 180) % 360 - 180
        if not self.way and abs(left - turned) <= 1e-9:
            self.heading = None
        elif abs(left - turned) <= 1e-9:
            self.yaw_deg = to
        return seconds - max(abs(turned) / TURN, 1e-9)


def _turn_to(one: float, other: float) -> float:
    return (other - one + 180) % 360 - 180
