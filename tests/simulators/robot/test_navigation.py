"""How the simulated move_base ends a goal: reached, no way, somebody in the way, or another goal."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.simulators.robot import plan
from services.simulators.robot.body import SPEED, Body
from services.simulators.robot.navigation import NO_CONTROL, NO_PLAN, REACHED, RECOVERY_S, Navigation
from services.simulators.world import load

CONFIG = Path(__file__).parents[3] / "config"
STEP_S = 0.05


@pytest.fixture
def navigation() -> Navigation:
    world = load(CONFIG / "world.yaml")
    start = world.robots["tiago"].pose
    return Navigation(plan.grid(world), 0.28, Body(start.x, start.y, start.yaw_deg), fails=0, seed=1)


def drive(navigation: Navigation, longest_s: float = 60.0) -> tuple[float, tuple[bool, str] | None]:
    """Until it ends; in how many seconds, and how."""
    for step in range(round(longest_s / STEP_S)):
        if (end := navigation.advance(STEP_S)) is not None:
            return step * STEP_S, end
    return longest_s, None


def test_a_goal_is_reached_at_a_real_speed(navigation: Navigation) -> None:
    navigation.begin((4.2, 3.0), 90.0)
    seconds, end = drive(navigation)
    assert end == (True, REACHED)
    body = navigation.body
    assert (body.x, body.y) == pytest.approx((4.2, 3.0))
    assert body.yaw_deg == pytest.approx(90.0, abs=10.0)
    assert seconds > 1.85 / SPEED, "the straight way, and the turns"


def test_a_goal_in_a_wall_is_given_up_after_a_while(navigation: Navigation) -> None:
    navigation.begin((-5.0, -5.0), 0.0)
    assert drive(navigation) == (pytest.approx(RECOVERY_S, abs=0.2), (False, NO_PLAN))


def test_who_stands_in_the_way_stops_it_half_way_and_the_next_goal_is_free(navigation: Navigation) -> None:
    navigation.fails = 1
    navigation.begin((4.2, 3.0), 90.0)
    assert drive(navigation)[1] == (False, NO_CONTROL)
    assert 1.2 < navigation.body.y < 2.9
    navigation.begin((4.2, 3.0), 90.0)
    assert drive(navigation)[1] == (True, REACHED)


def test_it_stands_where_it_is_stopped(navigation: Navigation) -> None:
    navigation.begin((4.2, 3.0), 90.0)
    drive(navigation, 2.0)
    navigation.stop()
    at = (navigation.body.x, navigation.body.y)
    drive(navigation, 2.0)
    assert (navigation.body.x, navigation.body.y) == at
