"""Random goals on every firmware that the simulator has, in virtual time, against the bounds.

Fifty goals from a cold start, and that five times: with one seed alone a median may be a tenth off, with three a
twentieth.
"""

from __future__ import annotations

from statistics import median

import pytest

from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.motors import Pose
from tests import bounds
from tests.camera.goals import Outcome, Rig, outcomes, random_goals, wanted, wanted_cold, with_presets

SEEDS = range(1, 6)
BESIDE_DEG = 3.0


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


def test_the_motors_take_hardly_longer_than_they_must(moved: tuple[str, list[Outcome]]) -> None:
    name, found = moved
    assert median(one.ratio for one in found) <= wanted_cold(PROFILES[name])


def test_a_goal_takes_few_commands(moved: tuple[str, list[Outcome]]) -> None:
    _, found = moved
    assert median(one.commands for one in found) <= bounds.COMMANDS - 2
    few = [one.commands <= bounds.COMMANDS for one in found]
    assert sum(few) >= bounds.COLD_WITHIN_COMMANDS * len(few)


@pytest.fixture(scope="module", params=sorted(PROFILES))
def calibrated(request: pytest.FixtureRequest) -> tuple[str, list[list[Outcome]]]:
    """Of each seed the goals, in cameras that were calibrated."""
    profile = PROFILES[request.param]
    return request.param, [outcomes(profile, random_goals(bounds.GOALS, seed), seed, calibrated=True) for seed in SEEDS]


def test_fifty_goals_of_a_calibrated_camera_are_within_every_bound(calibrated: tuple[str, list[list[Outcome]]]) -> None:
    """The table that `make bench` prints."""
    name, (found, *_) = calibrated
    assert [one for one in found if one.error or one.off > bounds.OFF_DEG or one.pushed or not one.rests] == []
    assert max(one.commands for one in found) <= bounds.COMMANDS
    assert median(one.ratio for one in found) <= wanted(PROFILES[name])


def test_a_calibrated_camera_takes_few_commands_from_its_first_goal_on(
    calibrated: tuple[str, list[list[Outcome]]],
) -> None:
    name, tables = calibrated
    found = [one for table in tables for one in table]
    assert [one for one in found if one.error or one.off > bounds.OFF_DEG or one.pushed or not one.rests] == []
    assert max(table[0].commands for table in tables) <= bounds.COMMANDS
    assert max(one.commands for one in found) <= bounds.COMMANDS + bounds.CORRECTION
    few = [one.commands <= bounds.COMMANDS for one in found]
    assert sum(few) >= bounds.CALIBRATED_WITHIN_COMMANDS * len(few)
    assert max(median(one.ratio for one in table) for table in tables) <= wanted(PROFILES[name])


def test_no_first_goal_is_crept_to() -> None:
    """With few commands left a slow leg costs none of them, but nobody waits for it: a stop first costs two."""
    profile = PROFILES["ip3m-943b"]
    first = [one for seed in range(60) for one in outcomes(profile, random_goals(3, seed), seed)]
    assert max(one.seconds for one in first) < 30.0


def test_where_beside_the_goal_will_do_it_is_met_with_fewer_commands_and_sooner() -> None:
    first, beside = [], []
    for seed in SEEDS:
        exact, rough = (Rig(PROFILES["ip3m-941w-2019"], seed) for _ in range(2))
        for pan, tilt, _ in random_goals(bounds.GOALS, seed):
            first.append(exact.go((pan, tilt, 0.0)))
            beside.append(rough.go((pan, tilt, 0.0), near=BESIDE_DEG))
    assert all(one.off <= BESIDE_DEG + 0.1 and one.rests and not one.pushed and not one.error for one in beside)
    assert median(one.commands for one in beside) < median(one.commands for one in first)
    assert median(one.seconds for one in beside) < 0.85 * median(one.seconds for one in first)


WITHOUT_POSITIONS = ("ip3m-941w-2019", "ip2m-841b-strict", "dahua-pan-only")


@pytest.mark.parametrize("name", sorted(PROFILES))
def test_where_a_preset_is_near_the_goal_its_move_is_all_it_takes(name: str) -> None:
    found = [
        one
        for seed in SEEDS
        for one in with_presets(
            PROFILES[name], random_goals(bounds.GOALS, seed), seed, bounds.NEAR_DEG, calibrated=True
        )
    ]
    assert [one for one in found if one.error or one.off > bounds.OFF_DEG or one.pushed or not one.rests] == []
    assert max(one.commands for one in found) <= bounds.COMMANDS
    assert median(one.ratio for one in found) <= bounds.MEDIAN_POSITIONS


@pytest.mark.parametrize("name", WITHOUT_POSITIONS)
@pytest.mark.parametrize(
    ("beside", "bound"), [(bounds.NEAR_DEG, bounds.MEDIAN_POSITIONS), (bounds.BESIDE_DEG, bounds.MEDIAN_BESIDE)]
)
def test_a_preset_near_the_goal_or_beside_it_saves_time(name: str, beside: float, bound: float) -> None:
    """From beside it a start, its end, and a reading at rest follow: three answers of 0.3 s."""
    found = [
        one for seed in SEEDS for one in with_presets(PROFILES[name], random_goals(bounds.GOALS, seed), seed, beside)
    ]
    assert [one for one in found if one.error or one.off > bounds.OFF_DEG or one.pushed or not one.rests] == []
    assert median(one.ratio for one in found) <= bound


@pytest.mark.parametrize("name", ["dahua-pan-only", "ip2m-841b-strict", "ip3m-941w-2016", "ip4m-1051b-2019"])
@pytest.mark.parametrize("beside", [0.6, 1.0])
def test_a_preset_just_beside_the_goal_is_not_taken_for_the_goal(name: str, beside: float) -> None:
    """On its last bit of way there the camera passes the goal, and a look may tell of that moment."""
    found = [
        one for seed in SEEDS for one in with_presets(PROFILES[name], random_goals(bounds.GOALS, seed), seed, beside)
    ]
    assert [one for one in found if one.off > bounds.OFF_DEG or one.error or not one.rests] == []


@pytest.mark.parametrize("name", WITHOUT_POSITIONS)
def test_presets_lead_to_their_places_however_often_they_are_gone_to(name: str) -> None:
    """A reading on the last bit of the way is enough to go on, but if it were learnt, each round would end earlier."""
    rig = Rig(PROFILES[name])
    tour = {number: (goal[0], goal[1], 0.0) for number, goal in enumerate(random_goals(9, 1), start=1)}
    rig.device.ptz.presets.update({number: (str(number), Pose(*place)) for number, place in tour.items()})
    rounds = [rig.go(place, presets=tour) for _ in range(10) for place in tour.values()]
    assert max(one.off for one in rounds) < 0.3
    assert sum(one.commands > 4 for one in rounds[9:]) <= 1
