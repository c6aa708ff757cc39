"""The air alone: weather, rooms, vapour."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.simulators.climate import (
    FREE_HEAT_K,
    FROST_C,
    LOWERED_K,
    RADIATOR_K,
    Room,
    outside,
    relative,
    saturation,
    season,
    vapour_outside,
    wander,
    wanted,
)

MOMENTS = st.datetimes(datetime(2000, 1, 1), datetime(2100, 1, 1), timezones=st.just(UTC))


@given(st.integers(), MOMENTS)
def test_the_weather_stays_within_a_temperate_year(seed: int, local: datetime) -> None:
    assert -5 < outside(seed, local) < 35
    assert 200 < vapour_outside(seed, local) < 2500
    later = outside(seed, local + timedelta(seconds=30))
    day_ends = (local + timedelta(seconds=30)).date() != local.date()  # the season goes on by whole days
    assert abs(later - outside(seed, local)) < (0.3 if day_ends else 0.1)


def test_summer_is_warm_and_winter_is_cold() -> None:
    assert season(datetime(2026, 7, 19)) == pytest.approx(24, abs=0.1)
    assert season(datetime(2026, 1, 19)) == pytest.approx(6, abs=0.1)


@pytest.mark.parametrize(("celsius", "pascal"), [(0.0, 611.2), (20.0, 2339), (30.0, 4246)])
def test_saturation_is_as_in_the_tables(celsius: float, pascal: float) -> None:
    assert saturation(celsius) == pytest.approx(pascal, rel=0.006)  # what the formula claims for itself


def test_warmer_air_with_the_same_vapour_is_drier() -> None:
    assert relative(1170, 20.0) == pytest.approx(50, abs=0.3)
    assert relative(1170, 25.0) < 40
    assert (relative(1e5, 20.0), relative(0.0, 20.0)) == (98.0, 5.0)


@given(st.text(max_size=5), st.floats(0, 2e9))
def test_wandering_stays_between_its_ends(key: str, time: float) -> None:
    assert -1 <= wander(key, time) <= 1


@pytest.mark.parametrize(
    ("mode", "night", "aim"),
    [
        ("manual", True, 21.0),
        ("auto", False, 21.0),
        ("auto", True, 21.0 - LOWERED_K),
        ("eco", False, 21.0 - LOWERED_K),
        ("OFF", False, FROST_C),
        ("party", True, 21.0),
    ],
)
def test_a_mode_changes_what_is_aimed_at(mode: str, night: bool, aim: float) -> None:
    assert wanted(21.0, mode, night=night) == aim


@given(st.floats(-20, 35), st.floats(5, 30), st.floats(5, 30))
def test_a_room_never_leaves_what_heating_and_weather_allow(outdoor: float, setpoint: float, start: float) -> None:
    room = Room("x", start, 1000.0)
    for step in range(200):
        room.step(300.0, outdoor, 1000.0, setpoint, 300.0 * step)
        assert min(start, outdoor) <= room.celsius <= max(start, outdoor + 2 * FREE_HEAT_K + RADIATOR_K)


def test_a_heated_room_settles_near_what_is_wanted() -> None:
    room = Room("x", 15.0, 1000.0)
    for step in range(2000):
        room.step(30.0, 5.0, 800.0, 21.0, 30.0 * step)
    assert room.celsius == pytest.approx(21.0, abs=0.5)
