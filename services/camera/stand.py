"""Coming to rest, and motions by hand: plans that end with a camera that stands still.

Not here: moves to a place (`move.py`).
"""

from __future__ import annotations

from typing import cast

from services.camera.device import same
from services.camera.plan import Plan, ask, attempt, wait
from services.camera.requests import Direction, Reading, Reply, Start, Status, Stop
from services.errors import DeviceError

GAP_S = 0.25  # between two readings that are compared: the slowest speed shows in that time


def settle(near: Reading | None = None) -> Plan[tuple[Reading, float]]:
    """Reads until two successive readings are equal and the camera does not say that it moves; the reading, the time.

    Firmware exists that never leaves `Moving`: four equal readings overrule it.
    """
    last, equal = near, 0
    for _ in range(60):
        reply = yield from ask(Status())
        reading = cast(Reading, reply.result)
        equal = equal + 1 if last is not None and same(last, reading) else 0
        if equal >= 4 or (equal >= 1 and reading.moving is not True):
            return reading, reply.received
        last = reading
        if reply.received - reply.sent < GAP_S:
            yield from wait(reply.sent + GAP_S)
    raise DeviceError("the camera does not come to rest")


def stop(now: float, *, every: bool = False) -> Plan[Reply]:
    """Sends a stop until it is confirmed, however long that takes."""
    pause = 0.1
    while True:
        reply = yield from attempt(Stop(every=every))
        if reply.error is None:
            return reply
        yield from wait(reply.received + pause)
        pause = min(2 * pause, 0.5)


def halt(now: float) -> Plan[Reading]:
    """Stops, and makes sure that it stands."""
    every = False
    while True:
        yield from stop(now, every=every)
        try:
            reading, _ = yield from settle()
            return reading
        except DeviceError:
            every = True


class Hold:
    """A motion by hand: until a time that can be put off while it runs."""

    def __init__(self, direction: Direction, speed: int, until: float) -> None:
        self.direction = direction
        self.speed = speed
        self.until = until

    def plan(self) -> Plan[Reading]:
        """Starts, waits, stops, and returns where it came to rest."""
        reply = yield from ask(Start(self.direction, self.speed, self.speed))
        now = reply.received
        while now < self.until:
            if self.until - now > 1.0:
                now = (yield from ask(Status())).received
            now = yield from wait(min(self.until, now + 0.4))
        yield from stop(now)
        reading, _ = yield from settle()
        return reading
