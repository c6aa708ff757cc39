"""What the motors do, on a clock that the test moves."""

from __future__ import annotations

import pytest

from services.simulators.camera.motors import Motors, Pose, magnification, reading
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
    assert motors.pose(101.0) == pytest.approx(expected)


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
    assert motors.motion is None
    assert motors.rates(160.0) == (0.0, 0.0, 0.0)


def test_the_way_to_the_other_side_of_the_dead_arc_leads_through_zero(motors: Motors) -> None:
    motors.place(Pose(170.0, 20.0, 0.0), 100.0)
    motors.go(Pose(190.0, 20.0, 0.0), 100.0)
    seen = [motors.pose(100.0 + i / 10).pan for i in range(90)]
    assert not any(179.0 < pan < 186.0 for pan in seen)
    assert seen[-1] == pytest.approx(190.0)
    assert seen[70] != pytest.approx(190.0)  # 340 degrees at 45 degrees/s


@pytest.mark.parametrize(("vertical", "horizontal"), [(0, 4), (4, 0)])
def test_a_diagonal_with_a_zero_speed_is_ignored(motors: Motors, vertical: int, horizontal: int) -> None:
    assert not motors.start("LeftUp", vertical, horizontal, 100.0, flip=True, mirror=True)
    assert motors.motion is None


def test_a_stop_with_another_code_leaves_the_motion_running(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 2)
    motors.stop("Left", 101.0)
    assert motors.pose(102.0).pan == pytest.approx(6.0)


def test_a_start_of_another_kind_replaces_the_motion(motors: Motors) -> None:
    _started(motors, Pose(0.0, 20.0, 0.0), "Right", 2)
    motors.start("Down", 0, 1, 101.0, flip=True, mirror=True)
    assert motors.pose(102.0) == pytest.approx(Pose(3.0, 20.6, 0.0))


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
