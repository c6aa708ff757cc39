"""OpenHAB's string forms: what is a state or a command of which item type, and what number it stands for."""

from __future__ import annotations

import contextlib
from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.errors import BadMessage
from services.states import (
    COMMAND_WORDS,
    ITEM_TYPES,
    NO_COMMANDS,
    STATE_WORDS,
    base_type,
    check_command,
    check_state,
    color,
    moment,
    moment_text,
    number,
    parts,
    percent,
    plain,
    quantity,
)

MORNING = datetime(2026, 1, 31, 7, 5, tzinfo=timezone(timedelta(hours=1)))

# Item type, state as OpenHAB writes it, its number.
STATES = [
    ("Switch", "ON", 1),
    ("Switch", "OFF", 0),
    ("Contact", "OPEN", 1),
    ("Contact", "CLOSED", 0),
    ("Number", "21.5", 21.5),
    ("Number", "-3", -3),
    ("Number", "+4", 4),
    ("Number", "1.2E-7", 1.2e-7),
    ("Number", "1e3", 1000),
    ("Number", "5 kW", 5),
    ("Number:Temperature", "21.5 °C", 21.5),
    ("Number:Temperature", "-0.4 °F", -0.4),
    ("Number:Temperature", "294.65 K", 294.65),
    ("Number:Temperature", "21.5", 21.5),
    ("Number:DataTransferRate", "5 MB/s", 5),
    ("Number:Density", "1.2E1 µg/m³", 12),
    ("Number:ElectricResistance", "3 Ω", 3),
    ("Number:Dimensionless", "40 %", 40),
    ("Number:Dimensionless", "0.4", 0.4),
    ("Number:Dimensionless", "0.4 one", 0.4),
    ("Number:Power", "3.2e2 W", 320),
    ("String", "any text, even ON", None),
    ("String", "", None),
    ("Dimmer", "0", 0),
    ("Dimmer", "60", 60),
    ("Dimmer", "33.3", 33.3),
    ("Dimmer", "100", 100),
    ("Dimmer", "ON", 100),
    ("Dimmer", "OFF", 0),
    ("Rollershutter", "45", 45),
    ("Rollershutter", "UP", 0),
    ("Rollershutter", "DOWN", 100),
    ("Color", "120,100,50", 50),
    ("Color", "359.5,12.25,0", 0),
    ("DateTime", "2026-01-31T07:05:00.000+0100", 1769839500_000_000),
    ("DateTime", "2026-01-31T07:05:00.123456+0100", 1769839500_123_456),
    ("DateTime", "2026-01-31T07:05:00.000-0330", 1769855700_000_000),
    ("Location", "41.38,2.11", None),
    ("Location", "41.38,-2.11,30", None),
    ("Player", "PLAY", 1),
    ("Player", "PAUSE", 0),
    ("Player", "REWIND", 0),
    ("Player", "FASTFORWARD", 1),
    ("Call", "+34600000000,+34600000001", None),
    ("Image", "raw type (image/jpeg): 51234 bytes", None),
]

NOT_STATES = [
    *((kind, "") for kind in ITEM_TYPES if kind not in ("String", "Call", "Image")),
    ("Switch", "on"),
    ("Switch", "ON "),
    ("Switch", "1"),
    ("Switch", "OPEN"),
    ("Contact", "ON"),
    ("Number", "ON"),
    ("Number", "21,5"),
    ("Number", "1.2.3"),
    ("Number", "12:30"),
    ("Number", "2026-01-31"),
    ("Number", "NaN"),
    ("Number", "-NaN"),
    ("Number", "Infinity"),
    ("Number", "1e999"),
    ("Number", "0x10 "),
    ("Number", "٣"),
    ("Number", "21.5\n"),
    ("Number:Temperature", "°C"),
    ("Number:Temperature", "warm"),
    ("Dimmer", "101"),
    ("Dimmer", "-1"),
    ("Dimmer", "60 %"),
    ("Dimmer", "UP"),
    ("Dimmer", "INCREASE"),
    ("Rollershutter", "STOP"),
    ("Rollershutter", "ON"),
    ("Rollershutter", "100.1"),
    ("Color", "ON"),
    ("Color", "50"),
    ("Color", "120,100"),
    ("Color", "361,0,0"),
    ("Color", "0,101,0"),
    ("Color", "0,0,-1"),
    ("Color", "a,b,c"),
    ("Color", "1,2,1e999"),
    ("DateTime", "yesterday"),
    ("DateTime", "2026-02-30T07:05:00.000+0100"),
    ("DateTime", "2026-01-31x07:05:00.000+0100"),
    ("DateTime", "2026-W05-6"),
    ("DateTime", "999999999999999"),
    ("DateTime", "2026-01-31T07:05:00Nowhere/City"),
    ("DateTime", "2026-01-31T07:05:00Europe"),
    ("Location", "41.38"),
    ("Location", "41.38,2.11,30,1"),
    ("Location", "north,west"),
    ("Player", "NEXT"),
    ("Player", "STOP"),
]

