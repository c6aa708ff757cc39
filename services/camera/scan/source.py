"""Where the frames of a scan come from, as plans: out of the moving picture while it flows, otherwise snapshots.

Which picture of the stream is whose is decided in `footage.py`; the thread that brings them is in `live.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar, cast

from services.camera.device import (
    FindStream,
    GotoPreset,
    MoveOver,
    MoveTo,
    Reading,
    Reply,
    Request,
    Snapshot,
    Start,
    Status,
    Stop,
    StreamAddress,
)
from services.camera.lanes import same
from services.camera.plan import Plan, ask, attempt, wait
from services.camera.ptz.course import PAN
from services.camera.ptz.skill import Skill
from services.camera.scan.footage import Footage, Visit

TRIES = 3  # of a snapshot: the camera sometimes closes without an answer
SETTLE_S = 0.6  # from rest to the first snapshot: the picture's own delay
OPENS_S = 6.0  # so long the first visit waits for the stream
LOOK_S = 0.05  # between two looks whether pictures have come
SURELY = 0.9  # of the quickest answer: no command turns the camera sooner after it was sent
RECKONED_S = 0.8  # a motion that was reckoned to end so much before it was read to rest has done so
STOPS_S = 0.2  # after the stop of a zoom, until it stands
T = TypeVar("T")
TURNS = Start | GotoPreset | MoveTo | MoveOver


@dataclass(eq=False)
class Spot(Visit):
    """A visit of a scan: which place, what was read there, and in which mode the picture was."""

    place: str = ""
    reading: Reading = field(default_factory=lambda: Reading(0.0, 0.0, 0.0))
    mode: str = ""


class Moving(Protocol):
    """The camera's large stream, as a scan uses it; `live.py`, or another one in virtual time."""

    footage: Footage

    @property
    def latency(self) -> float:
        """From light to arrival, about, seconds."""
        ...

    def begin(self, found: StreamAddress | None) -> None:
        """From now on pictures are taken, when some come."""
        ...

    def close(self) -> None:
        """No more of them."""
        ...

    def flows(self, now: float) -> bool:
        """Whether pictures come."""
        ...

    def collect(self) -> list[tuple[Visit, float, bytes]]:
        """The pictures that are done: whose visit, when exposed, JPEG."""
        ...

    def pending(self, now: float) -> bool:
        """Whether more of them may come."""
        ...


