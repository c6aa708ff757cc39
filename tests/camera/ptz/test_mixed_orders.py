"""Orders as people and scans give them: to presets and beside them, a little farther than the last one, at any time.

Random goals are far from each other and from all presets, so what goes wrong on a short way does not show there.
"""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from tests import bounds
from tests.camera.goals import LIMITS, Goal, Outcome, Rig, random_goals, with_other_motors

SEQUENCES = range(30)
OTHERS = range(100, 110)  # in cameras whose motors are drawn at random
EACH = 40
PRESETS = 6
BESIDE_DEG = (0.1, 0.4, 0.6, 0.8, 1.2, 2.5)
FARTHER_DEG = (0.3, 0.7, 2.0, 6.0)
PAUSES_S = (0.0, 0.1, 0.5, 1.0, 3.0)


def about(goal: Goal, most: float, rng: random.Random) -> Goal:
    """One up to so many degrees beside it, on the same side of the dead arc."""
    low, high = (186.5, 359.9) if goal[0] > 180.0 else (0.0, 178.5)
    pan, tilt = (place + rng.uniform(-most, most) for place in goal[:2])
    return round(min(high, max(low, pan)), 1), round(min(107.5, max(-9.5, tilt)), 1), goal[2]


def mixed(profile: Profile, seed: int) -> list[Outcome]:
    """One sequence, in a camera that was calibrated or not."""
    rng = random.Random(seed)
    rig = Rig(profile, seed, network_s=rng.choice((0.0, 0.004)))
    if rng.random() < 0.5:
        rig.calibrate()
    presets = dict(enumerate(random_goals(PRESETS, seed + len(SEQUENCES)), start=1))
    rig.device.ptz.presets.update({number: (str(number), Pose(*place)) for number, place in presets.items()})
    found: list[Outcome] = []
    for goal in random_goals(EACH, seed):
        kind = rng.random()
        if kind < 0.35:
            goal = about(presets[rng.randint(1, PRESETS)], rng.choice(BESIDE_DEG), rng)
        elif kind < 0.6 and found:
            goal = about(found[-1].goal, rng.choice(FARTHER_DEG), rng)
        found.append(rig.go(goal, presets=presets))
        rig.now += rng.choice(PAUSES_S)
    return found


@pytest.mark.parametrize("name", sorted(PROFILES))
def test_every_order_ends_at_its_goal_and_at_rest(name: str) -> None:
    profile = PROFILES[name]
    found = [one for seed in SEQUENCES for one in mixed(profile, seed)]
    found += [one for seed in OTHERS for one in mixed(with_other_motors(profile, seed), seed)]
    assert [one for one in found if one.error or one.off > bounds.OFF_DEG or one.pushed or not one.rests] == []


def test_where_an_end_that_nobody_read_is_hardly_at_the_next_goal_it_is_read() -> None:
    """It may be a little off, and then the goal would be farther than half a degree."""
    rig = Rig(PROFILES["ip2m-841b-strict"])
    rig.calibrate()
    assert rig.near is not None
    rig.near = replace(rig.near, pan=(rig.near.pan + 0.12) % 360.0, moving=None)
    outcome = rig.go((round((rig.near.pan + 0.4) % 360.0, 2), rig.near.tilt, rig.near.zoom))
    assert outcome.commands
    assert outcome.off <= bounds.OFF_DEG
    assert outcome.rests


def test_firmware_that_once_seemed_to_ignore_tilt_is_believed_again_when_it_leads_it() -> None:
    """One that ends two degrees beside what it is asked for stays where it is, asked for two degrees more."""
    rig = Rig(PROFILES["ip4m-1041b"])
    rig.skill.honours["PositionABS"] = "pan"
    found = rig.visit(random_goals(3, 1))
    assert [one for one in found if one.off > bounds.OFF_DEG or not one.rests] == []
    assert rig.skill.honours["PositionABS"] == "yes"


def test_a_reading_of_just_before_the_end_is_not_taken_for_one_of_the_rest() -> None:
    """Nobody has told that the camera rested there, so a next goal that it is hardly near is looked at first."""
    profile = with_other_motors(PROFILES["ip4m-1041b"], 102)
    rig = Rig(profile, 102, network_s=0.004)
    rig.calibrate()
    for goal in random_goals(30, 102):
        rig.go(goal)
        assert rig.near is not None
        pan, tilt, _ = rig.truth()
        rests = LIMITS.pose(replace(rig.near, pan=pan, tilt=tilt))
        off = max(abs(read - true) for read, true in zip(LIMITS.pose(rig.near), rests, strict=True))
        assert off < 0.15 or rig.near.moving is None
        rig.now += 1.0
