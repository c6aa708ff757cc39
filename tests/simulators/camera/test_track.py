"""Whatever a motor is told, it stays what a motor is: no jumps, no speed out of nothing, not beyond its end stops."""

from __future__ import annotations

from itertools import pairwise
from math import inf

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from services.simulators.camera.track import Moment, Rail, Track, go, run, stand

RAIL = Rail(1.0, 354.0, (1.0, 10.0, 45.0), 120.0)
STEP_S = 0.01
Order = tuple[str, float, float, float]  # what, with which number, for how long, how long until the next

ORDERS = st.lists(
    st.tuples(
        st.sampled_from(["run", "go"]),
        st.floats(-45.0, 400.0),
        st.sampled_from([0.05, 0.5, 3.0, inf]),
        st.floats(0.01, 4.0),
    ),
    min_size=1,
    max_size=6,
)


def _begun(order: Order, at: Moment, now: float) -> Track:
    what, number, seconds, _ = order
    if what == "go":
        return go(RAIL, at, now, number, 45.0)
    return run(RAIL, at, now, max(min(number, 45.0), -45.0), seconds)


def _seen(orders: list[Order], start: float) -> list[tuple[float, Moment, float]]:
    """When, where and how fast, and how long it has pushed since its last order."""
    track, now, seen = stand(start, 0.0), 0.0, []
    for order in orders:
        track = _begun(order, track.at(now), now)
        steps = round(order[3] / STEP_S)
        seen += [(now + i * STEP_S, track.at(now + i * STEP_S), track.pushed(now + i * STEP_S)) for i in range(steps)]
        now += steps * STEP_S
    return seen


@given(ORDERS, st.floats(1.0, 354.0))
def test_a_motor_never_jumps_nor_leaves_its_rail(orders: list[Order], start: float) -> None:
    for (_, before, _), (_, after, _) in pairwise(_seen(orders, start)):
        assert RAIL.low - 1e-6 <= after.position <= RAIL.high + 1e-6
        assert abs(after.speed) <= 45.0 + 1e-6
        assert abs(after.position - before.position) <= 45.0 * STEP_S + 1e-6


@given(ORDERS, st.floats(1.0, 354.0))
@example([("go", 0.0, 0.05, 3.8125), ("run", 1.0, 0.05, 1.0)], 157.0)  # rounding: at rest at its end, all but 1e-7
def test_speed_changes_with_the_acceleration_except_at_an_end_stop(orders: list[Order], start: float) -> None:
    for (_, before, pushed), (_, after, pushed_on) in pairwise(_seen(orders, start)):
        at_an_end = min(after.position - RAIL.low, RAIL.high - after.position) < 1e-6
        if not (at_an_end and after.speed == 0.0):
            assert abs(after.speed - before.speed) <= RAIL.acceleration * STEP_S + 1e-6
        near_one = min(after.position - RAIL.low, RAIL.high - after.position) <= 45.0 * STEP_S
        assert near_one or pushed_on <= pushed


@given(st.floats(1.0, 354.0), st.floats(-45.0, 45.0), st.floats(-50.0, 400.0))
def test_a_goal_is_reached_from_any_motion(start: float, speed: float, goal: float) -> None:
    track = go(RAIL, Moment(start, speed), 0.0, goal, 45.0)
    assert track.ends < 20.0
    assert track.at(track.ends + 1e-6) == Moment(min(max(goal, 1.0), 354.0), 0.0)
    before = track.at(track.ends - 1e-6)
    assert before.position == pytest.approx(min(max(goal, 1.0), 354.0), abs=1e-3)


@given(st.floats(1.0, 354.0), st.floats(-45.0, 45.0))
def test_coming_to_rest_takes_the_speed_over_the_acceleration(start: float, speed: float) -> None:
    track = run(RAIL, Moment(start, speed), 0.0, 0.0)
    assert track.ends == pytest.approx(abs(speed) / 120.0)
    assert track.at(1.0).speed == 0.0
