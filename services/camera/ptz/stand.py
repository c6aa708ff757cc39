"""Coming to rest, and motions by hand: plans that end with a camera that stands still.

Not here: moves to a place (`move.py`).
"""

from __future__ import annotations

from typing import cast

from services.camera.device import BadLogin, Direction, Locked, Reading, Refused, Reply, Start, Status, Stop, TurnFor
from services.camera.lanes import GAP_S, OVERRULES, same
from services.camera.plan import Plan, ask, attempt, wait
from services.camera.ptz.skill import Skill
from services.errors import DeviceError

LOST = 4  # readings after a stop that are unlike the one before: it is not slowing down, the stop had no effect
REFUSALS = 3
GRACE_S = 1.0  # a timed move ends so much later than our stop, which is to end it
LEAST_SHARE = 4  # of 100: less is ignored
TIMED = "Continuously"
LEAST_PAUSE_S, LONGEST_PAUSE_S = 0.05, 0.3  # between two tries of a stop
LOCKED_PAUSE_S = 60.0  # a camera that takes no login takes no stop either, and each try may lock the account


def settle(near: Reading | None = None, *, ours: bool = True) -> Plan[tuple[Reading, float]]:
    """Reads until two successive readings are equal and the camera does not say that it moves; the reading, the time.

    Firmware exists that never leaves `Moving`: some equal readings overrule it. A motion that goes on is ended again,
    unless it is not `ours` to end: Refused.
    """
    last, equal, unlike = near, 0, 0
    for _ in range(60):
        reply = yield from ask(Status())
        reading = cast(Reading, reply.result)
        equal = equal + 1 if last is not None and same(last, reading) else 0
        if equal >= OVERRULES or (equal >= 1 and reading.moving is not True):
            return reading, reply.received
        if last is not None and not equal:
            unlike += 1
            if unlike % LOST == 0:
                if not ours:
                    raise Refused("the camera is moving")
                yield from stop(reply.received, every=unlike > LOST)
        last = reading
        if reply.received - reply.sent < GAP_S:
            yield from wait(reply.sent + GAP_S)
    raise DeviceError("the camera does not come to rest")


def stop(now: float, *, every: bool = False) -> Plan[Reply]:
    """Sends a stop until it is confirmed, however long that takes.

    A camera that refuses stops (some do when nothing runs) is looked at instead: standing still is a confirmation.
    """
    pause, refusals = 2 * LEAST_PAUSE_S, 0
    while True:
        reply = yield from attempt(Stop(every=every))
        if reply.error is None:
            return reply
        refusals += isinstance(reply.error, Refused)
        if refusals >= REFUSALS and (yield from _stands()):
            return reply
        if isinstance(reply.error, BadLogin | Locked):
            yield from wait(reply.received + LOCKED_PAUSE_S)
        else:  # the stop is to arrive within 1 s of the network's return: time spent knocking in vain is pause enough
            yield from wait(max(reply.received + LEAST_PAUSE_S, reply.sent + pause))
        pause = min(2 * pause, LONGEST_PAUSE_S)


def _stands() -> Plan[bool]:
    try:
        yield from settle()
    except DeviceError:
        return False
    return True


def halt(now: float, *, every: bool = False) -> Plan[Reading]:
    """Stops, and makes sure that it stands."""
    while True:
        yield from stop(now, every=every)
        try:
            reading, _ = yield from settle()
            return reading
        except DeviceError:
            every = True


class Hold:
    """A motion by hand for some seconds from its confirmation; until it is `over` its end can be put off."""

    def __init__(self, direction: Direction, speed: int, seconds: float, skill: Skill | None = None) -> None:
        self.direction = direction
        self.skill = skill
        self.speed = speed
        self.seconds = seconds
        self.until: float | None = None
        self.over = False

    def prolong(self, seconds: float, now: float) -> None:
        """Lets it run for so long from now."""
        self.seconds = max(self.seconds, seconds)
        if self.until is not None:
            self.until = max(self.until, now + seconds)

    def plan(self) -> Plan[Reading]:
        """Starts, waits, stops, and returns where it came to rest.

        Where the firmware has timed moves they bound the motion too: it ends although no stop gets through any more.
        """
        now = (yield from self._start(self.seconds)).received
        self.until = now + self.seconds
        ends = self.until + GRACE_S
        while now < self.until:
            if self.until + GRACE_S > ends + 0.1:  # prolonged
                now = (yield from self._start(self.until - now)).received
                ends = self.until + GRACE_S
            if self.until - now > 1.0:
                now = (yield from ask(Status())).received
            now = yield from wait(min(self.until, now + 0.4))
        self.over = True
        yield from stop(now)
        reading, _ = yield from settle()
        return reading

    def _start(self, seconds: float) -> Plan[Reply]:
        timed = self._timed(seconds)
        if self.skill is not None and timed is not None:
            reply = yield from attempt(timed)
            if reply.error is None:
                self.skill.honours[TIMED] = "yes"
                return reply
            if not isinstance(reply.error, Refused):
                raise reply.error
            self.skill.honours[TIMED] = "no"
        if self.until is not None:  # it runs already, and only our stop ends it
            return (yield from ask(Status()))
        return (yield from ask(Start(self.direction, self.speed, self.speed)))

    def _timed(self, seconds: float) -> TurnFor | None:
        """The same as a timed move; None where the firmware has none."""
        if self.skill is None or self.skill.honours.get(TIMED, "unknown") not in ("unknown", "yes"):
            return None
        parts = []
        for way, pace in zip(self.direction.value, self.skill.paces, strict=True):
            speed = min(self.speed, len(pace.guess))
            share = 100 * pace.rate(speed) / pace.rate(len(pace.guess))
            parts.append(way * min(100, max(LEAST_SHARE, round(share))))
        return TurnFor(parts[0], parts[1], parts[2], round(seconds + GRACE_S, 1))
