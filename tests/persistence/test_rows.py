"""From messages to rows, and from rows back to states."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services import states
from services.apartment.home import Home, Item
from services.bus import Message
from services.errors import BadMessage
from services.payloads import Diagnostic, OrderResult, Point, Quaternion, ScanResult, ScanState
from services.payloads.robot import MissionEvent, MissionResult, MissionState
from services.persistence import rows
from services.storage import CameraOrder, Mission, Sample, Scan, Sighting
from services.storage import Diagnostic as DiagnosticRow
from services.topics import (
    CAMERA_ORDER_RESULT,
    CAMERA_SCAN_RESULT,
    CAMERA_SCAN_STATE,
    DIAGNOSTICS,
    HOME_STATE,
    MISSION_RESULT,
    MISSION_STATE,
    read,
)  # fmt: skip

T = 1_769_839_200_000_000  # 2026-01-31 06:00 UTC
SEEN = ScanResult(
    camera="ip1", marker=582, dictionary="DICT_5X5_1000", place="Kitchen", position=Point(x=1.0, y=2.0, z=0.5),
    covariance=[[4e-4, 0, 0], [0, 9e-4, 0], [0, 0, 1e-4]], orientation=Quaternion(x=0, y=0, z=0, w=1), distance=3.1,
    zoom=2, frames=8, mode="bw", scan="s1",
    first_seen="2026-01-31T05:59:59.500Z", stamp="2026-01-31T07:00:00.123+01:00",
)  # fmt: skip


def home_of(item_type: str | None, unit: str | None = None) -> Home:
    """A home with the item `X`, or without it."""
    return Home(items={"X": Item(type=item_type, label="x", unit=unit)} if item_type else {})


def row_of(message: Message, home: Home | None = None) -> object:
    return rows.read(read(message, 0.0), T, home or Home(items={}))


def sample_of(item_type: str | None, text: str, unit: str | None = None) -> tuple[float | None, str | None]:
    """Number and text of the row of a state."""
    state = row_of(HOME_STATE.message(text, item="X"), home_of(item_type))
    assert isinstance(state, rows.State)
    sample = rows.sample(state, unit)
    assert (sample.item, sample.time) == ("X", T)
    return sample.num, sample.text


STATES = [
    # type, text, unit of the item, number, text
    ("Number", "21.5", None, 21.5, None),
    ("Number:Temperature", "21.5 °C", "°C", 21.5, None),
    ("Number:Temperature", "21.50 °C", "°C", 21.5, None),
    ("Number:Temperature", "21.5", "°C", 21.5, None),
    ("Number:Temperature", "70 °F", "°C", None, "70 °F"),
    ("Number", "-1e-3", None, -0.001, None),
    ("Number", "UNDEF", "°C", None, "UNDEF"),
    ("Number", "NULL", None, None, "NULL"),
    ("Dimmer", "60", None, 60.0, None),
    ("Dimmer", "ON", None, 100.0, None),
    ("Rollershutter", "UP", None, 0.0, None),
    ("Switch", "ON", None, 1.0, "ON"),
    ("Switch", "UNDEF", None, None, "UNDEF"),
    ("Contact", "CLOSED", None, 0.0, "CLOSED"),
    ("Color", "120,100,50", None, 50.0, "120,100,50"),
    ("Player", "PLAY", None, 1.0, "PLAY"),
    ("DateTime", "2026-01-31T07:00:00.000+0100", None, float(T), "2026-01-31T07:00:00.000+0100"),
    ("Location", "40.4,-3.7", None, None, "40.4,-3.7"),
    ("String", "Salón 🏠", None, None, "Salón 🏠"),
    (None, "21.5 °C", None, None, "21.5 °C"),
    (None, "", None, None, ""),
]


@pytest.mark.parametrize(("item_type", "text", "unit", "num", "stored"), STATES)
def test_a_state_becomes_a_number_a_text_or_both(
    item_type: str | None, text: str, unit: str | None, num: float | None, stored: str | None
) -> None:
    assert sample_of(item_type, text, unit) == (num, stored)


BAD = [
    ("Number", "warm"),
    ("Number", "1e999"),
    ("Switch", "on"),
    ("Dimmer", "101"),
    ("Color", "1,2"),
    ("DateTime", "0001-01-01T00:00:00"),
    ("Number", "1 " + "m" * 33),
]


@pytest.mark.parametrize(("item_type", "text"), BAD)
def test_a_state_that_its_item_cannot_have_is_refused(item_type: str, text: str) -> None:
    with pytest.raises(BadMessage):
        row_of(HOME_STATE.message(text, item="X"), home_of(item_type))


def test_an_item_with_an_endless_name_is_refused() -> None:
    with pytest.raises(BadMessage, match="item: expected at most 200"):
        row_of(HOME_STATE.message("ON", item="X" * 201))


TEXTS = [
    ((21.0, None), "°C", "21 °C"),
    ((21.5, None), None, "21.5"),
    ((1e16, None), None, "1e+16"),
    ((1.0, "ON"), None, "ON"),
    ((None, "70 °F"), "°C", "70 °F"),
    ((None, "UNDEF"), "°C", "UNDEF"),
]


@pytest.mark.parametrize(("value", "unit", "text"), TEXTS)
def test_a_row_becomes_a_state_again(value: tuple[float | None, str | None], unit: str | None, text: str) -> None:
    assert rows.state_text(Sample("X", T, *value), unit) == text


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_survives_the_way_there_and_back(number: float) -> None:
    text = rows.state_text(Sample("X", T, number, None), "W")
    back = states.number("Number:Power", text)
    assert back is not None
    assert math.isclose(back, number, rel_tol=0)


def test_a_scan_result_becomes_a_sighting_with_standard_deviations() -> None:
    row = row_of(CAMERA_SCAN_RESULT.message(SEEN, cam="ip1"))
    assert isinstance(row, Sighting)
    assert (row.scan, row.marker, row.place, row.mode, row.frames) == ("s1", 582, "Kitchen", "bw", 8)
    assert (row.x, row.y, row.z, row.qw) == (1.0, 2.0, 0.5, 1.0)
    assert (row.sx, row.sy, row.sz) == pytest.approx((0.02, 0.03, 0.01))
    assert (row.stamp, row.first_seen) == (T + 123_000, T - 500_000)


def test_a_sighting_without_a_position_says_why() -> None:
    seen = SEEN.model_copy(update={"position": None, "covariance": None, "orientation": None, "why": "w" * 300})
    row = row_of(CAMERA_SCAN_RESULT.message(seen, cam="ip1"))
    assert isinstance(row, Sighting)
    assert (row.x, row.sx, row.qx) == (None, None, None)
    assert row.why == "w" * 199 + "…"


@pytest.mark.parametrize(
    "change",
    [
        {"marker": 2**40},
        {"scan": "s" * 65},
        {"stamp": "2112-01-01T00:00:00Z"},
        {"first_seen": "1969-12-31T00:00:00Z"},
    ],
)
def test_a_sighting_that_no_table_holds_is_refused(change: dict[str, object]) -> None:
    with pytest.raises(BadMessage):
        row_of(CAMERA_SCAN_RESULT.message(SEEN.model_copy(update=change), cam="ip1"))


def test_a_scan_began_its_elapsed_time_ago_and_ends_when_it_says_so() -> None:
    running = ScanState(state="running", scan="s1", targets=[582, 17], frames_taken=3, elapsed_s=2.5)
    done = running.model_copy(update={"state": "done", "found": [582], "elapsed_s": 9.0})
    assert row_of(CAMERA_SCAN_STATE.message(running, cam="ip1")) == Scan(
        "s1", "ip1", "running", "582,17", "", T - 2_500_000, None, 3, 0
    )
    assert row_of(CAMERA_SCAN_STATE.message(done, cam="ip1")) == Scan(
        "s1", "ip1", "done", "582,17", "582", T - 9_000_000, T, 3, 0
    )


def test_an_idle_camera_makes_no_scan() -> None:
    assert row_of(CAMERA_SCAN_STATE.message(ScanState(state="idle"), cam="ip1")) is None
    assert row_of(CAMERA_SCAN_STATE.message(ScanState(state="idle", scan="s1"), cam="ip1")) is None


def test_a_scan_that_began_before_1970_is_refused() -> None:
    with pytest.raises(BadMessage, match="elapsed_s"):
        row_of(CAMERA_SCAN_STATE.message(ScanState(state="running", scan="s", elapsed_s=1e300), cam="ip1"))


def test_an_order_keeps_its_value_as_text() -> None:
    order = OrderResult(id="o1", key="Scan", value={"targets": [582]}, state="refused", error="no such place")
    assert row_of(CAMERA_ORDER_RESULT.message(order, cam="ip1")) == CameraOrder(
        "o1", "ip1", "Scan", '{"targets": [582]}', "refused", "no such place", T
    )


def test_a_mission_began_its_elapsed_time_before_its_step_and_ends_with_its_story() -> None:
    since = "1970-01-01T00:01:00.000Z"
    going = MissionState(state="go", id="m1", marker=582, place="Sofa", reason="to Sofa", since=since, elapsed_s=20.0)
    assert row_of(MISSION_STATE.message(going, robot="tiago")) == Mission(
        "m1", "tiago", 582, "go", "to Sofa", "Sofa", None, None, None, None, 40_000_000, None, None
    )
    event = MissionEvent(at_s=1.5, state="go", text="to the Küche")
    done = MissionResult(id="m1", marker=582, state="found", reason="seen", place="Sofa", by="tiago", elapsed_s=30.0,
                         position=Point(x=1, y=2, z=0.5), story=[event], stamp="1970-01-01T00:01:10.000Z")  # fmt: skip
    assert row_of(MISSION_RESULT.message(done, robot="tiago")) == Mission(
        "m1", "tiago", 582, "found", "seen", "Sofa", 1.0, 2.0, 0.5, "tiago", 40_000_000, 70_000_000,
        '[[1.5, "go", "to the Küche"]]',
    )  # fmt: skip


def test_a_robot_without_a_mission_makes_none() -> None:
    idle = MissionState(state="idle", since="1970-01-01T00:01:00.000Z")
    assert row_of(MISSION_STATE.message(idle, robot="tiago")) is None


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"since": "yesterday"}, "time: expected one like"),
        ({"since": "2026-01-31T07:05:00"}, "time: expected one like"),
        ({"elapsed_s": 1e300}, "elapsed_s: expected a time from 1970"),
        ({"marker": 2**40}, "marker: expected 32 bits"),
        ({"id": "x" * 65}, "id: expected at most 64 characters"),
    ],
)
def test_a_mission_that_no_table_holds_is_refused(change: dict[str, object], why: str) -> None:
    going = MissionState(state="go", id="m1", marker=582, since="2026-01-31T07:05:00.000Z")
    with pytest.raises(BadMessage, match=why):
        row_of(MISSION_STATE.message(going.model_copy(update=change), robot="tiago"))


def test_a_diagnostic_keeps_its_values_as_json() -> None:
    told = Diagnostic(level=2, message="é" * 1200, values={"temperature": "80 °C"}, hardware_id="cam")
    assert row_of(DIAGNOSTICS.message(told, component="camera/ip1")) == DiagnosticRow(
        "camera/ip1", T, 2, "é" * 999 + "…", '{"hardware_id": "cam", "values": {"temperature": "80 °C"}}'
    )
