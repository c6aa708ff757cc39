"""The regulator against a small motor model, in virtual time."""

from __future__ import annotations

import random
from statistics import median

import pytest

from services.camera.device import Reading, Refused, Start
from services.camera.ptz.goal import Limits
from services.camera.ptz.move import goto
from services.camera.ptz.skill import Skill
from tests.camera.motors import Motors, drive

LIMITS = Limits()


def off(motors: Motors, pan: float, tilt: float) -> float:
    return max(abs(LIMITS.unwrap(motors.pose[0]) - LIMITS.unwrap(pan)), abs(motors.pose[1] - tilt))


@pytest.mark.parametrize("mirror", [True, False])
@pytest.mark.parametrize("diagonals", [True, False])
@pytest.mark.parametrize(("faster", "latency"), [(1.0, 0.3), (0.5, 0.05), (1.8, 0.3), (1.0, 0.02)])
def test_every_goal_is_reached_whatever_the_speeds_the_delay_and_the_sign(
    mirror: bool, diagonals: bool, faster: float, latency: float
) -> None:
    motors = Motors(mirror=mirror, faster=faster, latency=latency, jitter=latency / 3, diagonals=diagonals)
    skill, choose = Skill(), random.Random(7)
    times, requests = [], []
    for _ in range(12):
        pan, tilt = choose.choice([choose.uniform(0, 178), choose.uniform(187, 360)]), choose.uniform(-9, 107)
        motors.sent.clear()
        run, took = drive(goto(LIMITS.goal(pan, tilt, 0.0), LIMITS, skill, 1000.0 + 60), motors)
        assert run.error is None, run.error
        assert motors.running is None
        assert off(motors, pan, tilt) <= 0.5
        times.append(took)
        requests.append(len(motors.sent))
    assert median(times) < 14, times
    assert median(requests) < 20, requests


@pytest.mark.parametrize("faster", [0.5, 1.0, 1.8])
def test_an_axis_is_not_led_to_its_goal_before_it_was_seen_which_way_it_goes(faster: float) -> None:
    """Without diagonals only one axis shows that at a time; the other would run away from its goal meanwhile."""
    motors, tilts = Motors(mirror=False, faster=faster, diagonals=False), []
    run, _ = drive(
        goto(LIMITS.goal(57.6, -0.6, 0.0), LIMITS, Skill(), 1060.0),
        motors,
        seen=lambda reply: tilts.append(motors.pose[1]),
    )
    assert run.error is None
    assert max(tilts) < 20.0 + 15.0


def test_a_goal_beyond_the_dead_arc_is_reached_the_long_way_round() -> None:
    motors = Motors(pan=170.0)
    run, _ = drive(goto(LIMITS.goal(190.0, 20.0, 0.0), LIMITS, Skill(), 1060.0), motors)
    assert run.error is None
    assert off(motors, 190.0, 20.0) <= 0.5
    assert motors.pushed == 0.0


@pytest.mark.parametrize(("wanted", "edge"), [(180.0, 179.0), (184.9, 186.0), (182.0, 179.0)])
def test_a_goal_inside_the_dead_arc_goes_to_its_nearer_edge(wanted: float, edge: float) -> None:
    motors = Motors()
    run, _ = drive(goto(LIMITS.goal(wanted, 20.0, 0.0), LIMITS, Skill(), 1060.0), motors)
    assert run.result.clamped
    assert abs(run.result.reading.pan - edge) <= 0.5


@pytest.mark.parametrize(
    ("pan", "tilt", "zoom", "told"),
    [
        (361.0, 0.0, 0.0, "pan 361 is out of range 0 to 360"),
        (0.0, 109.0, 0.0, "tilt 109 is out of range -10 to 108"),
        (0.0, 0.0, 9.0, "zoom 9 is out of range 0 to 8"),
        (float("nan"), 0.0, 0.0, "pan nan is out of range 0 to 360"),
    ],
)
def test_a_goal_out_of_range_is_refused_with_the_range(pan: float, tilt: float, zoom: float, told: str) -> None:
    with pytest.raises(Refused, match=told):
        LIMITS.goal(pan, tilt, zoom)


def test_the_first_motion_of_an_axis_is_its_slowest() -> None:
    motors = Motors(mirror=False)
    drive(goto(LIMITS.goal(10.0, 60.0, 0.0), LIMITS, Skill(), 1060.0), motors)
    first = next(request for request in motors.sent if isinstance(request, Start))
    assert first.speed == 1


def test_zoom_is_reached_after_pan_and_tilt() -> None:
    motors = Motors()
    run, _ = drive(goto(LIMITS.goal(80.0, 30.0, 4.0), LIMITS, Skill(), 1060.0), motors)
    assert run.error is None
    assert motors.reading().zoom == 4.0


@pytest.mark.parametrize("seed", range(1, 13))
def test_an_axis_that_had_arrived_is_not_turned_again_because_its_reading_dithers(seed: int) -> None:
    motors, skill = Motors(dither=0.1, seed=seed), Skill(steady=-1)
    for sense in skill.senses:
        sense.sign, sense.sure = 1, True
    begun = Reading(90.0, 20.0, 0.0, moving=False)  # 0.28 degrees from its goal, but it may read 0.38 the next time
    run, _ = drive(goto(LIMITS.goal(60.0, 20.28, 0.0), LIMITS, skill, 1060.0, near=begun), motors)
    assert run.error is None, run.error
    assert {request.direction.value[1] for request in motors.sent if isinstance(request, Start)} == {0}


def test_a_camera_that_does_not_turn_ends_with_the_reason() -> None:
    motors = Motors(faster=0.0)
    run, _ = drive(goto(LIMITS.goal(10.0, 20.0, 0.0), LIMITS, Skill(), 1060.0), motors)
    assert "does not turn" in str(run.error)
    assert motors.running is None


def test_a_move_past_its_deadline_fails() -> None:
    motors = Motors()
    run, _ = drive(goto(LIMITS.goal(200.0, 80.0, 0.0), LIMITS, Skill(), 1003.0), motors)
    assert "in time" in str(run.error)
