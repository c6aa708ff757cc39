"""The firmware's motion detection: when it sees something move, and when it says that it is over. Pure.

It compares pictures, so that it takes the turning of its own motors for motion, and a change of the picture's mode or
a lens that is covered too. The picture itself is not looked at here: what changes it is known.
"""

from __future__ import annotations

from typing import Literal

from services.simulators.camera.config_tables import Tables

AFTER_S = 1.0  # the picture settles so long after a turn or a change

Change = Literal["Start", "Stop"]


class MotionDetector:
    """One channel's. `stir` and `update` take the same clock."""

    def __init__(self, tables: Tables) -> None:
        self._tables = tables
        self._stirs_until = self._seen = float("-inf")
        self._looks = tables.looks
        self.on = False

    def stir(self, until: float) -> None:
        """Something moves before the lens until then."""
        self._stirs_until = max(self._stirs_until, until)

    def forget(self) -> None:
        """Power off."""
        self.on, self._stirs_until, self._seen = False, float("-inf"), float("-inf")

    def update(self, now: float, *, turning: bool) -> Change | None:
        """What it says at this moment."""
        if turning or self._tables.looks != self._looks:
            self.stir(now + AFTER_S)
        self._looks = self._tables.looks
        if not self._tables.flag("MotionDetect[0].Enable"):
            return self._say(False)
        if now <= self._stirs_until:
            self._seen = now
            return self._say(True)
        held = now - self._seen < self._tables.number("MotionDetect[0].EventHandler.Dejitter")
        return self._say(self.on and held)

    def _say(self, on: bool) -> Change | None:
        was, self.on = self.on, on
        return None if was == on else ("Start" if on else "Stop")
