"""What happens when in a simulation whose time may run faster than the clock.

Pure: `now` comes in, the actions that are due run in order. Not here: what the actions do.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable

Action = Callable[[float], None]  # is told its own time, in the simulation's seconds since 1970
LONGEST_GAP_S = 7 * 86400.0  # caught up step by step; more is a clock that was set, not time that went by
LONGEST_STEP_BACK_S = 60.0  # more is a clock that was set back


class Agenda:
    """Actions by their time. The simulation's time starts as the clock's and runs `speed` times as fast."""

    def __init__(self, speed: float = 1.0) -> None:
        self._speed = speed
        self._origin: float | None = None
        self._last = 0.0
        self._count = 0  # keeps actions of the same time in the order they were asked for
        self._waiting: list[tuple[float, int, Action]] = []

    def time(self, now: float) -> float:
        """The simulation's time at the clock's `now`; the first call sets where both are the same."""
        if self._origin is None:
            self._origin = self._last = now
        return self._origin + (now - self._origin) * self._speed

    def at(self, when: float, action: Action) -> None:
        """Asks for an action at a time of the simulation."""
        heapq.heappush(self._waiting, (when, self._count, action))
        self._count += 1

    def run(self, now: float) -> None:
        """Runs what is due, each action at its own time: how often this is called makes no difference to the result."""
        time = self.time(now)
        gap = time - self._last
        if not -LONGEST_STEP_BACK_S <= gap <= LONGEST_GAP_S:
            self._waiting = [(when + gap, count, action) for when, count, action in self._waiting]
        self._last = time
        while (
            self.due is not None and self.due <= now
        ):  # in the clock's time, as the runner asks, so that both round alike
            when, _, action = heapq.heappop(self._waiting)
            action(when)

    @property
    def due(self) -> float | None:
        """The clock's time of the next action; None when there is none."""
        if not self._waiting or self._origin is None:
            return None
        return self._origin + (self._waiting[0][0] - self._origin) / self._speed
