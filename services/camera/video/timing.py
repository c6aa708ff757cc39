"""When a picture of a stream was exposed: from the stream's own times and when its packets arrived. Pure.

The camera's clock and ours have nothing in common but their pace. The packet that came fastest tells how they lie to
each other; every other one waited somewhere, and by how much is its lag. The constant part of the way cannot be seen
from here and is a setting.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

DRIFT = 200e-6  # of cheap quartz: the fastest packet so far says less and less
SETTLED_S = 2.0  # a camera may begin with old pictures: so long nothing is known of what is fast
JUMP_S = 10.0  # between two packets: not a pause but another time base
SMOOTH_S = 2.0  # of the lag that is told
GAPS = 16  # distances between pictures that tell how near the next one may be
LONGEST_GAP_S = 0.5  # between two pictures of a stream that runs
QUEUE_S = 0.7  # a lag that stays above this is a queue that grows
ADVICE = "the pictures arrive later and later: set the camera's bit rate below 2048 kb/s"


@dataclass(frozen=True)
class Exposure:
    """When a picture was taken, seconds since 1970, and by how much that may be wrong."""

    at: float
    uncertainty: float

    def after(self, moment: float) -> bool:
        """Whether the picture is surely from after that moment (the end of a move); if in doubt it is not."""
        return self.at - self.uncertainty > moment


class Held:
    """How long FFmpeg has held a picture when it hands it on, which it does when the next one begins.

    How far away that one is is not known yet. It is taken to be as near as the nearest of late: a picture that seemed
    to have come before it did would be the fastest one, and all others late.
    """

    def __init__(self) -> None:
        self._last: float | None = None
        self._gaps: deque[float] = deque(maxlen=GAPS)

    def take(self, stream_s: float | None) -> float:
        """Seconds that the picture with that time in the stream was held; 0 where nothing tells."""
        before, self._last = self._last, stream_s
        if stream_s is None or before is None:
            return 0.0
        self._gaps.append(min(max(0.0, stream_s - before), LONGEST_GAP_S))
        return min(self._gaps)


class StreamClock:
    """One connection's relation of stream time to ours. `latency_s`, `unsure_s`: the way's constant part."""

    def __init__(self, latency_s: float, unsure_s: float) -> None:
        self.latency_s = latency_s
        self.unsure_s = unsure_s
        self.lag = 0.0  # smoothed, seconds
        self._fastest: float | None = None
        self._last = (0.0, 0.0)
        self._began = 0.0

    def take(self, stream_s: float, arrived: float) -> Exposure:
        """The exposure of the picture with that time in the stream, which arrived then."""
        gap, passed = stream_s - self._last[0], arrived - self._last[1]
        if self._fastest is None or not 0 <= gap < JUMP_S:
            self._begin(stream_s, arrived)
            gap = passed = 0.0
        self._last = (stream_s, arrived)
        offset = arrived - stream_s
        assert self._fastest is not None
        self._fastest = min(offset, self._fastest + DRIFT * max(0.0, passed))
        late = offset - self._fastest
        self.lag += (late - self.lag) * min(1.0, gap / SMOOTH_S)
        at = arrived - late - self.latency_s
        return Exposure(at, self.unsure_s + self._doubt(arrived))

    @property
    def latency(self) -> float:
        """From light to arrival now, seconds."""
        return self.latency_s + self.lag

    @property
    def queueing(self) -> bool:
        """Whether more is sent than the way can carry."""
        return self.lag > QUEUE_S

    def _begin(self, stream_s: float, arrived: float) -> None:
        self._fastest, self.lag, self._began = arrived - stream_s, 0.0, arrived

    def _doubt(self, arrived: float) -> float:
        return max(0.0, SETTLED_S - (arrived - self._began))