COMMANDS = [
    *((kind, word) for kind, words in COMMAND_WORDS.items() for word in words),
    *((kind, "REFRESH") for kind in ITEM_TYPES),
    ("Number", "21.5"),
    ("Number:Temperature", "21.5 °C"),
    ("Number:Temperature", "21"),
    ("String", "hello"),
    ("String", ""),
    ("Dimmer", "35"),
    ("Rollershutter", "35"),
    ("Color", "120,100,50"),
    ("Color", "50"),
    ("DateTime", "2026-01-31T07:05:00.000+0100"),
    ("DateTime", "1769839500"),
    ("Location", "41.38,2.11"),
]

NOT_COMMANDS = [
    *((kind, word) for kind in ITEM_TYPES for word in ("UNDEF", "NULL")),
    *((kind, word) for kind in NO_COMMANDS for word in ("ON", "OPEN", "CLOSED", "")),
    ("Switch", "TOGGLE"),
    ("Switch", "INCREASE"),
    ("Switch", "0"),
    ("Number", "INCREASE"),
    ("Number", "ON"),
    ("Dimmer", "STOP"),
    ("Dimmer", "60 %"),
    ("Dimmer", "1000"),
    ("Rollershutter", "ON"),
    ("Rollershutter", "-5"),
    ("Color", "1,2"),
    ("Color", "UP"),
    ("Color", "101"),
    ("Player", "STOP"),
    ("DateTime", "now"),
    ("Location", "here"),
]

# Every form that OpenHAB reads for the same morning, in a home whose clock is one hour ahead.
MORNINGS = [
    "2026-01-31T07:05:00.000+0100",
    "2026-01-31T07:05:00+01:00",
    "2026-01-31T07:05+01",
    "2026-01-31T06:05:00Z",
    "2026-01-31T06:05:00.000000000Z",
    "2026-01-31 07:05:00 +0100",
    "2026-01-31T07:05:00Europe/Madrid",
    "2026-01-31T07:05:00CET",
    "2026-01-31T07:05:00",
    "2026-01-31 07:05",
    "1769839500",
    "1769839500000",
]


@pytest.mark.parametrize(("item_type", "text", "value"), STATES)
def test_a_state_is_accepted_and_has_its_number(item_type: str, text: str, value: float | None) -> None:
    assert number(item_type, text) == (None if value is None else pytest.approx(value))
    check_state(item_type, text)


@pytest.mark.parametrize(("item_type", "text"), NOT_STATES)
def test_what_is_no_state_of_the_type_is_refused(item_type: str, text: str) -> None:
    with pytest.raises(BadMessage, match="expected"):
        check_state(item_type, text)


@pytest.mark.parametrize("item_type", [*ITEM_TYPES, "Number:Temperature"])
@pytest.mark.parametrize("text", ["UNDEF", "NULL"])
def test_undefined_is_a_state_of_every_type_without_a_number(item_type: str, text: str) -> None:
    assert number(item_type, text) is None


@pytest.mark.parametrize(("item_type", "text"), COMMANDS)
def test_a_command_of_the_type_is_accepted(item_type: str, text: str) -> None:
    check_command(item_type, text)


@pytest.mark.parametrize(("item_type", "text"), NOT_COMMANDS)
def test_what_openhab_would_not_take_as_a_command_is_refused(item_type: str, text: str) -> None:
    with pytest.raises(BadMessage):
        check_command(item_type, text)


