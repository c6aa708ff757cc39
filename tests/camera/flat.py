"""A camera service in virtual time: the real service, a camera of motors instead of a network, a clock that jumps."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from services.bus import Message
from services.camera.device import (
    Errand,
    GetPicture,
    Identify,
    Identity,
    Mode,
    Picture,
    Rank,
    Reading,
    Reboot,
    Refused,
    Reply,
    Request,
    SetPicture,
    Snapshot,
    Start,
    Stop,
)
from services.camera.errands import GetPresets
from services.camera.lanes import REPLY
from services.camera.scan.analysis import ANALYSED, Analysed, Task
from services.camera.scan.sightings import Eye
from services.camera.service import CameraService
from services.camera.settings import Config
from services.errors import BadMessage, DeviceError
from services.vision.detect import Detection
from services.vision.frames import Mount
from services.vision.lens import Lens
from tests.camera.motors import Motors

SEES_DEG = 25.0
SIZE = (2304, 1296)


class VirtualCamera:
    """A Sender: control and pictures one after the other each, a stop goes first."""

    def __init__(self, motors: Motors, clock: Callable[[], float]) -> None:
        self.motors = motors
        self.clock = clock
        self.picture = Picture(True, motors.mirror, "color")
        self.away: DeviceError | None = None
        self.blind = False  # it gives no pictures
        self.remembers: bool | None = None
        self.met = 0  # how often it was asked who it is
        self.errands: list[Errand] = []
        self.answers: dict[type[Errand], Callable[[Any], object]] = {
            GetPresets: lambda asked: frozenset(motors.presets)
        }
        self.waiting: list[tuple[Request, int]] = []
        self.flying: list[tuple[float, float, Request, int]] = []  # when it is answered, when sent
        self.closed = False

    def submit(self, request: Request, ticket: int) -> None:
        if isinstance(request, Stop):
            self.waiting.insert(0, (request, ticket))
        else:
            self.waiting.append((request, ticket))
        self._send()

    def close(self) -> None:
        self.closed = True

    def _send(self) -> None:
        busy = {self.lane(request) for _, _, request, _ in self.flying}
        for item in list(self.waiting):
            if self.lane(item[0]) not in busy:
                busy.add(self.lane(item[0]))
                self.waiting.remove(item)
                now = self.clock()
                self.flying.append((now + self.motors.duration(), now, *item))

    def lane(self, request: Request) -> bool:
        return request.rank is Rank.PICTURE

    @property
    def due(self) -> float | None:
        return min((flying[0] for flying in self.flying), default=None)

    def answer(self) -> Reply:
        flying = min(self.flying, key=lambda one: one[0])
        self.flying.remove(flying)
        at, sent, request, ticket = flying
        result, error = self._result(request)
        self._send()
        return Reply(request, ticket, result, error, sent, at)

    def _result(self, request: Request) -> tuple[object, DeviceError | None]:
        if self.away is not None:
            return None, self.away
        match request:
            case Snapshot() if self.blind:
                return None, Refused("no picture")
            case Snapshot():
                return json.dumps([self.motors.reading().pan, self.motors.tilt]).encode(), None
            case GetPicture():
                return self.picture, None
            case SetPicture(flip, mirror, mode, modes):
                old, new = self.picture, cast(Mode, modes[0]) if modes else mode
                self.picture = Picture(
                    old.flip if flip is None else flip, old.mirror if mirror is None else mirror, new or old.mode
                )
                self.motors.mirror = self.picture.mirror
                return self.picture, None
            case Identify():
                self.met += 1
                return Identity("IP3M-941W", "AMC0000000000001", "2.420", self.remembers), None
            case Reboot():
                return None, None
            case Errand():
                self.errands.append(request)
                answer = self.answers.get(type(request), lambda one: Refused("no such thing here"))(request)
                return (None, answer) if isinstance(answer, DeviceError) else (answer, None)
            case _:
                return self.motors.answer(request)


@dataclass
class Lookout:
    """An Analyst that sees a marker when the camera looks near to where it is; pictures are readings."""

    post: Callable[[Message], None]
    markers: dict[int, tuple[float, float]]

    def submit(self, task: Task) -> None:
        pan, tilt = json.loads(task.jpeg)
        found = [
            self._detection(pan, tilt, marker, *self.markers[marker])
            for marker in task.targets
            if marker in self.markers and self._sees(pan, tilt, *self.markers[marker])
        ]
        self.post(Message(ANALYSED, value=Analysed(task.scan, task.number, SIZE, tuple(found))))

    def close(self) -> None:
        pass

    def _sees(self, pan: float, tilt: float, at_pan: float, at_tilt: float) -> bool:
        return abs((pan - at_pan + 180) % 360 - 180) < SEES_DEG and abs(tilt - at_tilt) < SEES_DEG

    def _detection(self, pan: float, tilt: float, marker: int, at_pan: float, at_tilt: float) -> Detection:
        x = SIZE[0] / 2 + 20 * ((at_pan - pan + 180) % 360 - 180)
        y = SIZE[1] / 2 + 20 * (at_tilt - tilt)
        square = np.array([[-20, -20], [20, -20], [20, 20], [-20, 20]], float)
        return Detection(marker, square + np.array([x, y]), 0.9)


class Flat:
    """The service and its camera; `said` is everything that was published."""

    def __init__(self, folder: Path, *, motors: Motors | None = None, **settings: Any) -> None:
        self.now = 1000.0
        self.motors = motors or Motors()
        self.camera = VirtualCamera(self.motors, lambda: self.now)
        self.inbox: list[Message] = []
        self.said: list[Message] = []
        self.dropped: list[str] = []  # as the runner does with what makes no sense
        self.markers: dict[int, tuple[float, float]] = {}
        config = Config(folder=folder, url="http://192.0.2.9", targets=(582,), **settings)
        matrix = np.array([[1158.4, 0, 1147.2], [0, 1156.9, 652.8], [0, 0, 1]])
        eye = Eye("ip1", config.dictionary, Lens(*SIZE, matrix, np.zeros(5)), Mount((3.0, 2.2, 2.6)))
        self.service = CameraService(config, self.camera, lambda: Lookout(self.inbox.append, self.markers), eye)
        self._turn()

    def order(self, key: str, value: Any, *, order_id: str = "1", by: str = "human") -> None:
        payload = json.dumps({"value": value, "id": order_id, "by": by}).encode()
        self.send(f"camera/ip1/order/{key}", payload)

    def send(self, topic: str, payload: bytes, **fields: Any) -> None:
        self.inbox.append(Message(topic, payload, received=self.now, **fields))
        self._turn()

    def run(self, seconds: float) -> None:
        self.until(lambda: False, seconds, strict=False)

    def until(self, happened: Callable[[], bool], limit_s: float = 120.0, *, strict: bool = True) -> None:
        end = self.now + limit_s
        while not happened():
            due = [time for time in (self.camera.due, self.service.due) if time is not None]
            later = min([max(self.now, min(due)), end])
            self.motors.pass_time(later - self.now)
            self.now = later
            if self.now >= end:
                assert not strict, "it did not happen in time"
                return
            while self.camera.due is not None and self.camera.due <= self.now:
                reply = self.camera.answer()
                self.inbox.append(Message(REPLY, value=reply))
            self._turn()

    def _turn(self) -> None:
        while self.inbox:
            try:
                self.said += self.service.handle(self.inbox.pop(0), self.now)
            except BadMessage as error:
                self.dropped.append(str(error))
        self.said += self.service.tick(self.now)

    def online(self) -> Flat:
        self.until(lambda: self.service.health.online, 20)
        self.run(3)
        return self

    def payloads(self, topic: str) -> list[Any]:
        return [json.loads(one.payload) for one in self.said if one.topic == f"camera/ip1/{topic}"]

    def states(self, order_id: str = "1") -> list[str]:
        return [one["state"] for one in self.payloads("order_result") if one["id"] == order_id]

    def last(self, order_id: str = "1") -> dict[str, Any]:
        return [one for one in self.payloads("order_result") if one["id"] == order_id][-1]

    def ended(self, order_id: str = "1") -> bool:
        return bool(self.states(order_id)) and self.states(order_id)[-1] in ("done", "failed", "refused", "cancelled")

    def started(self) -> bool:
        return any(isinstance(request, Start) for request in self.motors.sent)

    @property
    def reading(self) -> Reading:
        return self.motors.reading()
