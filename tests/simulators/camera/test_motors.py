"""What the motors do, on a clock that the test moves."""

from __future__ import annotations

import pytest

from services.simulators.camera.motors import Axes, Motors, Pose, magnification, reading
from services.simulators.camera.profiles import Profile
from services.simulators.world import World


@pytest.fixture
def motors(world: World) -> Motors:
    return Motors(world.cameras["ip1"], Profile(), now=100.0)


def _started(motors: Motors, at: Pose, code: str, speed: int, *, flip: bool = True, mirror: bool = True) -> None:
    motors.place(at, 100.0)
    assert motors.start(code, speed, speed, 100.0, flip=flip, mirror=mirror)


@pytest.mark.parametrize(
    ("code", "speed", "seconds", "expected"),
    [
        ("Right", 1, 0.3, Pose(10.3, 30.0, 0.0)),  # the smallest step: start and stop 0.3 s apart
        ("Left", 1, 0.3, Pose(9.7, 30.0, 0.0)),
        ("Right", 8, 1.0, Pose(55.0, 30.0, 0.0)),
        ("Left", 8, 1.0, Pose(325.0, 30.0, 0.0)),  # through 0
        ("Up", 4, 1.0, Pose(10.0, 24.0, 0.0)),
        ("Down", 4, 1.0, Pose(10.0, 36.0, 0.0)),
        ("RightDown", 4, 1.0, Pose(20.0, 36.0, 0.0)),
        ("ZoomTele", 0, 1.0, Pose(10.0, 30.0, 4.0)),
        ("ZoomWide", 0, 1.0, Pose(10.0, 30.0, 0.0)),
        ("Right", 99, 1.0, Pose(55.0, 30.0, 0.0)),  # above 8 counts as 8
    ],
)
def test_a_start_moves_until_it_is_stopped(
    motors: Motors, code: str, speed: int, seconds: float, expected: Pose
) -> None:
    _started(motors, Pose(10.0, 30.0, 0.0), code, speed)
    motors.stop(code, 100.0 + seconds)
    assert motors.pose(200.0) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("code", "flip", "mirror", "expected"),
    [
        ("Right", False, False, Pose(9.0, 30.0, 0.0)),
        ("Right", False, True, Pose(11.0, 30.0, 0.0)),
        ("Up", False, False, Pose(10.0, 30.6, 0.0)),
        ("Up", True, False, Pose(10.0, 29.4, 0.0)),
    ],
)
def test_mirror_and_flip_swap_the_directions(
    motors: Motors, code: str, flip: bool, mirror: bool, expected: Pose
) -> None:
    _started(motors, Pose(10.0, 30.0, 0.0), code, 1, flip=flip, mirror=mirror)
    motors.stop(code, 101.0)
    assert motors.pose(110.0) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("at", "code", "end"),
    [
        (Pose(170.0, 0.0, 0.0), "Right", Pose(179.0, 0.0, 0.0)),
        (Pose(190.0, 0.0, 0.0), "Left", Pose(186.0, 0.0, 0.0)),
        (Pose(10.0, 100.0, 0.0), "Down", Pose(10.0, 108.0, 0.0)),
        (Pose(10.0, 0.0, 0.0), "Up", Pose(10.0, -10.0, 0.0)),
        (Pose(10.0, 0.0, 6.0), "ZoomTele", Pose(10.0, 0.0, 8.0)),
    ],
)
def test_a_motion_ends_at_its_end_stop(motors: Motors, at: Pose, code: str, end: Pose) -> None:
    _started(motors, at, code, 8)
    assert motors.pose(160.0) == pytest.approx(end)
    assert motors.rates(160.0) == (0.0, 0.0, 0.0)


def test_the_way_to_the_other_side_of_the_dead_arc_leads_through_zero(motors: Motors) -> None:
    motors.place(Pose(170.0, 20.0, 0.0), 100.0)
    motors.go(Pose(190.0, 20.0, 0.0), 100.0)
    seen = [motors.pose(100.0 + i / 10).pan for i in range(90)]
    assert not any(179.0 < pan < 186.0 for pan in seen)
    assert seen[80] == pytest.approx(190.0)
    assert seen[79] != pytest.approx(190.0)  # 340 degrees: 340/45 + 45/120 s = 7.93 s


@pytest.mark.parametrize(("vertical", "horizontal"), [(0, 4), (4, 0)])
def test_a_diagonal_with_a_zero_speed_is_ignored(motors: Motors, vertical: int, horizontal: int) -> None:
    assert not motors.start("LeftUp", vertical, horizontal, 100.0, flip=True, mirror=True)
    assert motors.pose(101.0) == motors.pose(100.0)


