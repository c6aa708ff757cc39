"""How an axis that the firmware drives gets to its goal: from any speed, at most at its top speed, to rest. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, sqrt


@dataclass(frozen=True)
class Glide:
    """From a place and a speed at `began` to rest at `goal`; top speed in degrees/s, acceleration in degrees/s^2.

    An axis that is too fast for its goal, or goes the other way, first comes to rest and then returns.
    """

    began: float
    place: float
    speed: float
    goal: float
    top: float
    acceleration: float
    answered: float  # when it was known

    def at(self, when: float) -> tuple[float, float]:
        """Its place and its speed at a time."""
        place, left = self.place, max(0.0, when - self.began)
        for seconds, speed, change in self._pieces():
            part = min(left, seconds)
            left -= part
            place += speed * part + change * part * part / 2
            if not left and part < seconds:
                return place, speed + change * part
        return self.goal, 0.0

    @property
    def ends(self) -> float:
        """When it rests."""
        return self.began + sum(seconds for seconds, _, _ in self._pieces())

    def within(self, left: float) -> float:
        """When no more than that is left of its way; not before it slows down for its goal."""
        return max(self.brakes, self.ends - sqrt(2 * left / self.acceleration))

    def nears(self, left: float) -> float:
        """The same at whatever speed it is then; not before it is as fast as it gets."""
        *_, (seconds, top, _), (slows, _, _) = [(0.0, 0.0, 0.0)] * 2 + self._pieces()
        faster = left - abs(top) * slows / 2
        return self.brakes - min(seconds, faster / abs(top)) if faster > 0 and top else self.within(left)

    @property
    def brakes(self) -> float:
        """When it begins to slow down for its goal."""
        pieces = self._pieces()
        return self.began + sum(seconds for seconds, _, _ in pieces[:-1]) if len(pieces) == 3 else self.began

    def _pieces(self) -> list[tuple[float, float, float]]:
        """Seconds, the speed they begin with, and its change."""
        pieces, place, speed = [], self.place, self.speed
        slows = speed * speed / (2 * self.acceleration)
        if speed * (self.goal - place) < 0 or slows > abs(self.goal - place):
            pieces.append((abs(speed) / self.acceleration, speed, -copysign(self.acceleration, speed)))
            place, speed = place + copysign(slows, speed), 0.0
        way, first = self.goal - place, abs(speed)
        top = max(first, min(self.top, sqrt(self.acceleration * abs(way) + first * first / 2)))
        if not top:
            return pieces
        sloped = (2 * top * top - first * first) / (2 * self.acceleration)
        change, fast = copysign(self.acceleration, way), copysign(top, way)
        pieces.append(((top - first) / self.acceleration, speed, change))
        pieces.append((max(0.0, abs(way) - sloped) / top, fast, 0.0))
        pieces.append((top / self.acceleration, fast, -change))
        return pieces
