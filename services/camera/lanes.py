"""The threads that talk to the camera: one for control, one for pictures, one request in flight in each.

A Stop overtakes everything that waits, and what waits to start a motion is dropped by it. Replies go to the inbox
as `/camera/reply`. Not here: what is asked (`device.py`), how it is said (`brands/`).
"""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Final, Literal, Protocol

from services.bus import Message
from services.camera.device import (
    Away,
    Camera,
    Direction,
    GotoPreset,
    MoveOver,
    MoveTo,
    Rank,
    Reading,
    Refused,
    Reply,
    Request,
    Start,
    Status,
    Stop,
    TurnFor,
)
from services.errors import DeviceError
from services.runner import Post

REPLY = "/camera/reply"
GAP_S = 0.45  # between two readings that are compared: the slowest speed shows in that time
OVERRULES = 4  # readings in a row that are as the one before, whatever the camera says of its motion
STILL_DEG = 0.25  # two readings nearer than this are the same: the resolution is 0.1 degree, and some dither by that
STOP_ALONE_S = 1.0  # longer than the pause between two tries of a stop
END_S = 3.5  # the end of the service waits so long for a camera to stand still; then its watchdog goes on

DRIVE: Final = "drive"  # what turns when the firmware drives by itself
Turning = Callable[[Direction | Literal["drive"] | None], None]

FIRMWARE = GotoPreset | MoveTo | MoveOver | TurnFor
log = logging.getLogger(__name__)


class Sender(Protocol):
    """What the service needs of a device; in virtual time another one does the same without threads."""

    def submit(self, request: Request, ticket: int) -> None:
        """Sends when its turn has come; the answer is a `/camera/reply` message with this ticket."""
        ...

    def close(self) -> None:
        """Drops what waits, makes sure that nothing moves, and ends."""
        ...


@dataclass(order=True)
class _Waiting:
    rank: Rank
    number: int
    request: Request
    ticket: int


class _Rest:
    """Whether readings show that a motion has ended which nobody stops: the firmware's own, or one it will not stop.

    `patient`: that takes as many as where the camera says that it moves.
    """

    def __init__(self, *, patient: bool) -> None:
        self._patient = patient
        self._before: tuple[Reading, float] | None = None
        self._equal = 0

    def shown_by(self, reading: Reading, at: float) -> bool:
        """One more reading, asked at that time: sooner than GAP_S after another one it proves no rest."""
        before, asked = self._before or (None, at)
        if before is None or not same(before, reading):
            self._before, self._equal = (reading, at), 0
        elif at - asked >= GAP_S:
            self._before, self._equal = (reading, at), self._equal + 1
        return self._equal >= (OVERRULES if self._patient or reading.moving is True else 1)


class Lane:
    """One thread, one connection, one request in flight."""

    def __init__(
        self,
        name: str,
        camera: Camera,
        post: Post,
        clock: Callable[[], float],
        turning: Turning = lambda direction: None,
        owing: Callable[[bool], None] = lambda on: None,
    ) -> None:
        self.camera = camera
        self.owing = owing
        self.post = post
        self.clock = clock
        self.turning = turning
        self.started = False  # a motion may be running
        self._others_at = 0.0  # until then only a stop is sent
        self._met = False  # it has told where it looks, and so has been logged in to
        self._rest: _Rest | None = None  # of what runs; None: only a stop ends it
        self._waiting: list[_Waiting] = []
        self._numbers = itertools.count()
        self._changed = threading.Condition()
        self._closing = False
        self.thread = threading.Thread(target=self._run, name=name, daemon=True)
        self.thread.start()

    def put(self, request: Request, ticket: int) -> None:
        """Lets a request wait for its turn."""
        with self._changed:
            dropped = self._overtaken() if isinstance(request, Stop) else []
            heappush(self._waiting, _Waiting(request.rank, next(self._numbers), request, ticket))
            self._changed.notify()
        for waiting in dropped:
            self._answer(waiting, None, Refused("overtaken by a stop"), self.clock())

    def __len__(self) -> int:
        return len(self._waiting)

    def end(self) -> None:
        """Drops what waits; the thread ends after the request in flight."""
        with self._changed:
            self._waiting.clear()
            self._closing = True
            self._changed.notify()

    def _overtaken(self) -> list[_Waiting]:
        dropped = [waiting for waiting in self._waiting if waiting.rank is Rank.MOVE]
        self._waiting = sorted(waiting for waiting in self._waiting if waiting.rank is not Rank.MOVE)
        return dropped

    def _in_vain(self, error: Away) -> None:
        """The camera was lost while it turned: whoever waits learns it now, so that he who turns it asks for a stop."""
        with self._changed:
            dropped = [waiting for waiting in self._waiting if waiting.rank is not Rank.STOP]
            self._waiting = sorted(waiting for waiting in self._waiting if waiting.rank is Rank.STOP)
        for waiting in dropped:
            self._answer(waiting, None, error, self.clock())

    def _run(self) -> None:
        while (waiting := self._next()) is not None:
            sent = self.clock()
            try:
                result = self._send(waiting.request, sent)
            except DeviceError as error:
                if isinstance(error, Away) and self.started:
                    self._others_at = self.clock() + STOP_ALONE_S
                    self.owing(True)
                    self._in_vain(error)
                elif isinstance(waiting.request, Stop):
                    self.owing(False)  # it has arrived, whatever the camera thinks of it
                    if isinstance(error, Refused) and self.started:
                        self._rest = self._rest or _Rest(patient=True)
                self._answer(waiting, None, error, sent)
            else:
                self._answer(waiting, result, None, sent)
        if self.started and stand_still(self.camera):
            self.turning(None)
        self.owing(False)
        self.camera.close()

    def _next(self) -> _Waiting | None:
        """The next request; while a lost camera is owed a stop, the pause between two stops is nobody else's."""
        with self._changed:
            while not self._closing or self._waiting:
                pause = self._others_at - self.clock()
                if self._waiting and (self._waiting[0].rank is Rank.STOP or pause <= 0):
                    return heappop(self._waiting)
                self._changed.wait(pause if self._waiting else None)
            return None

    def _send(self, request: Request, sent: float) -> object:
        if isinstance(request, Start | FIRMWARE):
            self.started = True  # before it is sent: a start whose answer is lost may have been heard
            self._rest = None if isinstance(request, Start | TurnFor) else _Rest(patient=False)
            self.turning(request.direction if isinstance(request, Start) else DRIVE)
        result = self.camera.send(request)
        rests = self._rest is not None and isinstance(result, Reading) and self._rest.shown_by(result, sent)
        if isinstance(request, Stop) or rests:
            self.started, self._rest = False, None
            self.turning(None)
            self.owing(False)
        elif isinstance(result, Reading) and not self._met and not self.started:
            self.turning(None)  # whoever ends motions in our place may make itself known there too
        self._met = self._met or isinstance(result, Reading)
        return result

    def _answer(self, waiting: _Waiting, result: object, error: DeviceError | None, sent: float) -> None:
        reply = Reply(waiting.request, waiting.ticket, result, error, sent, self.clock())
        self.post(Message(REPLY, value=reply, received=reply.received))


