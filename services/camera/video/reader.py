"""The thread that holds the one connection to the camera's moving picture, while it is switched on.

It waits while it is off, opens again after a fault with growing pauses, and leaves the newest picture in the slot.
Where RTSP fails it tries the camera's MJPEG, if that is allowed, and goes back to RTSP after a while.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Condition, Thread

from services.camera.device import BadLogin
from services.camera.video.newest import Newest
from services.camera.video.session import Arrival, Session
from services.camera.video.timing import Exposure, StreamClock
from services.errors import DeviceError

FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 10.0
MARGIN_S = 0.5  # so that the gate is open when it is asked again
PATIENCE = 2  # failures of the best way before another one is tried
BETTER_S = 300.0  # so long a worse way is used before the best one is tried again
HOPELESS_S = 5.0  # a lag that a new connection takes away
SET_S = 0.1  # by so much our clock was set (ntpd: from 0.128 s on); slewed, the steady one goes along
RATE_S = 2.0  # frame rate and bit rate are of so long
END_S = 1.0  # a thread that waits for the camera ends within its read timeout; nobody else waits so long

Opener = Callable[[], Session]
log = logging.getLogger(__name__)


@dataclass
class Flow:
    """What is known of the picture's way here; written by the reader's thread, read by others as it is."""

    name: str = ""  # of the way: rtsp or mjpeg; empty while there is none
    trouble: str = ""
    failures: int = 0  # in a row
    connections: int = 0
    broken: int = 0
    last: float = 0.0  # when the newest picture arrived
    latency: float = 0.0
    queueing: bool = False
    recent: deque[tuple[float, int]] = field(default_factory=lambda: deque(maxlen=256))  # arrival, bytes

    def rates(self, now: float) -> tuple[float, float]:
        """Pictures per second and kilobits per second."""
        recent = [size for at, size in list(self.recent) if now - at <= RATE_S]
        return len(recent) / RATE_S, sum(recent) * 8 / 1000 / RATE_S


class Reader:
    """`switch` it on and off; `flow` tells how it goes. `latency`: of the way and how sure that is, seconds."""

    def __init__(
        self,
        name: str,
        newest: Newest,
        latency: tuple[float, float],
        login_retry_s: float = 120.0,
        clock: Callable[[], float] = time.time,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name = name
        self.newest = newest
        self.latency = latency
        self.login_retry_s = login_retry_s
        self.clock = clock
        self.steady = steady  # nobody sets this one
        self.flow = Flow()
        self._ways: tuple[Opener, ...] = ()
        self._closing = False
        self._changed = Condition()
        self._thread: Thread | None = None

    def switch(self, ways: tuple[Opener, ...]) -> None:
        """On with these ways to the picture, the best one first; off with none. Returns at once."""
        with self._changed:
            self._ways = ways
            self._changed.notify_all()
            if ways and self._thread is None:
                self._thread = Thread(target=self._run, name="camera video", daemon=True)
                self._thread.start()

    @property
    def on(self) -> bool:
        """Whether it is switched on."""
        return bool(self._ways)

    def close(self) -> None:
        """Ends the thread; at most `END_S` is waited for one that waits for the camera."""
        with self._changed:
            self._closing, self._ways = True, ()
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join(END_S)

    def _run(self) -> None:
        while (ways := self._wait_until_on()) is not None:
            way = ways[0 if self.flow.failures < PATIENCE else self.flow.failures % len(ways)]
            try:
                self._read(way, ways)
            except DeviceError as error:
                self._failed(error)
                self._pause(error)

    def _wait_until_on(self) -> tuple[Opener, ...] | None:
        with self._changed:
            if not self._ways:
                self.flow = Flow(connections=self.flow.connections, broken=self.flow.broken)
            self._changed.wait_for(lambda: self._closing or self._ways)
            return None if self._closing else self._ways

    def _read(self, way: Opener, ways: tuple[Opener, ...]) -> None:
        session = way()
        relation, ahead = StreamClock(*self.latency), self._ahead()
        began = self.steady()
        self.flow.connections += 1
        try:
            while self._ways is ways and relation.lag < HOPELESS_S:
                arrival = session.read(decode=self.newest.wanted)
                set_s = self._ahead() - ahead
                if abs(set_s) > SET_S:  # perhaps after this picture was given its time
                    log.info("%s: our clock was set by %+.1f s", self.name, set_s)
                    relation, ahead = StreamClock(*self.latency), ahead + set_s
                    continue
                self._take(arrival, relation)
                self._is_there(session.name)
                if way is not ways[0] and self.steady() - began > BETTER_S:
                    return
        finally:
            session.close()

    def _ahead(self) -> float:
        """How far our clock is before the steady one. Whoever is held up between two looks sees less: seldom twice."""
        return max(self.clock() - self.steady() for _ in range(2))

    def _take(self, arrival: Arrival, relation: StreamClock) -> None:
        flow = self.flow
        flow.last = arrival.arrived
        flow.recent.append((arrival.arrived, arrival.size))
        if arrival.stream_s is None:
            exposure = Exposure(arrival.arrived - relation.latency_s, relation.unsure_s + LONGEST_PAUSE_S)
        else:
            exposure = relation.take(arrival.stream_s, arrival.arrived)
        flow.latency, flow.queueing = relation.latency, relation.queueing
        flow.broken += arrival.broken
        if arrival.develop is not None:
            self.newest.put(arrival.develop, exposure, arrival.arrived, arrival.jpeg)

    def _is_there(self, way: str) -> None:
        if self.flow.name != way or self.flow.trouble:
            log.info("%s: the picture comes by %s", self.name, way)
        self.flow.name, self.flow.trouble, self.flow.failures = way, "", 0

    def _failed(self, error: DeviceError) -> None:
        if not self.flow.trouble:
            log.warning("%s: no moving picture: %s", self.name, error)
        self.flow.failures += 1
        self.flow.name, self.flow.trouble, self.flow.queueing = "", str(error), False

    def _pause(self, error: DeviceError) -> None:
        pause = min(LONGEST_PAUSE_S, FIRST_PAUSE_S * 2 ** min(self.flow.failures - 1, 10))
        if isinstance(error, BadLogin):  # the gate decides who may try when; asking it while it is closed costs nothing
            pause = min(error.again_s or self.login_retry_s, self.login_retry_s) + MARGIN_S
        with self._changed:
            before = self._ways
            self._changed.wait_for(lambda: self._closing or self._ways is not before, pause)