def test_a_refused_command_to_a_contact_says_what_to_use_instead() -> None:
    with pytest.raises(BadMessage, match="use `set`"):
        check_command("Contact", "OPEN")


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [
        ("21.5 °C", 21.5, "°C"),
        ("21.5°C", 21.5, "°C"),
        ("5", 5.0, ""),
        ("-1.5e-3 A", -0.0015, "A"),
        ("5e", 5.0, "e"),
        ("1E3 W", 1000.0, "W"),
        ("40 %", 40.0, "%"),
        ("0.4 one", 0.4, ""),
        (".5 m", 0.5, "m"),
        ("20 m/s²", 20.0, "m/s²"),
    ],
)
def test_a_quantity_is_a_number_and_a_unit(text: str, value: float, unit: str) -> None:
    assert quantity(text) == (value, unit)


@pytest.mark.parametrize("text", MORNINGS)
def test_every_form_of_a_time_is_read(text: str) -> None:
    assert moment(text, MORNING.tzinfo) == MORNING


def test_a_date_alone_is_its_midnight_and_a_time_alone_is_of_1970() -> None:
    assert moment("2026-01-31", UTC) == datetime(2026, 1, 31, tzinfo=UTC)
    assert moment("07:05", UTC) == datetime(1970, 1, 1, 7, 5, tzinfo=UTC)


def test_a_time_without_an_offset_gets_this_machines_when_no_zone_is_given() -> None:
    assert moment("2026-01-31T07:05:00") == datetime(2026, 1, 31, 7, 5).astimezone()


@pytest.mark.parametrize(
    ("when", "text"),
    [
        (MORNING, "2026-01-31T07:05:00.000+0100"),
        (MORNING.astimezone(UTC), "2026-01-31T06:05:00.000+0000"),
        (MORNING.replace(microsecond=123_999), "2026-01-31T07:05:00.123+0100"),
        (datetime(2026, 7, 1, 12, tzinfo=timezone(-timedelta(hours=3, minutes=30))), "2026-07-01T12:00:00.000-0330"),
    ],
)
def test_a_time_is_written_as_openhab_writes_it(when: datetime, text: str) -> None:
    assert moment_text(when) == text
    check_state("DateTime", text)


def test_a_time_without_an_offset_is_never_written() -> None:
    with pytest.raises(ValueError, match="offset"):
        moment_text(datetime(2026, 1, 31))


@given(st.datetimes(datetime(1900, 1, 1), datetime(2200, 1, 1), timezones=st.timezones()))
def test_what_is_written_is_the_same_time_when_read(when: datetime) -> None:
    minutes = when.utcoffset() or timedelta()
    fits = timezone(
        timedelta(minutes=minutes // timedelta(minutes=1))
    )  # old local mean times have seconds; OpenHAB's form not
    there = when.astimezone(fits).replace(microsecond=when.microsecond // 1000 * 1000)
    assert moment(moment_text(there)) == there


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_plain_number_has_no_exponent_and_reads_back_the_same(value: float) -> None:
    text = plain(value)
    assert "e" not in text.lower()
    assert quantity(text) == (value, "")


SHORT = [(21.0, "21"), (21.5, "21.5"), (-0.0, "0"), (1e-7, "0.0000001"), (1e16, "1" + "0" * 16)]


@pytest.mark.parametrize(("value", "text"), SHORT)
def test_a_plain_number_is_as_short_as_openhab_writes_it(value: float, text: str) -> None:
    assert plain(value) == text


@given(st.sampled_from([*ITEM_TYPES, "Number:Temperature"]), st.text() | st.from_regex(r"[0-9.,:TZe+ -]{0,30}"))
def test_any_text_is_accepted_or_refused_and_nothing_else_happens(item_type: str, text: str) -> None:
    for check in (check_state, check_command):
        with contextlib.suppress(BadMessage):
            check(item_type, text)


@given(st.floats(0, 360), st.floats(0, 100), st.floats(0, 100))
def test_every_color_within_bounds_is_one(hue: float, saturation: float, brightness: float) -> None:
    text = ",".join(plain(part) for part in (hue, saturation, brightness))
    assert color(text) == (hue, saturation, brightness)
    assert number("Color", text) == brightness


def test_words_are_states_of_the_types_that_have_them() -> None:
    for kind, words in STATE_WORDS.items():
        assert base_type(kind) in ITEM_TYPES
        for word, value in words.items():
            assert number(kind, word) == value


def test_percent_and_parts_name_what_came() -> None:
    with pytest.raises(BadMessage, match="got '101'"):
        percent("101")
    with pytest.raises(BadMessage, match="got '1;2'"):
        parts("1;2", 2, 2)
