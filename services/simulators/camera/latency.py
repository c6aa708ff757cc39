"""How long the camera takes for what it is asked. Pure but for its dice; who waits is the wire, real or virtual.

Numbers: 0.304 s median and 0.437 s worst of 30 on a sibling; the tail of the distribution is inferred.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from services.simulators.camera.profiles import Profile

TAIL = (2.0, 3.0)  # times the usual
DROWSY_S = 2.0  # more for each request just after it has booted


class Latency:
    """The delays of one camera. `seconds` may be changed while it runs, `slow_s` comes on top of it.

    `viewers` tells how many watch a stream of more than 2048 kb/s; until `drowsy_until` it is waking up.
    """

    def __init__(self, profile: Profile, seconds: float | None, rng: Random) -> None:
        self._profile, self._rng = profile, rng
        self.seconds = profile.latency_s if seconds is None else seconds
        self.slow_s = 0.0
        self.drowsy_until = float("-inf")
        self.viewers: Callable[[], int] = lambda: 0

    @property
    def lag_s(self) -> float:
        """How old the pose is that a status tells."""
        lag = self._profile.status_lag_s
        return self.seconds if lag is None or not self.seconds else lag

    def control(self, now: float) -> float:
        """Of the next control request."""
        if not self.seconds:
            return self.slow_s
        spread = min(self._profile.latency_spread_s, self.seconds)
        usual = self.seconds + self._rng.uniform(-spread, spread)
        usual *= self._rng.uniform(*TAIL) if self._rng.random() < self._profile.latency_tail else 1.0
        busy = self._profile.stream_slowdown_s * self.viewers()
        return usual + busy + self.slow_s + (DROWSY_S if now < self.drowsy_until else 0.0)

    def snapshot(self) -> float:
        """Of the next snapshot; none where nothing takes time."""
        return (self._profile.snapshot_s if self.seconds else 0.0) + self.slow_s
