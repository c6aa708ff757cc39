"""The probe's hand on the motors: runs of a given length, each ended by a stop that is confirmed, and looks on the way.

Whoever ends a motion in our place is told of it before it begins, and until it was seen at rest. What is made of the
runs is in `turning`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from services.camera.brands.dahua import ptz
from services.camera.brands.dahua.replies import read_table
from services.camera.device import Away, Direction, Reading, Refused, Start
from services.camera.lanes import DRIVE
from services.camera.probe.findings import Findings
from services.camera.probe.wire import Exchange, NoRight, Wire

STILL_DEG = 0.15  # readings nearer than this are the same
REST_S = 20.0
WATCHED_S = 0.5  # shorter runs are not looked at on the way


@dataclass(frozen=True)
class Sample:
    """One reading, when it was asked for and came, and the word for it."""

    sent: float
    received: float
    reading: Reading
    word: str


@dataclass(frozen=True)
class Run:
    """Where it stood, degrees turned (as the reading tells), seconds between the answers to start and stop, and what
    was read on the way.

    `settled`: seconds from sending the stop until the final reading came.
    """

    before: Reading
    turned: float
    seconds: float
    seen: list[Sample]
    settled: float


class Turner:
    """Turns one camera, always by pairs of start and stop."""

    def __init__(self, wire: Wire, found: Findings) -> None:
        self.wire, self.found = wire, found
        self.channel: int = found.switches["ptz_channels"][-1]
        self.samples: list[tuple[bool, Sample]] = []  # whether it must have been moving
        self.rates: dict[tuple[str, int], float] = {}
        self.starts: list[float] = []  # one of each axis: seconds from the answer to a start until the reading changes
        self.grows: dict[str, Direction] = {}  # which way the reading grows
        self.resting: Sample | None = None  # where it stands, as long as nothing was started
        self.stood_at = 0.0  # when the first of the readings came that show it at rest

    def read(self) -> Sample:
        """Where it looks."""
        answer = self.wire.ask(ptz.status(self.channel))
        word = read_table(answer.text).get("status.MoveStatus", "")
        return Sample(answer.sent, answer.sent + answer.seconds, ptz.read_status(answer.text), word)

    def rest(self) -> Sample:
        """Reads until three readings are equal."""
        last, equal, end = self.read(), 0, self.wire.clock() + REST_S
        self.stood_at = last.received
        while equal < 2:
            self.wire.pause(max(0.0, 0.2 - (last.received - last.sent)))
            now = self.read()
            equal = equal + 1 if apart(last.reading, now.reading) < STILL_DEG else 0
            self.stood_at = self.stood_at if equal else now.received
            last = now
            if self.wire.clock() > end:
                raise Away("the camera does not come to rest")
        self.wire.turning(None)
        self.samples.append((False, last))
        self.resting = last
        return last

    @contextmanager
    def turning(self, direction: Direction, speed: int) -> Iterator[Exchange]:
        """Runs as long as the block does; the stop is sent until it is confirmed. NoRight: nothing was started."""
        denied = False
        self.wire.turning(direction)
        try:
            started = self.wire.ask(ptz.start(Start(direction, speed, speed), self.channel), "start")
            self.resting = None
            if denied := started.denied:
                self.wire.turning(None)
                raise NoRight("the account has no right to turn it")
            if not started.good:
                raise Refused(f"the camera refuses to turn: {started.status} {started.text[:60]!r}")
            yield started
        finally:
            if not denied:
                self.stop(direction)

    def drive(self, target: str, name: str) -> Exchange:
        """Asks for what the firmware drives by itself; `rest` waits for its end."""
        self.wire.turning(DRIVE)
        self.resting = None
        return self.wire.ask(target, name)

    def stop(self, direction: Direction) -> None:
        """Ends that motion for sure."""
        for _ in range(20):
            if self.wire.ask(ptz.stop(direction, self.channel), "stop").good:
                return
            self.wire.pause(0.2)
        raise Away("the camera does not confirm a stop: it may still be turning")

    def run(self, direction: Direction, speed: int, seconds: float) -> Run:
        """Turns for so long after the answer to the start, and comes to rest."""
        before = (self.resting or self.rest()).reading
        seen: list[Sample] = []
        with self.turning(direction, speed) as started:
            begun_at = started.sent + started.seconds
            while (left := begun_at + seconds - self.wire.clock()) > 0:
                if seconds > WATCHED_S:
                    seen.append(self.read())
                self.wire.pause(min(0.05, max(0.0, left)))
        stopped = self.wire.exchanges[-1]
        after = self.rest()
        self.samples += [(True, one) for one in moving(seen)]
        turned = difference(before, after.reading)[0 if direction.value[0] else 1]
        return Run(before, turned, stopped.sent + stopped.seconds - begun_at, seen, self.stood_at - stopped.sent)


def moving(seen: list[Sample]) -> list[Sample]:
    """The samples between two others that differ: the camera moved when they were read."""
    return [
        now for before, now, after in zip(seen, seen[1:], seen[2:], strict=False)
        if apart(before.reading, now.reading) > STILL_DEG and apart(now.reading, after.reading) > STILL_DEG
    ]  # fmt: skip


def difference(one: Reading, other: Reading) -> tuple[float, float]:
    """Degrees of pan and tilt from one to the other, the short way."""
    return (other.pan - one.pan + 180.0) % 360.0 - 180.0, other.tilt - one.tilt


def apart(one: Reading, other: Reading) -> float:
    """The larger of both, and of zoom levels."""
    pan, tilt = difference(one, other)
    return max(abs(pan), abs(tilt), abs(one.zoom - other.zoom))
