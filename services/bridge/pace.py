"""Not faster than a rule allows: what comes too soon waits, the newest of each topic, and goes when it may. Pure."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from math import inf
from typing import Generic, TypeVar

T = TypeVar("T")


class Pace(Generic[T]):
    """Things by key (a rule and a topic), each at most `rate` times a second. Times are seconds of any one clock."""

    def __init__(self) -> None:
        self._last: dict[Hashable, float] = {}
        self._waiting: dict[Hashable, tuple[float, T]] = {}
        self.due = inf

    def take(self, key: Hashable, rate: float, thing: T, now: float) -> T | None:
        """The thing, when it may go now; None: it waits, and what waited before it is dropped."""
        free = self._last.get(key, -inf) + 1 / rate
        if now >= free:
            self._last[key] = now
            self._waiting.pop(key, None)
            return thing
        self._waiting[key] = (free, thing)
        self.due = min(self.due, free)
        return None

    def ready(self, now: float) -> Iterator[T]:
        """Those whose time has come."""
        if now < self.due:
            return
        for key in [key for key, (free, _) in self._waiting.items() if now >= free]:
            self._last[key] = now
            yield self._waiting.pop(key)[1]
        self.due = min((free for free, _ in self._waiting.values()), default=inf)
