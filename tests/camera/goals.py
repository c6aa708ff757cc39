"""Random goals for the regulator against the inside of the simulated camera, in virtual time, in the wire's own words.

The plan is driven as the service's stage drives it; requests go through the brand's client, login and all. Truth is
taken from the simulator, which the plan never sees. Used by the test over all profiles, the soak and the bench.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

from pydantic import SecretStr

from services.camera.address import Address
from services.camera.brands.amcrest import Amcrest
from services.camera.capabilities import Capabilities, GetCapabilities
from services.camera.device import Reading, Reply, Request, Status
from services.camera.plan import Plan, Run, Stage
from services.camera.ptz.calibrate import calibrate
from services.camera.ptz.goal import Limits
from services.camera.ptz.move import Arrival, goto
from services.camera.ptz.skill import Skill
from services.camera.web.gate import Gate
from services.errors import DeviceError
from services.simulators.camera.device import Device
from services.simulators.camera.digest import Door, realm
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.latency import Latency
from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from services.simulators.camera.program import Inside
from services.simulators.world import load
from services.virtual.wire import Wire
from tests import bounds
from tests.camera.least_time import Constants, least_time

WORLD = Path(__file__).parents[2] / "config" / "world.yaml"
LIMITS = Limits()
START = 1_768_000_000.0
LEVELS = (0.0, 2.0, 4.0, 6.0, 8.0)

Goal = tuple[float, float, float]


def random_goals(count: int, seed: int) -> list[Goal]:
    """Goals in pan, tilt and zoom, on both sides of the dead arc."""
    rng = random.Random(seed)
    return [
        (
            round(rng.choice((rng.uniform(0.0, 178.5), rng.uniform(186.5, 359.9))), 1),
            round(rng.uniform(-9.5, 107.5), 1),
            rng.choice(LEVELS),
        )
        for _ in range(count)
    ]


@dataclass
class Outcome:
    """How one goal went."""

    goal: Goal
    seconds: float
    least: float
    commands: int  # requests without those that a challenge answered
    requests: int
    off: float  # degrees, the truth
    off_zoom: float
    rests: bool
    pushed: float
    error: str | None = None

    @property
    def ratio(self) -> float:
        """Time over the least time."""
        return self.seconds / self.least


@dataclass
class Rig:
    """One simulated camera, the brand's client, and what the regulator has learnt so far.

    `network_s`: an answer comes so much after it left the camera, on average (exponentially distributed).
    """

    profile: Profile
    seed: int = 1
    skill: Skill = field(default_factory=Skill)
    now: float = START
    near: Reading | None = None
    network_s: float = 0.0
    log: Callable[[Reply], None] = lambda reply: None

    def __post_init__(self) -> None:
        world = load(WORLD)
        self.camera = world.cameras["ip1"]
        rng = random.Random(self.seed)
        self.network = random.Random(self.seed)
        self.device = Device(self.camera, self.profile, self.now, Latency(self.profile, None, rng))
        door = Door(realm(self.profile, self.camera.serial), "ros", "secret123", self.profile, rng)
        self.wire = Counted(Inside(self.device, door, cast(Any, None)))
        address = Address("http://192.0.2.9", "ros", SecretStr("secret123"))
        gate = Gate(clock=lambda: self.wire.now, pause=self._pause)
        self.client = Amcrest(address, self.wire, gate)
        self.skill.forget_senses(flip=True, mirror=True)
        told = cast(Capabilities, self._send(GetCapabilities("motors"), 0).result)  # as the service asks at first
        self.skill.believe(absolute=told.absolute, relative=told.relative)
        self.near = cast(Reading, self._send(Status(), 0).result)  # as the service polls it

    def go(self, goal: Goal, near: float = 0.0, **more: Any) -> Outcome:
        """One goal; so many degrees beside it will do."""
        here, pushed = self.truth(), self.pushed()
        self.wire.commands = self.wire.requests = 0
        began = self.now
        wanted = replace(LIMITS.goal(*goal), near=near)
        run = self.drive(goto(wanted, LIMITS, self.skill, self.now + 60.0, near=self.near, **more))
        there = self.truth()
        self.near = run.result.reading if isinstance(run.result, Arrival) else None
        return Outcome(
            goal=goal,
            seconds=self.now - began,
            least=least_time(here, goal, constants(self.profile)),
            commands=self.wire.commands,
            requests=self.wire.requests,
            off=max(abs(LIMITS.unwrap(there[0]) - LIMITS.unwrap(goal[0])), abs(there[1] - goal[1])),
            off_zoom=abs(there[2] - goal[2]),
            rests=not any(self.device.motion(self.now)[1]),
            pushed=self.pushed() - pushed,
            error=str(run.error) if run.error else None,
        )

    def visit(self, goals: Iterable[Goal]) -> list[Outcome]:
        """All goals one after the other, some time between two."""
        found = []
        for goal in goals:
            found.append(self.go(goal))
            self.now += 1.0
        return found

    def calibrate(self) -> None:
        """What the order for it does, before any goal."""
        run = self.drive(calibrate(LIMITS, self.skill), limit_s=1500.0)
        assert run.error is None, run.error
        self.near = cast(Arrival, run.result).reading
        self.now += 1.0

    def truth(self) -> Goal:
        """Where the motors are."""
        pose = self.device.motion(self.now)[0]
        return pose.pan, pose.tilt, pose.zoom

    def pushed(self) -> float:
        """For how long pan and tilt were pushed against their ends, seconds; a digital zoom has none."""
        return sum(self.device.ptz.motors.worked(self.now).pushed_s[:2])

    def drive(self, plan: Plan[Any], limit_s: float = 300.0) -> Run:
        """Runs a plan to its end."""
        waiting: list[tuple[Request, int]] = []
        stage = Stage(lambda request, ticket: waiting.append((request, ticket)))
        run = stage.begin(plan, self.now, lambda run, now: None)
        end = self.now + limit_s
        while not run.done:
            assert self.now < end, "the plan does not end"
            if waiting:
                reply = self._send(*waiting.pop(0))
                self.log(reply)
                stage.reply(reply, self.now)
            else:
                assert stage.due is not None
                self.now = max(self.now, stage.due)
                stage.tick(self.now)
        return run

    def _pause(self, seconds: float) -> None:
        """What the client waits after an odd refusal counts like the camera's own time."""
        self.wire.now += seconds

    def _send(self, request: Request, ticket: int) -> Reply:
        sent = self.wire.now = self.now
        result: object = None
        fault: DeviceError | None = None
        try:
            result = self.client.send(request)
        except DeviceError as error:
            fault = error
        self.now = self.wire.now + (self.network.expovariate(1 / self.network_s) if self.network_s else 0.0)
        return Reply(request, ticket, result, fault, sent, self.now)


