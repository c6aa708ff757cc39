"""The camera's moving picture in virtual time: frames at the stream's rate, each as late as over the real wire.

Whether two show the same pose is taken from the motors, since drawing every frame would take more than it tells; only
those that a scan wants are drawn. What real pictures and threads do is in `camera/scan/live.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import floor

from services.camera.device import StreamAddress
from services.camera.scan.footage import Footage, Glimpse, Visit
from services.camera.video import pictures
from services.camera.video.likeness import Likeness
from services.camera.video.newest import Frame, Upright
from services.camera.video.timing import Exposure
from services.simulators.camera.motors import Pose
from services.simulators.camera.program import Inside

LATENCY_S, UNSURE_S = 0.8, 0.4
OPENS_S = 1.0  # from asking for the stream to its first picture
SAME_DEG = 0.03  # less than a pixel
LIGHT = 140.0  # grey levels of a picture that is exposed well
FINE = 95
STALE_S = 4.0


class Film:
    """A Moving (`camera/scan/source.py`). `off_s`: how much later pictures are than the scan is told to expect.

    `frozen`: a moment from which on no pictures come.
    """

    def __init__(self, inside: Inside, clock: Callable[[], float], off_s: float = 0.0) -> None:
        self.inside, self.clock, self.off_s = inside, clock, off_s
        self.latency = LATENCY_S
        self.footage = Footage()
        self.frozen: float | None = None
        self.drawn = 0
        self._next: float | None = None
        self._came = 0.0
        self._before: tuple[Pose, float] | None = None
        self._done: list[tuple[Visit, float, bytes]] = []

    def begin(self, found: StreamAddress | None) -> None:
        """As in the contract."""
        self.footage.begin()
        self._before, self._done, self._came = None, [], 0.0
        self._next = self._grid(self.clock() + OPENS_S) if found is not None else None

    def close(self) -> None:
        """As in the contract."""
        self._next = None

    def flows(self, now: float) -> bool:
        """As in the contract."""
        self._run(now)
        return self._next is not None and now - self._came < STALE_S

    def collect(self) -> list[tuple[Visit, float, bytes]]:
        """As in the contract."""
        self._run(self.clock())
        done, self._done = self._done, []
        return done

    def pending(self, now: float) -> bool:
        """As in the contract."""
        return bool(self._done or self.footage.pending(now, self.latency))

    def _run(self, now: float) -> None:
        """Everything that has arrived by now."""
        while self._next is not None and self._next + LATENCY_S + self.off_s <= now:
            at, self._next = self._next, self._grid(self._next + 1.5 / self._fps)
            if (self.frozen is None or at < self.frozen) and not self.inside.device.booting(at):
                self._came = at + LATENCY_S + self.off_s
                self._arrive(at)

    def _arrive(self, at: float) -> None:
        pose, rates = self.inside.device.motion(at)
        light = LIGHT * self.inside.pictures.light(at)
        like: Likeness = "moved" if self._before is None or any(rates[:2]) or _turned(pose, self._before[0]) else "same"
        step = 0.0 if self._before is None else light - self._before[1]
        self._before = pose, light
        exposure = Exposure(at + self.off_s, UNSURE_S)
        frame = Frame(0, lambda: self.inside.pictures.frame("MainFormat", at), exposure, self._came, Upright())
        for visit, wanted in self.footage.take(Glimpse(frame, like, step)):
            self.drawn += 1
            self._done.append((visit, self.footage.at(wanted), pictures.encode(wanted.develop(), FINE)))

    @property
    def _fps(self) -> int:
        return self.inside.pictures.fps("MainFormat")

    def _grid(self, at: float) -> float:
        """The camera exposes at times of its own."""
        return floor(at * self._fps) / self._fps + 0.31 / self._fps


def _turned(one: Pose, other: Pose) -> bool:
    return max(abs((one.pan - other.pan + 180) % 360 - 180), abs(one.tilt - other.tilt)) > SAME_DEG
