"""A small camera in virtual time: motors with any constants, requests that take time, and a loop that drives plans.

Not the simulator: this one shares nothing with it, so that both can be wrong in different ways only.
"""

from __future__ import annotations

import random
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from math import atan, degrees
from typing import Any, Literal

from services.camera.device import (
    ClearPreset,
    Direction,
    GotoPreset,
    MoveOver,
    MoveTo,
    Reading,
    Refused,
    Reply,
    Request,
    SavePreset,
    Start,
    Status,
    Stop,
    TurnFor,
)
from services.camera.plan import Plan, Run, Stage
from services.camera.ptz.skill import RelativeForm
from services.errors import DeviceError

PAN = (1.0, 3.0, 6.0, 10.0, 16.0, 24.0, 34.0, 45.0)
STEP_S = 0.02
WHOLE_DEG = 100.0  # of the relative form's scale, where its parts are of a turn
HALF_PICTURE = (1.3, 0.8)  # tangents of pan and tilt at its ends at the widest zoom, where they are of the picture
HALF_VIEW = (52.0, 35.0)  # degrees to its ends at the widest zoom, where they are of the angle of view


@dataclass
class Axis:
    """One motor: it follows a speed, or drives to a place, with an acceleration, between two stops."""

    at: float
    low: float
    high: float
    top: float
    acceleration: float
    speed: float = 0.0
    wanted: float = 0.0
    goal: float | None = None
    ends: float = float("inf")  # s that a timed motion still has

    def advance(self, seconds: float) -> float:
        """Moves on; returns for how long it pushed against a stop."""
        if self.goal is not None:
            self._drive(seconds)
            return 0.0
        running = min(seconds, self.ends)
        self.ends -= seconds
        pushed = self._follow(running)
        if running < seconds:
            self.wanted, self.ends = 0.0, float("inf")
            pushed += self._follow(seconds - running)
        return pushed

    def _drive(self, seconds: float) -> None:
        assert self.goal is not None
        left = self.goal - self.at
        most = min(self.top, (2 * self.acceleration * abs(left)) ** 0.5, abs(self.speed) + self.acceleration * seconds)
        step = min(abs(left), most * seconds)
        self.at += step if left > 0 else -step
        self.speed = 0.0 if self.at == self.goal else (most if left > 0 else -most)
        if self.at == self.goal:
            self.goal, self.wanted = None, 0.0

    def _follow(self, seconds: float) -> float:
        change = self.wanted - self.speed
        turning = min(seconds, abs(change) / self.acceleration)
        before = self.speed
        if change:
            self.speed = (
                self.wanted
                if turning < seconds
                else self.speed + self.acceleration * seconds * (1 if change > 0 else -1)
            )
        to = self.at + (before + self.speed) / 2 * turning + self.wanted * (seconds - turning)
        self.at = min(self.high, max(self.low, to))
        if self.at == to:
            return 0.0
        self.speed = 0.0
        return seconds


