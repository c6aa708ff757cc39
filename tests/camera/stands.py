"""Where the time of a scan went: a thread asks the simulated camera whether it turns, and keeps from when to when."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from statistics import median

from tests.small_flat import Door

LOOK_S = 0.05


@dataclass
class Stands:
    """How long it stood, each time in turn, and how long it turned in all, seconds."""

    stood: list[float] = field(default_factory=lambda: [0.0])
    turned: float = 0.0

    def add(self, seconds: float, *, moving: bool) -> None:
        """So much later it was seen to turn, or to stand."""
        if moving:
            self.turned += seconds
            if self.stood[-1]:
                self.stood.append(0.0)
        else:
            self.stood[-1] += seconds

    def __str__(self) -> str:
        """For people."""
        if len(self.stood) < 3:
            return f"turned {self.turned:.1f}"
        first, *places, last = self.stood
        stood = f"stood {median(places):.2f} a place, {max(places):.1f} at the switch"
        return f"turned {self.turned:.1f}; {stood}; {first:.1f} before, {last:.1f} after"


@contextmanager
def looked_at(door: Door) -> Iterator[Stands]:
    """Until the end of the block."""
    stands, over = Stands(), threading.Event()

    def look() -> None:
        then = time.monotonic()
        while not over.wait(LOOK_S):
            moving, now = door.moving, time.monotonic()
            stands.add(now - then, moving=moving)
            then = now

    thread = threading.Thread(target=look, name="stands")
    thread.start()
    try:
        yield stands
    finally:
        over.set()
        thread.join()
