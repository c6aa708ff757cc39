"""The camera's own clock: it is set, it runs too fast or too slow, and tells local time. Pure; true time comes in."""

from __future__ import annotations

import time

FORM = "%Y-%m-%d %H:%M:%S"


class Clock:
    """`drift_ppm` may be changed; from then on the clock gains so many microseconds a second (negative: loses)."""

    def __init__(self, now: float) -> None:
        self._since, self._offset, self._ppm = now, 0.0, 0.0

    def offset(self, now: float) -> float:
        """How far it is ahead, seconds."""
        return self._offset + (now - self._since) * self._ppm * 1e-6

    def set_off(self, now: float, offset_s: float, drift_ppm: float) -> None:
        """Makes it wrong by so much, and from now on by more and more."""
        self._since, self._offset, self._ppm = now, offset_s, drift_ppm

    def tell(self, now: float) -> str:
        """What it shows."""
        return time.strftime(FORM, time.localtime(now + self.offset(now)))

    def put(self, text: str, now: float) -> bool:
        """Sets it to a local time; False when the text is none and it goes on as before."""
        try:
            wanted = time.mktime(time.strptime(text, FORM))
        except (ValueError, OverflowError):
            return False
        self.set_off(now, wanted - now, self._ppm)
        return True
