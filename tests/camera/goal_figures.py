"""The rows of `make bench` about the camera's moves: ours on every firmware, and the report's controller beside it.

Virtual time, on the same wire words and the same simulated motors: no frame rate to keep, and seconds of real time.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from statistics import median

import httpx

from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.profiles import Profile
from services.simulators.world import load
from tests import bounds
from tests.camera.goals import (
    LIMITS,
    START,
    WORLD,
    Outcome,
    Rig,
    constants,
    outcomes,
    random_goals,
    wanted,
    with_other_motors,
    with_presets,
)
from tests.camera.least_time import Hops, least_by_hops, least_time
from tests.camera.report_controller import ReportController

SEED = 1
RELATIVE = "ip2m-841b-strict"  # it takes a relative position, and no other
COMPARED = "ip3m-941w-2019"
THE_REPORT_S_GOALS = 10
NETWORK_S = 0.003  # on average: a network and a machine that have something else to do
EACH = 10  # goals of a camera with other motors


@dataclass
class Row:
    """Many goals on one firmware."""

    name: str
    goals: int
    seconds: float
    ratio: float
    worst: float
    commands: float
    most_commands: int
    over: int
    requests: float
    off: float
    pushed: int
    bound: float | None


def rows() -> list[Row]:
    """Every firmware, and the report's controller on one of them."""
    goals = random_goals(bounds.GOALS, SEED)
    found = {name: outcomes(profile, goals, SEED) for name, profile in PROFILES.items()}
    bound = {name: wanted(profile) for name, profile in PROFILES.items()}
    ours = [_row(name, one, bound[name]) for name, one in found.items()]
    ours += [
        _row(f"{name}, calibrated", outcomes(profile, goals, SEED, calibrated=True), wanted(profile))
        for name, profile in PROFILES.items()
    ]
    ours += [
        _row(f"{name}, calibrated, other motors", _other_motors(profile, goals), wanted(profile))
        for name, profile in PROFILES.items()
    ]
    ours += [
        _row(
            f"{name}, calibrated, answers {1000 * NETWORK_S:.0f} ms late",
            outcomes(profile, goals, SEED, calibrated=True, network_s=NETWORK_S),
            wanted(profile),
        )
        for name, profile in PROFILES.items()
    ]
    few = _row(f"{COMPARED}, the first {THE_REPORT_S_GOALS}", found[COMPARED][:THE_REPORT_S_GOALS], bound[COMPARED])
    return [
        *ours,
        bound_by_hops(goals),
        *_presets(goals),
        few,
        _row(f"{COMPARED}, the report's controller", the_report_s(), None),
    ]


def _other_motors(profile: Profile, goals: list[tuple[float, float, float]]) -> list[Outcome]:
    """The same goals in cameras that differ in how fast all is, each ten of them in another one."""
    shares = [goals[first : first + EACH] for first in range(0, len(goals), EACH)]
    return [
        one
        for camera, share in enumerate(shares)
        for one in outcomes(with_other_motors(profile, camera), share, camera, calibrated=True)
    ]


def bound_by_hops(goals: list[tuple[float, float, float]]) -> Row:
    """What the same goals take at least by the relative form, reckoned from the simulator's constants."""
    profile, lens = PROFILES[RELATIVE], load(WORLD).cameras["ip1"].lens
    plane = (lens.width / (2 * lens.fx), lens.height / (2 * lens.fy))
    hops, motors = Hops(plane, profile.latency_s, profile.latency_spread_s), constants(profile)
    ways = list(pairwise(goals))
    seconds = [least_by_hops(here, goal, motors, hops) for here, goal in ways]
    ratios = [one / least_time(*way, motors) for one, way in zip(seconds, ways, strict=True)]
    name = f"{RELATIVE}, least by the relative form"
    return Row(
        name, len(ways), median(seconds), median(ratios), max(ratios), 0, 0, 0, 0, 0.0, 0, bounds.MEDIAN_POSITIONS
    )


def _presets(goals: list[tuple[float, float, float]]) -> list[Row]:
    """Where a preset is near the goal, on every firmware, and where one lies beside it."""
    near, beside = bounds.NEAR_DEG, bounds.BESIDE_DEG
    return [
        *(
            _row(
                f"{name}, calibrated, preset within {near:g} deg",
                with_presets(profile, goals, SEED, near, calibrated=True),
                bounds.MEDIAN_POSITIONS,
            )
            for name, profile in PROFILES.items()
        ),
        _row(
            f"{COMPARED}, preset within {beside:g} deg",
            with_presets(PROFILES[COMPARED], goals, SEED, beside),
            bounds.MEDIAN_BESIDE,
        ),
    ]


def the_report_s() -> list[Outcome]:
    """The report's controller on the first of the goals."""
    rig, found = Rig(PROFILES[COMPARED], SEED), []
    rig.wire.now = rig.now

    def wait(seconds: float) -> None:
        rig.wire.now += seconds

    address = "http://192.0.2.9"
    with httpx.Client(base_url=address, transport=rig.wire, auth=httpx.DigestAuth("ros", "secret123")) as http:
        controller = ReportController(http, wait)
        for goal in random_goals(bounds.GOALS, SEED)[:THE_REPORT_S_GOALS]:
            rig.now = rig.wire.now
            here, began, pushed = rig.truth(), rig.now, rig.pushed()
            rig.wire.commands = rig.wire.requests = 0
            controller.go(*goal)
            rig.now = rig.wire.now
            there = rig.truth()
            off = max(abs(LIMITS.unwrap(there[0]) - LIMITS.unwrap(goal[0])), abs(there[1] - goal[1]))
            least = least_time(here, goal, constants(rig.profile))
            counts = rig.wire.commands, rig.wire.requests
            rests = not any(rig.device.motion(rig.now)[1])
            found.append(Outcome(goal, rig.now - began, least, *counts, off, 0.0, rests, rig.pushed() - pushed))
    assert rig.now > START
    return found


def _row(name: str, found: list[Outcome], bound: float | None) -> Row:
    commands = [one.commands for one in found]
    return Row(
        name=name,
        goals=len(found),
        seconds=median(one.seconds for one in found),
        ratio=median(one.ratio for one in found),
        worst=max(one.ratio for one in found),
        commands=median(commands),
        most_commands=max(commands),
        over=sum(count > bounds.COMMANDS for count in commands),
        requests=sum(one.requests for one in found) / sum(commands),
        off=max(one.off for one in found),
        pushed=sum(one.pushed > 0 for one in found),
        bound=bound,
    )
