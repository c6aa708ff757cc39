"""How an axis that the firmware drives gets to its goal: from any speed, at most at its top speed, to rest. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
        """When no more than that is left of its way; not before it has turned round, where it does."""
        when, nearer = self.ends, 0.0
        for seconds, begins, change in reversed(self._pieces()[-3:]):  # what comes before is the way out
            speed, change = abs(begins + change * seconds), copysign(change, begins * change) if begins else abs(change)
            way = speed * seconds - change * seconds * seconds / 2
            if nearer + way >= left:
                root = sqrt(max(0.0, speed * speed - 2 * change * (left - nearer)))
                return when - 2 * (left - nearer) / (speed + root) if speed + root else when
            when, nearer = when - seconds, nearer + way
        return when

    @property
    def brakes(self) -> float:
        """When it begins to slow down for its goal."""
        pieces = self._pieces()
        return self.began + sum(seconds for seconds, _, _ in pieces[:-1]) if len(pieces) >= 3 else self.began

    @property
    def back(self) -> Glide:
        """The part of it from where it turns round, and rests; all of it where it began at rest. No other has one."""
        seconds, slows = abs(self.speed) / self.acceleration, self.speed * abs(self.speed) / (2 * self.acceleration)
        began, answered = self.began + seconds, self.answered + seconds
        return replace(self, began=began, place=self.place + slows, speed=0.0, answered=answered)

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
