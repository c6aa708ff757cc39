"""A small camera in virtual time: motors with speed, latency and a reading that lags, and a loop that drives plans."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

from services.camera.plan import Plan, Run, Stage
from services.camera.requests import (
    Direction,
    Reading,
    Refused,
    Reply,
    Request,
    Start,
    Status,
    Stop,
)
from services.errors import DeviceError

PAN = (1, 3, 6, 10, 16, 24, 34, 45)


@dataclass
class Motors:
    """Mechanical pan 1..354 as in the fact sheet: reading = (180 - p) mod 360. Requests take effect at their end."""

    pan: float = 90.0  # reading
    tilt: float = 20.0
    zoom: float = 0.0
    mirror: bool = True
    latency: float = 0.3
    jitter: float = 0.1
    faster: float = 1.0
    diagonals: bool = True
    seed: int = 1
    running: Direction | None = None
    speeds: tuple[int, int] = (0, 0)
    pushed: float = 0.0  # s of turning against an end stop
    sent: list[Request] = field(default_factory=list)
    _shown: Reading | None = None

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)
        self.p = (180 - self.pan) % 360

    def reading(self) -> Reading:
        return Reading(round((180 - self.p) % 360, 1), round(self.tilt, 1), round(self.zoom, 1), bool(self.running))

    def pass_time(self, seconds: float) -> None:
        if self.running is None:
            return
        right, down, zoom = self.running.value
        sense = 1 if self.mirror else -1
        p = self.p - right * sense * PAN[self.speeds[0] - 1] * self.faster * seconds
        tilt = self.tilt + down * sense * 0.6 * PAN[self.speeds[1] - 1] * self.faster * seconds
        self.p, self.tilt = min(354.0, max(1.0, p)), min(108.0, max(-10.0, tilt))
        self.zoom = min(8.0, max(0.0, self.zoom + zoom * seconds))
        if (self.p, self.tilt) != (p, tilt):
            self.pushed += seconds

    def duration(self) -> float:
        return self.latency + self.random.uniform(-self.jitter, self.jitter)

    def answer(self, request: Request) -> tuple[object, DeviceError | None]:
        self.sent.append(request)
        match request:
            case Start(direction, speed, tilt_speed):
                if not self.diagonals and direction.value[0] and direction.value[1]:
                    return None, Refused("no diagonals")
                self.running, self.speeds = direction, (speed, tilt_speed or speed)
            case Stop():
                self.running = None
            case Status():
                shown, self._shown = self._shown or self.reading(), self.reading()
                return shown if self.running else self.reading(), None
        return None, None


def drive(plan: Plan[Any], motors: Motors, *, limit_s: float = 120.0, now: float = 1000.0) -> tuple[Run, float]:
    """Runs a plan to its end in virtual time; the run and how long it took."""
    waiting: list[tuple[Request, int]] = []
    stage = Stage(lambda request, ticket: waiting.append((request, ticket)))
    began = now
    run = stage.begin(plan, now, lambda run, now: None)
    while not run.done:
        assert now - began < limit_s, "the plan does not end"
        if waiting:
            request, ticket = waiting.pop(0)
            sent, now = now, now + motors.duration()
            motors.pass_time(now - sent)
            result, error = motors.answer(request)
            stage.reply(Reply(request, ticket, result, error, sent, now), now)
        else:
            assert stage.due is not None
            later = max(now, stage.due)
            motors.pass_time(later - now)
            now = later
            stage.tick(now)
    return run, now - began
