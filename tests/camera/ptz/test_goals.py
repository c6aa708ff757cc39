"""Random goals on every firmware that the simulator has, in virtual time, against the bounds.

Fifty goals from a cold start, and that three times: with one seed alone a median may be a tenth off.
"""

from __future__ import annotations

from statistics import median

import pytest

from services.simulators.camera.firmwares import PROFILES
from tests import bounds
from tests.camera.goals import Outcome, outcomes, positions, random_goals

SEEDS = (1, 2, 3)


@pytest.fixture(scope="module", params=sorted(PROFILES))
def moved(request: pytest.FixtureRequest) -> tuple[str, list[Outcome]]:
    profile = PROFILES[request.param]
    return request.param, [one for seed in SEEDS for one in outcomes(profile, random_goals(bounds.GOALS, seed), seed)]


def test_every_goal_is_reached_within_half_a_degree_and_at_rest_when_done_is_said(
    moved: tuple[str, list[Outcome]],
) -> None:
    _, found = moved
    assert [one for one in found if one.error or one.off > bounds.OFF_DEG or not one.rests] == []


def test_no_motor_is_pushed_against_the_end_of_its_way(moved: tuple[str, list[Outcome]]) -> None:
    _, found = moved
    assert [one for one in found if one.pushed] == []


def test_the_motors_take_hardly_longer_than_they_must(
    moved: tuple[str, list[Outcome]], request: pytest.FixtureRequest
) -> None:
    name, found = moved
    if PROFILES[name].position_abs == "pan-only":
        why = "answers take longer here and tilt goes by start and stop: 2.1 to 2.4 is what it takes"
        request.applymarker(pytest.mark.xfail(reason=why, strict=True))
    bound = bounds.MEDIAN_POSITIONS if positions(PROFILES[name]) else bounds.MEDIAN_START_STOP
    assert median(one.ratio for one in found) <= bound


def test_a_goal_takes_few_commands(moved: tuple[str, list[Outcome]]) -> None:
    _, found = moved
    assert median(one.commands for one in found) <= bounds.COMMANDS - 2
    few = [one.commands <= bounds.COMMANDS for one in found]
    assert sum(few) >= bounds.WITHIN_COMMANDS * len(few)
