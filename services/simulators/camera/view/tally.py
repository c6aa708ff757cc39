"""How many pictures were made, and how fast: so that a trial can tell whether the simulator kept its rate."""

from __future__ import annotations

import time
from collections import deque

LATELY_S = 2.0


class Tally:
    """Counts on the wall clock, whatever clock the camera itself goes by. `fps` may be asked from another thread."""

    def __init__(self) -> None:
        self.frames = 0
        self._lately: deque[float] = deque(maxlen=100)

    def note(self) -> None:
        """A picture was made."""
        self.frames += 1
        self._lately.append(time.monotonic())

    def fps(self) -> float:
        """Pictures a second in the last LATELY_S; 0 when there were none."""
        since = time.monotonic() - LATELY_S
        return round(sum(at >= since for at in self._lately.copy()) / LATELY_S, 1)
