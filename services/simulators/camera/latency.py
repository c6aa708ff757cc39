"""How long the camera takes for what it is asked. Pure but for its dice; who waits is the wire, real or virtual.

Numbers: 0.304 s median and 0.437 s worst of 30 on a sibling; the tail of the distribution is inferred.
"""

from __future__ import annotations

from random import Random

from services.simulators.camera.profiles import Profile

TAIL = (2.0, 3.0)  # times the usual


class Latency:
    """The delays of one camera; `seconds` may be changed while it runs, the rest goes with it."""

    def __init__(self, profile: Profile, seconds: float | None, rng: Random) -> None:
        self._profile, self._rng = profile, rng
        self.seconds = profile.latency_s if seconds is None else seconds

    @property
    def lag_s(self) -> float:
        """How old the pose is that a status tells."""
        lag = self._profile.status_lag_s
        return self.seconds if lag is None or not self.seconds else lag

    def control(self) -> float:
        """Of the next control request."""
        spread = min(self._profile.latency_spread_s, self.seconds)
        usual = self.seconds + self._rng.uniform(-spread, spread)
        return usual * self._rng.uniform(*TAIL) if self._rng.random() < self._profile.latency_tail else usual

    def snapshot(self) -> float:
        """Of the next snapshot; none where nothing takes time."""
        return self._profile.snapshot_s if self.seconds else 0.0