@dataclass
class Motors:
    """Mechanical pan 1..354 as in the fact sheet: reading = (180 - p) mod 360. Requests take effect at their end."""

    pan: float = 90.0  # reading
    tilt: float = 20.0
    zoom: float = 0.0
    mirror: bool = True
    latency: float = 0.3
    jitter: float = 0.1
    tail: float = 0.0  # probability of a request that takes up to `tail_s` longer
    tail_s: float = 1.0
    acts: float = 1.0  # at which part of a request it takes effect
    lag: float | None = None  # of the status, before its answer; None: it tells how it was when asked
    faster: float = 1.0
    table: tuple[float, ...] = PAN
    tilt_share: float = 0.6
    zoom_rate: float = 4.0
    zoom_grid: float = 2.0
    acceleration: float = 1e6
    dither: float = 0.0
    says: Literal["honest", "idle", "stuck", "nothing"] = "honest"
    diagonals: bool = True
    absolute: Literal["full", "pan-only", "no"] = "no"
    tilt_off: float = 0.0
    relative: Literal["picture", "view", "turn", "place"] | None = None  # what it goes by a part of; a place: goes to
    relative_form: RelativeForm = "Position"
    timed: bool = False
    presets: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    seed: int = 1
    running: Direction | None = None
    pushed: float = 0.0  # s of turning against an end stop
    pushed_zoom: float = 0.0
    sent: list[Request] = field(default_factory=list)
    now: float = 0.0

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)
        top = max(self.table) * self.faster
        a = self.acceleration
        self.axes = (
            Axis((180 - self.pan) % 360, 1.0, 354.0, top, a),
            Axis(self.tilt, -10.0, 108.0, top * self.tilt_share, a),
            Axis(self.zoom, 0.0, 8.0, self.zoom_rate, 1e6),
        )
        self._times = [self.now]
        self._poses = [self.pose]
        self._took = self.latency

    @property
    def pose(self) -> tuple[float, float, float]:
        """The truth: pan as a reading, tilt, zoom."""
        return (180 - self.axes[0].at) % 360, self.axes[1].at, self.axes[2].at

    @property
    def moving(self) -> bool:
        """The truth."""
        return any(axis.speed or axis.wanted or axis.goal is not None for axis in self.axes)

    def reading(self, at: float | None = None) -> Reading:
        """What the status says of the pose at a time."""
        pose = self.pose
        if at is not None:
            pose = self._poses[max(0, bisect_right(self._times, at) - 1)]
        pan, tilt = (round(value + self.random.choice((-1, 0, 1)) * self.dither, 1) for value in pose[:2])
        moving = {"honest": self.moving, "idle": False, "stuck": True, "nothing": None}[self.says]
        zoom = round(pose[2] / self.zoom_grid) * self.zoom_grid
        return Reading(pan % 360, tilt, round(zoom, 1), moving)

    def pass_time(self, seconds: float) -> None:
        while seconds > 1e-9:
            step = min(seconds, STEP_S)
            seconds -= step
            self.now += step
            pushes = [axis.advance(step) for axis in self.axes]
            self.pushed += max(pushes[:2])
            self.pushed_zoom += pushes[2]
            self._times.append(self.now)
            self._poses.append(self.pose)
        self.pan, self.tilt, self.zoom = self.pose
        del self._times[:-2000], self._poses[:-2000]

    def duration(self) -> float:
        late = self.random.uniform(0, self.tail_s) if self.random.random() < self.tail else 0.0
        self._took = self.latency + self.random.uniform(-self.jitter, self.jitter) + late
        return self._took

    def answer(self, request: Request) -> tuple[object, DeviceError | None]:
        self.sent.append(request)
        match request:
            case Start(direction, speed, tilt_speed):
                return self._start(direction, speed, tilt_speed or speed)
            case Stop():
                self.running = None
                for axis in self.axes:
                    axis.wanted, axis.goal, axis.ends = 0.0, None, float("inf")
            case Status():
                return self.reading(self.now - (self._took if self.lag is None else self.lag)), None
            case GotoPreset(number):
                if number not in self.presets:
                    return None, Refused("no such preset")
                pan, tilt, zoom = self.presets[number]
                self._drive_to((180 - pan) % 360, tilt, zoom)
            case SavePreset(number):
                self.presets[number] = self.pose
            case ClearPreset(number):
                self.presets.pop(number, None)
            case MoveTo(pan, tilt, zoom):
                if self.absolute == "no":
                    return None, Refused("bad request")
                self._drive_to(
                    (180 - pan) % 360, tilt + self.tilt_off if self.absolute == "full" else self.tilt_now(), zoom
                )
            case MoveOver():
                return self._over(request)
            case TurnFor():
                return self._turn_for(request)
        return None, None

    def tilt_now(self) -> float:
        return self.axes[1].at

    def _start(self, direction: Direction, pan: int, tilt: int) -> tuple[object, DeviceError | None]:
        right, down, zoom = direction.value
        if not self.diagonals and right and down:
            return None, Refused("no diagonals")
        self.running = direction
        self._turn(-right * self._rate(pan), down * self._rate(tilt) * self.tilt_share, zoom * self.zoom_rate)
        return None, None

    def _turn(self, travel: float, tilt: float, zoom: float, seconds: float = float("inf")) -> None:
        sense = 1 if self.mirror else -1
        for axis, wanted in zip(self.axes, (sense * travel, sense * tilt, zoom), strict=True):
            axis.goal, axis.wanted, axis.ends = None, wanted, seconds

    def _rate(self, speed: int) -> float:
        return self.table[min(speed, len(self.table)) - 1] * self.faster

    def _drive_to(self, travel: float, tilt: float, zoom: float) -> None:
        for axis, goal in zip(self.axes, (travel, tilt, zoom), strict=True):
            axis.goal, axis.ends = min(axis.high, max(axis.low, goal)), float("inf")
            axis.wanted = 0.0

    def _over(self, request: MoveOver) -> tuple[object, DeviceError | None]:
        if not self.relative or request.form != self.relative_form:
            return None, Refused("bad request")
        sense, larger, parts = 1 if self.mirror else -1, 1 + self.axes[2].at / 5, (request.right, request.down)
        if self.relative == "place":
            self._drive_to(177.0 - 177.0 * parts[0], 50.0 + 60.0 * parts[1], 4.0 + request.zoom / 2)
            return None, None
        if self.relative == "turn":
            right, down = (part * WHOLE_DEG for part in parts)
        elif self.relative == "view":
            right, down = (part * half / larger for part, half in zip(parts, HALF_VIEW, strict=True))
        else:
            right, down = (degrees(atan(part * half / larger)) for part, half in zip(parts, HALF_PICTURE, strict=True))
        over = (-right * sense, down * sense, request.zoom)
        self._drive_to(*(axis.at + way for axis, way in zip(self.axes, over, strict=True)))
        return None, None

    def _turn_for(self, request: TurnFor) -> tuple[object, DeviceError | None]:
        if not self.timed:
            return None, Refused("not implemented")
        top = max(self.table) * self.faster / 100
        self._turn(-request.right * top, request.down * top * self.tilt_share,
                   request.zoom * self.zoom_rate / 100, float(request.seconds))  # fmt: skip
        return None, None


def drive(
    plan: Plan[Any],
    motors: Motors,
    *,
    limit_s: float = 120.0,
    now: float = 1000.0,
    seen: Callable[[Reply], None] = lambda reply: None,
) -> tuple[Run, float]:
    """Runs a plan to its end in virtual time; the run and how long it took."""
    waiting: list[tuple[Request, int]] = []
    stage = Stage(lambda request, ticket: waiting.append((request, ticket)))
    began = now
    run = stage.begin(plan, now, lambda run, now: None)
    while not run.done:
        assert now - began < limit_s, "the plan does not end"
        if waiting:
            request, ticket = waiting.pop(0)
            took = motors.duration()
            early = took * motors.acts
            motors.pass_time(early)
            result, error = motors.answer(request)
            motors.pass_time(took - early)
            sent, now = now, now + took
            reply = Reply(request, ticket, result, error, sent, now)
            seen(reply)
            stage.reply(reply, now)
        else:
            assert stage.due is not None
            later = max(now, stage.due)
            motors.pass_time(later - now)
            now = later
            stage.tick(now)
    return run, now - began