def test_a_stop_with_another_code_leaves_the_motion_running(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 2)
    motors.stop("Left", 101.0)
    motors.stop("Right", 102.0)
    assert motors.pose(103.0).pan == pytest.approx(6.0)


def test_a_start_of_another_kind_replaces_the_motion(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 2)
    motors.start("Down", 0, 1, 101.0, flip=True, mirror=True)
    motors.stop("Down", 102.0)
    assert motors.pose(103.0) == pytest.approx(Pose(3.0, 20.6, 0.0))


def test_the_rates_are_those_of_the_readings(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "RightDown", 8)
    assert motors.rates(100.5) == pytest.approx(Pose(45.0, 27.0, 0.0))


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        (Pose(10.04, 30.06, 0.9), Pose(10.0, 30.1, 0.0)),
        (Pose(359.97, -0.04, 1.1), Pose(0.0, 0.0, 2.0)),
        (Pose(100.0, 20.0, 7.2), Pose(100.0, 20.0, 8.0)),
    ],
)
def test_a_reading_has_tenths_of_degrees_and_five_zoom_levels(pose: Pose, expected: Pose) -> None:
    assert reading(pose) == expected


def test_magnification_runs_from_one_to_three() -> None:
    assert [magnification(zoom) for zoom in (0.0, 4.0, 8.0)] == [1.0, 2.0, 3.0]


# Speed 8 of pan is 45 degrees/s at 120 degrees/s^2: 0.375 s and 8.4375 degrees to full speed, and as much to rest.
HITS_S = 0.375 + (9.0 - 8.4375) / 45.0  # from 9 degrees before an end stop


@pytest.mark.parametrize(
    ("after_s", "pan", "speed"),
    [
        (0.1, 0.6, 12.0),  # a t^2 / 2
        (0.375, 8.4375, 45.0),
        (1.0, 45.0 - 8.4375, 45.0),
        (1.1, 45.0 - 8.4375 + 4.5 - 0.6, 33.0),  # 0.1 s of slowing down
        (1.375, 45.0, 0.0),
        (9.0, 45.0, 0.0),
    ],
)
def test_speed_grows_and_falls_evenly(motors: Motors, after_s: float, pan: float, speed: float) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 8)
    if after_s > 1.0:
        motors.stop("Right", 101.0)
    assert motors.pose(100.0 + after_s).pan == pytest.approx(pan)
    assert motors.rates(100.0 + after_s).pan == pytest.approx(speed, abs=1e-9)


def test_a_start_too_short_for_full_speed_goes_as_far_as_the_acceleration_allows(motors: Motors) -> None:
    _started(motors, Pose(10.0, 20.0, 0.0), "Right", 8)
    motors.stop("Right", 100.05)
    assert motors.pose(101.0).pan == pytest.approx(10.0 + 120.0 * 0.05**2)


@pytest.mark.parametrize(
    ("goal", "seconds"),
    [
        (Pose(90.0, 20.0, 0.0), 90.0 / 45.0 + 0.375),
        (Pose(10.0, 20.0, 0.0), 2 * (10.0 / 120.0) ** 0.5),  # never at full speed
        (Pose(0.0, 74.0, 0.0), 54.0 / 27.0 + 27.0 / 90.0),
        (Pose(0.0, 20.0, 8.0), 8.0 / 4.0 + 4.0 / 40.0),
    ],
)
def test_a_goal_takes_the_time_of_its_trapezoid(motors: Motors, goal: Pose, seconds: float) -> None:
    start = Pose(0.0, 20.0, 0.0)
    motors.place(start, 100.0)
    motors.go(goal, 100.0)
    halfway = [(a + b) / 2 for a, b in zip(start, goal, strict=True)]
    assert motors.pose(100.0 + seconds / 2) == pytest.approx(halfway)
    assert any(motors.rates(100.0 + seconds - 0.01))
    assert motors.pose(100.0 + seconds + 1e-6) == pytest.approx(goal)
    assert not any(motors.rates(100.0 + seconds + 1e-6))


def test_turning_round_takes_the_way_of_the_braking_first(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 8)
    motors.start("Left", 0, 8, 101.0, flip=True, mirror=True)
    assert motors.pose(101.375).pan == pytest.approx(45.0)
    assert motors.rates(101.375).pan == pytest.approx(0.0, abs=1e-9)
    assert motors.pose(101.75).pan == pytest.approx(45.0 - 8.4375)
    assert motors.rates(101.75).pan == pytest.approx(-45.0)


def test_a_goal_behind_is_reached_after_braking(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 8)
    motors.go(Pose(0.0, 20.0, 0.0), 101.0)
    assert motors.pose(101.375).pan == pytest.approx(45.0)
    seconds = 45.0 / 45.0 + 0.375  # from rest, 45 degrees back
    assert any(motors.rates(101.375 + seconds - 0.01))
    assert motors.pose(101.375 + seconds).pan == pytest.approx(0.0, abs=1e-9)


