"""Motions that follow one another by themselves: a tour through presets, a scan between two limits. Pure.

The motors know when they will come to rest, so what follows is begun at its time whenever somebody looks next. A
round ends when the motors were told something else.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from services.simulators.camera.motors import Motors, Pose

TOUR_DWELL_S = 10.0  # at each preset
SCAN_LEVEL = 3


@dataclass(frozen=True)
class Round:
    """Where to go one after the other, over and over; with which speed, and how long to stay."""

    code: str
    stops: tuple[Pose, ...]
    level: int = 8
    dwell_s: float = TOUR_DWELL_S


class Rounds:
    """At most one round."""

    def __init__(self, motors: Motors) -> None:
        self._motors = motors
        self._round = Round("", ())
        self._next, self._due = 0, inf

    def begin(self, stops: Round, now: float) -> None:
        """Sets out for the first place."""
        self._round, self._next = stops, 0
        self._set_out(now)

    def advance(self, now: float) -> None:
        """Begins what was due by now."""
        while self._due <= now and self._motors.code == self._round.code:
            self._set_out(self._due)

    def _set_out(self, now: float) -> None:
        stop = self._round.stops[self._next % len(self._round.stops)]
        self._motors.go(stop, now, self._round.code, self._round.level)
        self._next += 1
        self._due = max(self._motors.rests_at, now + 1.0) + self._round.dwell_s
