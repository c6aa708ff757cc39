"""Every firmware in cameras that nobody has seen: no figure of the simulator's own motors is taken for granted."""

from __future__ import annotations

from copy import deepcopy

import pytest

from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.skill import Skill
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.profiles import Profile
from tests import bounds
from tests.camera.goals import Outcome, Rig, outcomes, random_goals, with_other_motors

CAMERAS = range(1, 7)
GOALS = 25
COLD_CAMERAS, COLD_GOALS = range(1, 21), 6
PUSHED = 1  # two late answers in a row do that to one in some thousands
WITHIN_COMMANDS = 0.97
RATE, ZOOM_RATE = 0.05, 0.03  # of the truth, off it after calibrating
DOUBT = 0.08  # of a rate; the fastest ones have room for hardly a second
SLOW_DEG_S = 0.1  # readings are a tenth of a degree off, and a leg takes 1.5 s


@pytest.fixture(scope="module", params=sorted(PROFILES))
def calibrated(request: pytest.FixtureRequest) -> list[tuple[Rig, Skill]]:
    """Every one of those cameras, and what was learnt of it; a test that moves one leaves that as it was."""
    rigs = [Rig(with_other_motors(PROFILES[request.param], camera), camera) for camera in CAMERAS]
    for rig in rigs:
        rig.calibrate()
    return [(rig, deepcopy(rig.skill)) for rig in rigs]


@pytest.fixture(scope="module")
def moved(calibrated: list[tuple[Rig, Skill]]) -> list[Outcome]:
    """Goals of every one of those cameras, calibrated."""
    return [one for rig, _ in calibrated for one in rig.visit(random_goals(GOALS, rig.seed))]


def test_every_goal_is_reached_and_the_camera_rests_when_done_is_said(moved: list[Outcome]) -> None:
    assert [one for one in moved if one.error or one.off > bounds.OFF_DEG or not one.rests] == []
    assert sum(one.pushed > 0 for one in moved) <= PUSHED


def test_a_goal_takes_few_commands(moved: list[Outcome]) -> None:
    few = [one.commands <= bounds.COMMANDS for one in moved]
    assert sum(few) >= WITHIN_COMMANDS * len(few)


@pytest.mark.parametrize("name", sorted(PROFILES))
def test_the_first_goals_too_end_at_rest_however_slow_its_zoom_is(name: str) -> None:
    """Before anything was learnt: coarse readings of zoom show hardly that it still turns."""
    found = [
        one
        for camera in COLD_CAMERAS
        for one in outcomes(with_other_motors(PROFILES[name], camera), random_goals(COLD_GOALS, camera), camera)
    ]
    assert [one for one in found if one.error or one.off > bounds.OFF_DEG or not one.rests] == []


def test_calibrating_learns_every_speed_of_every_axis(calibrated: list[tuple[Rig, Skill]]) -> None:
    for rig, skill in calibrated:
        _knows(skill, rig.profile)


def _knows(skill: Skill, profile: Profile) -> None:
    for axis, share in ((PAN, 1.0), (TILT, profile.tilt_share)):
        pace = skill.paces[axis]
        for speed, rate in enumerate(profile.pan_speeds, 1):
            assert pace.doubt(speed) <= DOUBT * pace.rate(speed) + SLOW_DEG_S
            assert pace.rate(speed) == pytest.approx(rate * share, rel=RATE, abs=SLOW_DEG_S + 2 * pace.doubt(speed))
    assert skill.paces[ZOOM].rate(1) == pytest.approx(profile.zoom_speed, rel=ZOOM_RATE)
    assert skill.drive(ZOOM).rate(1) == pytest.approx(profile.zoom_speed, rel=ZOOM_RATE)