def test_a_goal_that_is_passed_while_braking_is_come_back_to(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 8)
    here = 45.0 - 8.4375
    motors.go(Pose(here + 5.0, 20.0, 0.0), 101.0)
    assert motors.pose(101.375).pan == pytest.approx(here + 8.4375)
    assert motors.pose(105.0).pan == pytest.approx(here + 5.0)


def test_a_timed_motion_ends_by_itself(motors: Motors) -> None:
    motors.place(Pose(10.0, 20.0, 0.0), 100.0)
    motors.turn("Continuously", Axes(-24.0, 9.0, 0.0), 100.0, 2.0)
    assert motors.rates(101.99) == pytest.approx(Pose(24.0, 9.0, 0.0))
    assert motors.pose(110.0) == pytest.approx(Pose(58.0, 38.0, 0.0))
    assert not any(motors.rates(110.0))


def test_a_timed_motion_shorter_than_its_acceleration_still_ends(motors: Motors) -> None:
    motors.place(Pose(10.0, 20.0, 0.0), 100.0)
    motors.turn("Continuously", Axes(-45.0, 0.0, 0.0), 100.0, 0.1)
    assert motors.pose(100.2).pan == pytest.approx(10.0 + 120.0 * 0.1**2)
    assert not any(motors.rates(100.21))


def test_seconds_of_pushing_count_from_the_end_stop_until_the_stop(motors: Motors) -> None:
    _started(motors, Pose(170.0, 20.0, 0.0), "Right", 8)
    assert motors.worked(100.0 + HITS_S - 0.01).pushed_s.pan == 0.0
    assert motors.worked(100.0 + HITS_S + 0.5).pushed_s.pan == pytest.approx(0.5)
    motors.stop("Right", 100.0 + HITS_S + 1.0)
    assert motors.worked(200.0).pushed_s == pytest.approx(Axes(1.0, 0.0, 0.0))
    assert motors.worked(200.0).travelled == pytest.approx(Axes(9.0, 0.0, 0.0))


def test_a_diagonal_pushes_with_the_axis_that_is_at_its_end(motors: Motors) -> None:
    _started(motors, Pose(170.0, 20.0, 0.0), "RightDown", 8)
    motors.stop("RightDown", 100.0 + HITS_S + 1.0)
    worked = motors.worked(200.0)
    assert worked.pushed_s == pytest.approx(Axes(1.0, 0.0, 0.0))
    assert worked.travelled == pytest.approx(Axes(9.0, 27.0 * (HITS_S + 1.0), 0.0))


def test_braking_into_an_end_stop_pushes_for_the_rest_of_the_braking(motors: Motors) -> None:
    _started(motors, Pose(165.0, 20.0, 0.0), "Right", 8)
    motors.stop("Right", 100.375)  # at full speed, 5.5625 degrees before the end
    left = (45.0**2 - 2 * 120.0 * (14.0 - 8.4375)) ** 0.5  # the speed on impact
    assert motors.pose(110.0).pan == pytest.approx(179.0)
    assert motors.worked(110.0).pushed_s.pan == pytest.approx(left / 120.0)


def test_a_camera_that_turns_away_from_its_end_stop_does_not_push(motors: Motors) -> None:
    _started(motors, Pose(179.0, 20.0, 0.0), "Left", 8)
    motors.stop("Left", 101.0)
    assert motors.pose(110.0).pan == pytest.approx(134.0)
    assert motors.worked(110.0).pushed_s.pan == 0.0


def test_the_way_there_and_back_is_counted_twice(motors: Motors) -> None:
    motors.place(Pose(0.0, 20.0, 0.0), 100.0)
    for number, pan in enumerate((30.0, 0.0)):
        motors.go(Pose(pan, 20.0, 0.0), 110.0 + 10 * number)
    assert motors.worked(200.0).travelled == pytest.approx(Axes(60.0, 0.0, 0.0))
    assert motors.worked(200.0).motions == 2


def test_the_past_is_remembered_as_it_was(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 8)
    motors.stop("Right", 101.0)
    motors.start("Down", 0, 1, 101.2, flip=True, mirror=True)
    assert motors.pose(100.375).pan == pytest.approx(8.4375)
    assert motors.rates(100.5).pan == pytest.approx(45.0)


def test_what_was_placed_by_hand_has_no_past(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 8)
    motors.place(Pose(90.0, 20.0, 0.0), 105.0)
    assert motors.pose(104.9) == motors.pose(106.0) == pytest.approx(Pose(90.0, 20.0, 0.0))