class Source:
    """The frames of one scan. `stream` None: snapshots only; `settle_s` None: as long as it takes."""

    def __init__(self, stream: Moving | None, skill: Skill, settle_s: float | None) -> None:
        self.stream = stream
        self.skill = skill
        self.settle_s = settle_s
        self._shot: list[tuple[Spot, float, bytes]] = []
        self._hopes_until = 0.0
        self.rested = 0.0  # from when on the camera has stood still, as its readings tell
        self._stood: Reading | None = None

    def begin(self, now: float) -> Plan[float]:
        """Opens the stream, where there is one; does not wait for it."""
        if self.stream is None:
            return now
        reply = yield from attempt(FindStream("main"))
        found = reply.result if isinstance(reply.result, StreamAddress) else None
        if found is None or found.rtsp is None:
            self.stream = None  # without times of its own a picture cannot be told from the one before the motion
            return reply.received
        self.stream.begin(StreamAddress(found.rtsp))
        self._hopes_until = reply.received + OPENS_S
        return reply.received

    def followed(self, plan: Plan[T], now: float) -> Plan[T]:
        """A motion: notes when it begins, and from when on the camera stands (from `now`, if it does not move)."""
        answer: Any = None
        first = True
        self.rested, self._stood = now, None
        try:
            while True:
                step = plan.send(answer)
                answer = yield step
                if isinstance(answer, Reply) and answer.error is None:
                    first = self._note(answer, first=first)
        except StopIteration as ended:
            return cast(T, ended.value)
        finally:
            plan.close()

    def reckon(self, rests: float) -> None:
        """The motion was reckoned to end a little before it was read to rest, or after it was read last: so it did."""
        if rests and self.rested - rests < RECKONED_S:
            self.rested = rests

    def expose(self, spot: Spot, now: float) -> Plan[float]:
        """At rest: the frames of a visit; returns when the camera may turn again."""
        while self.stream is not None and not self.stream.flows(now) and now < self._hopes_until:
            now = yield from wait(now + LOOK_S)
            spot.since = max(spot.since, now - self.stream.latency)
        spot.teaches, self._hopes_until = not self._hopes_until, 0.0  # the first one waits for more than its pictures
        if self.stream is None or not self.stream.flows(now):
            return (yield from self._snapshots(spot, now))
        spot.since += self.settle_s or 0.0
        footage, lead = self.stream.footage, self.skill.timing.usual
        footage.leave(now, now, turns=False)  # a visit of the same pose
        footage.open(spot)
        now = yield from self._read_at_rest(spot, now)
        while now < footage.long_enough(spot) - lead and not spot.over:
            now = yield from wait(min(now + LOOK_S, max(now + 0.005, footage.long_enough(spot) - lead)))
            self._shot += self._collected()
            if not self.stream.flows(now):
                spot.given_up = True
                return (yield from self._snapshots(spot, now))
        spot.planned = now + lead
        return now

    def leave(self, sent: float) -> None:
        """Something else than a motion ends the visit: the picture's mode is changed."""
        if self.stream is not None:
            self.stream.footage.leave(sent + self._lead(), sent + self._lead(), turns=False)

    def collect(self) -> list[tuple[Spot, float, bytes]]:
        """The frames that have come: whose, when exposed, JPEG as it was delivered."""
        shot, self._shot = [*self._shot, *self._collected()], []
        return shot

    def pending(self, now: float) -> bool:
        """Whether frames may still be on their way."""
        return self.stream is not None and self.stream.pending(now)

    def close(self) -> None:
        """Ends the stream, if it is ours."""
        if self.stream is not None:
            self.stream.close()

    def _collected(self) -> Iterator[tuple[Spot, float, bytes]]:
        for visit, at, jpeg in self.stream.collect() if self.stream is not None else ():
            yield cast(Spot, visit), at, jpeg

    def _note(self, reply: Reply, *, first: bool) -> bool:
        request: Request = reply.request
        if isinstance(request, TURNS):
            if first and self.stream is not None:
                self.stream.footage.leave(reply.sent + self._lead(), reply.received)
            self._stood = None
            return False
        if isinstance(request, Status):
            self._read(reply, cast(Reading, reply.result))
        elif isinstance(request, Stop):
            self.rested = reply.received + STOPS_S
        return first

    def _read(self, reply: Reply, reading: Reading) -> None:
        """It stands since it first read as it does now."""
        if self._stood is not None and same(self._stood, reading):
            return
        late = reply.received - reply.sent - self.skill.timing.usual
        seen = self.skill.paces[PAN].seen_at(reply.sent, late)
        self.rested = min(reply.received, max(reply.sent - STOPS_S, seen))
        self._stood = reading

    def _lead(self) -> float:
        """So long after it was sent, a command has not turned the camera yet."""
        return SURELY * min(self.skill.timing.took, default=0.0)

    def _read_at_rest(self, spot: Spot, now: float) -> Plan[float]:
        """What was read on arrival may be of the last bit of the way: read once more, while it stands anyway."""
        if self.skill.tells_rest(spot.reading.moving):
            return now
        reply = yield from attempt(Status())
        if isinstance(reply.result, Reading):
            spot.reading = reply.result
        return reply.received

    def _snapshots(self, spot: Spot, now: float) -> Plan[float]:
        now = yield from self._read_at_rest(spot, now)
        now = yield from wait(max(now, spot.since + (SETTLE_S if self.settle_s is None else self.settle_s)))
        for _ in range(spot.wanted - spot.got):
            reply = yield from _snapshot()
            now = reply.received
            spot.got += 1
            self._shot.append((spot, reply.sent, cast(bytes, reply.result)))
        return now


def _snapshot() -> Plan[Reply]:
    for _ in range(TRIES - 1):
        reply = yield from attempt(Snapshot())
        if reply.error is None:
            return reply
        yield from wait(reply.received + 0.3)
    return (yield from ask(Snapshot()))
