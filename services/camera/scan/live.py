"""The camera's large stream during a scan: each picture is compared with the one before, those wanted become JPEGs.

The stream that others see is taken where it is that one; otherwise one of our own is opened, and closed at the end.
What is wanted is decided in `footage.py`. Nothing here runs on the service's own thread but taking out what is done.
"""

from __future__ import annotations

import logging
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack

from services.camera.device import Away, StreamAddress
from services.camera.scan.footage import Footage, Glimpse, Visit
from services.camera.video import pictures
from services.camera.video.channel import Channel
from services.camera.video.likeness import Thumb, likeness, thumb
from services.camera.video.newest import Frame, Newest
from services.camera.video.reader import Reader
from services.camera.video.settings import LATENCIES_S

SAME_SHAPE = 0.01  # of the aspect; the lens refuses more
FINE = 95  # quality: the frame has been through one encoder already
WAITING = 24  # pictures that nobody took out yet; what comes then is not looked at
STALE_S = 4.0  # without a picture for so long, the stream stands still; a busy machine pauses for two or three

log = logging.getLogger(__name__)


class Live:
    """One camera's. `aspect`: width by height of the calibrated picture, None: any."""

    def __init__(self, channel: Channel, aspect: float | None) -> None:
        self.channel = channel
        self.aspect = aspect
        self.footage = Footage()
        self.unfit = False
        self._newest: Newest | None = None
        self._came: deque[Glimpse] = deque()
        self._developing: deque[tuple[Visit, float, Future[bytes]]] = deque()
        self._before: Thumb | None = None
        self._arrived = 0.0
        self._open = ExitStack()
        self._darkroom: ThreadPoolExecutor | None = None

    def begin(self, found: StreamAddress | None) -> None:
        """From now on pictures are taken, when some come. `found`: where the camera's large stream is."""
        self.close()
        self.footage.begin()
        self.unfit, self._before, self._arrived = False, None, 0.0
        self._darkroom = ThreadPoolExecutor(1, "scan pictures")
        self._open.callback(self._darkroom.shutdown, wait=False, cancel_futures=True)
        own = not (self.channel.timed and self.channel.settings.source == "main")
        self._newest = self._own(found) if own else self.channel.newest
        self._open.enter_context(self._newest.watched())
        self._open.enter_context(self._newest.tapped(self._see))

    def close(self) -> None:
        """Ends a stream of our own, and forgets what has come."""
        self._open.close()
        self._newest = self._darkroom = None
        self._came, self._developing = deque(), deque()  # the darkroom may still be at one of the old ones

    @property
    def latency(self) -> float:
        """From light to arrival, about, seconds."""
        return self._latency[0]

    def flows(self, now: float) -> bool:
        """Whether fit pictures come."""
        return not self.unfit and now - self._arrived < STALE_S

    def collect(self) -> list[tuple[Visit, float, bytes]]:
        """The pictures that are done: whose visit, when exposed, JPEG as the camera delivered it."""
        while self._came:
            for visit, frame in self.footage.take(self._came.popleft()):
                if self._darkroom is not None:
                    future = self._darkroom.submit(_developed, frame)
                    self._developing.append((visit, self.footage.at(frame), future))
        done = []
        while self._developing and self._developing[0][2].done():
            visit, at, future = self._developing.popleft()
            try:
                done.append((visit, at, future.result()))
            except Away:
                visit.got -= 1
        return done

    def pending(self, now: float) -> bool:
        """Whether more of them may come, or are in the darkroom."""
        return bool(self._developing or self.footage.pending(now, self.latency))

    @property
    def _latency(self) -> tuple[float, float]:
        settings = self.channel.settings
        return settings.latency if settings.source == "main" else LATENCIES_S["main"]

    def _own(self, found: StreamAddress | None) -> Newest:
        newest = Newest(self.channel.newest.upright, self.channel.clock)
        reader = Reader(f"{self.channel.camera} (scan)", newest, self._latency, clock=self.channel.clock)
        self._open.callback(reader.close)
        self._open.callback(newest.close)
        if found is not None:
            reader.switch(self.channel.ways(found))
        return newest

    def _see(self, frame: Frame) -> None:
        """On the thread that reads: one more picture, compared with the last one that was looked at."""
        if len(self._came) >= WAITING:
            self._arrived = frame.arrived
            return
        try:
            image = frame.develop()
        except Away:
            return
        if not self._fits(image):
            return
        seen, before = thumb(image), self._before
        like = likeness(before, seen) if before is not None else "moved"
        self._before, self._arrived = seen, frame.arrived
        self._came.append(Glimpse(frame, like, seen.light - before.light if before is not None else 0.0))

    def _fits(self, image: pictures.Image) -> bool:
        aspect = image.shape[1] / image.shape[0]
        unfit = self.aspect is not None and abs(aspect / self.aspect - 1) > SAME_SHAPE
        if unfit and not self.unfit:
            size = f"{image.shape[1]}x{image.shape[0]}"
            log.warning("the stream's picture of %s has another shape than the calibrated one: snapshots instead", size)
        self.unfit = unfit
        return not unfit


def _developed(frame: Frame) -> bytes:
    """On the darkroom's thread."""
    return pictures.encode(frame.develop(), FINE)