class Lanes:
    """A Sender for a camera on the network; `turning` is told what turns, before it does (`watchdog.py`).

    `owing` is told when the camera was lost while it turned, and when the stop that it is owed was confirmed.
    """

    def __init__(
        self,
        connect: Callable[[], Camera],
        post: Post,
        clock: Callable[[], float] = time.time,
        turning: Turning = lambda direction: None,
        owing: Callable[[bool], None] = lambda on: None,
    ) -> None:
        self.control = Lane("camera control", connect(), post, clock, turning, owing)
        self.pictures = Lane("camera pictures", connect(), post, clock)

    def submit(self, request: Request, ticket: int) -> None:
        """Any thread; returns at once."""
        lane = self.pictures if request.rank is Rank.PICTURE else self.control
        lane.put(request, ticket)

    def close(self) -> None:
        """Returns when the camera stands still and both threads have ended, or after `END_S`."""
        for lane in (self.control, self.pictures):
            lane.end()
        self.control.thread.join(END_S)
        self.pictures.thread.join(0.5)


def stand_still(
    camera: Camera,
    clock: Callable[[], float] = time.monotonic,
    limit_s: float = END_S,
    *,
    direction: Direction | Literal["drive"] | None = None,
) -> bool:
    """Sends a stop until it is confirmed and two readings are equal; whether that was so within the limit.

    What the firmware drives by itself has no stop of its own everywhere: a slow start takes its place, once, which has.
    Some refuses to stop what does not run: where every stop is refused, two equal readings are enough.
    """
    end = clock() + limit_s
    every, drives = False, direction == DRIVE
    if direction == DRIVE:
        direction = Direction.LEFT
    while clock() < end:
        try:
            drives = drives and not _takes(camera, Start(Direction.LEFT))
            taken = _takes(camera, Stop(every=every, direction=direction))
            camera.send(Status())  # it may lag behind the motor
            asked, before = clock(), camera.send(Status())
            time.sleep(min(GAP_S, max(0.0, asked + GAP_S - clock())))
            after = camera.send(Status())
        except DeviceError as error:
            log.warning("the stop at the end is not confirmed yet: %s", error)
            time.sleep(0.2)
            continue
        rests = isinstance(before, Reading) and isinstance(after, Reading) and same(before, after)
        if rests and (taken or every):
            return True
        every = True
    log.error("the camera may still be moving: no confirmed stop within %.0f s", limit_s)
    return False


def _takes(camera: Camera, request: Start | Stop) -> bool:
    """Sends it; whether it was not refused."""
    try:
        camera.send(request)
    except Refused:
        return False
    return True


def same(one: Reading, other: Reading, about: float = 0.0) -> bool:
    """Whether two readings show a camera at rest (it repeats a value, or dithers by 0.1 degree).

    `about`: so many degrees of pan and tilt do not count.
    """
    pan, tilt = abs((one.pan - other.pan + 180) % 360 - 180), abs(one.tilt - other.tilt)
    return max(pan, tilt) < max(STILL_DEG, about) and abs(one.zoom - other.zoom) < STILL_DEG