class Counted(Wire):
    """The wire, with a count."""

    commands = requests = 0

    def handle_request(self, request: Any) -> Any:
        answer = super().handle_request(request)
        self.requests += 1
        self.commands += answer.status_code != 401
        return answer


def constants(profile: Profile) -> Constants:
    """The motors' constants of a simulated camera."""
    top = max(profile.pan_speeds)
    return Constants(
        (top, top * profile.tilt_share, profile.zoom_speed),
        (profile.pan_acceleration, profile.tilt_acceleration, profile.zoom_acceleration),
    )


def with_other_motors(profile: Profile, seed: int) -> Profile:
    """The same firmware in a camera that nobody has seen: how fast all is in it is drawn at random."""
    rng = random.Random(seed)
    slowest, ratio, latency = rng.uniform(0.6, 1.4), rng.uniform(1.4, 1.75), rng.uniform(0.15, 0.45)
    return replace(
        profile,
        pan_speeds=tuple(slowest * ratio**step for step in range(len(profile.pan_speeds))),
        tilt_share=rng.uniform(0.4, 1.0),
        pan_acceleration=rng.uniform(60.0, 300.0),
        tilt_acceleration=rng.uniform(60.0, 300.0),
        zoom_speed=rng.uniform(1.5, 6.0),
        latency_s=latency,
        latency_spread_s=latency * rng.uniform(0.15, 0.45),
    )


def outcomes(
    profile: Profile, goals: Iterable[Goal], seed: int = 1, *, calibrated: bool = False, network_s: float = 0.0
) -> list[Outcome]:
    """All goals one after the other: from a cold start, or after `apartment calibrate ptz`."""
    rig = Rig(profile, seed, network_s=network_s)
    if calibrated:
        rig.calibrate()
    return rig.visit(goals)


def with_presets(
    profile: Profile, goals: Iterable[Goal], seed: int, beside: float, *, calibrated: bool = False
) -> list[Outcome]:
    """The same where each goal has a preset near it, known from a place, and never gone to before."""
    rig, found, rng = Rig(profile, seed), [], random.Random(seed)
    if calibrated:
        rig.calibrate()
    for goal in goals:
        low, high = (187.0, 359.9) if goal[0] > 180.0 else (0.0, 178.5)
        pan = min(high, max(low, goal[0] + rng.uniform(-beside, beside)))
        near = (round(pan, 1), round(min(107.5, max(-9.5, goal[1] + rng.uniform(-beside, beside))), 1), goal[2])
        rig.device.ptz.presets[1] = ("near", Pose(*near))
        rig.skill.presets.clear()
        found.append(rig.go(goal, presets={1: near}))
        rig.now += 1.0
    return found


def named() -> dict[str, Profile]:
    """Every profile that the simulator has."""
    return {name: replace(profile) for name, profile in PROFILES.items()}


def wanted(profile: Profile) -> float:
    """The bound of the median of time over least time."""
    return bounds.MEDIAN_POSITIONS if positions(profile) or relative(profile) else bounds.MEDIAN_START_STOP


def wanted_cold(profile: Profile) -> float:
    """The same of a camera that learns its motors in these goals."""
    only_relative = relative(profile) and not positions(profile)
    return bounds.COLD_MEDIAN_RELATIVE if only_relative else wanted(profile)


def positions(profile: Profile) -> bool:
    """Whether it lets its firmware drive to any position, or over any way."""
    return profile.position_abs == "full" or profile.moves != "none"


def relative(profile: Profile) -> bool:
    """Whether it lets its firmware drive over a part of the picture."""
    return profile.position_relative == "works"
