"""Devices alone: units, forms, and a shutter's way."""

from __future__ import annotations

from datetime import UTC

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.apartment.home import Item
from services.errors import BadMessage
from services.simulators.devices import TRAVEL_S, Shutter, convert, kept


@pytest.mark.parametrize(
    ("value", "unit", "wanted", "result"),
    [
        (21.5, "", "°C", 21.5),
        (21.5, "°C", "°C", 21.5),
        (68.0, "°F", "°C", 20.0),
        (294.65, "K", "°C", 21.5),
        (20.0, "°C", "°F", 68.0),
        (1.5, "kW", "W", 1500.0),
        (5.0, "ppm", "ppm", 5.0),
    ],
)
def test_a_value_is_converted(value: float, unit: str, wanted: str, result: float) -> None:
    assert convert(value, unit, wanted) == result


@pytest.mark.parametrize(("unit", "wanted"), [("W", "°C"), ("furlong", "°C"), ("°C", ""), ("°C", "ppm")])
def test_units_that_do_not_go_together_are_refused(unit: str, wanted: str) -> None:
    with pytest.raises(BadMessage):
        convert(1.0, unit, wanted)


@pytest.mark.parametrize(
    ("item_type", "text", "form"),
    [
        ("Number", "5 kW", "5"),
        ("Number:Temperature", "21.50", "21.5 °C"),
        ("Number:Dimensionless", "0.4 one", "0.4"),
        ("Dimmer", "ON", "100"),
        ("Rollershutter", "UP", "0"),
        ("Color", "ON", "10,20,100"),
        ("Location", "41.38,2.11,30", "41.38,2.11,30"),
        ("DateTime", "2026-01-31T07:05:00Z", "2026-01-31T07:05:00.000+0000"),
        ("String", "21,5", "21,5"),
        ("Switch", "UNDEF", "UNDEF"),
    ],
)
def test_an_item_keeps_a_state_in_openhabs_form(item_type: str, text: str, form: str) -> None:
    assert kept(Item(type=item_type, label="x"), "10,20,30", text, UTC) == form


def test_a_shutter_moves_evenly_and_takes_its_time() -> None:
    shutter = Shutter()
    shutter.command("DOWN", 100.0)
    assert [shutter.at(100 + TRAVEL_S * part) for part in (0, 0.25, 0.5, 1, 2)] == [0, 25, 50, 100, 100]
    assert shutter.moving(100 + TRAVEL_S - 0.1)
    assert not shutter.moving(100 + TRAVEL_S)


@given(st.lists(st.tuples(st.floats(0, 20), st.sampled_from(["UP", "DOWN", "STOP", "MOVE", "0", "37.5", "100"]))))
def test_a_shutter_never_leaves_its_rail_or_jumps(orders: list[tuple[float, str]]) -> None:
    shutter, now = Shutter(), 0.0
    for wait, order in orders:
        before = shutter.at(now)
        now += wait
        assert abs(shutter.at(now) - before) <= wait * 100 / TRAVEL_S + 1e-6
        here = shutter.at(now)
        shutter.command(order, now)
        assert shutter.at(now) == here
        assert 0 <= here <= 100
