"""From a message to what is stored. Pure: what is worth storing is in `strategies.py`, the writing in `service.py`.

Texts for people are cut to their column; a text that names something (an id, a camera) is never cut but refused.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from services import states
from services.apartment.home import Home
from services.errors import BadMessage
from services.payloads import Diagnostic, OrderResult, ScanResult, ScanState, seconds
from services.payloads.robot import MissionResult, MissionState
from services.storage import CameraOrder, Mission, Row, Sample, Scan, Sighting
from services.storage import Diagnostic as DiagnosticRow
from services.topics import (
    CAMERA_ORDER_RESULT,
    CAMERA_SCAN_RESULT,
    CAMERA_SCAN_STATE,
    DIAGNOSTICS,
    HOME_STATE,
    MISSION_RESULT,
    MISSION_STATE,
    Read,
)  # fmt: skip

UNKNOWN_KIND = "String"  # of an item that the home's model does not have
AS_NUMBER = ("Number", "Dimmer", "Rollershutter")  # kinds whose value is the number alone; the others keep their text
EARLIEST, LATEST = 1_000_000, (2**31 - 1) * 1_000_000  # what MariaDB's TIMESTAMP holds: 1970 to January 2038
MARKERS = range(-(2**31), 2**31)


class State(NamedTuple):
    """A legal state of an item, before the item's unit is known; `unit` is empty where the text had none."""

    item: str
    kind: str
    time: int
    text: str
    num: float | None
    unit: str
    retained: bool


def read(known: Read, time: int, home: Home) -> State | Row | None:
    """What a message says about a stored thing at `time` (microseconds); None when it says nothing new to keep.

    BadMessage when it is legal on the bus, and yet no state of that item or nothing that a table can hold.
    """
    if known.topic is HOME_STATE:
        return _state(known.levels["item"], known.payload, time, home, retained=known.message.retain)
    reader = READERS.get(known.topic.pattern)
    return reader(known, time) if reader else None


def _state(name: str, text: str, time: int, home: Home, *, retained: bool) -> State:
    item = home.items.get(name)
    kind = states.base_type(item.type) if item else UNKNOWN_KIND
    _name(name, 200, "item")
    unit = ""
    if kind == "Number" and text not in states.SPECIAL:
        num, unit = states.quantity(text)
        _name(unit, 32, "unit")
        return State(name, kind, time, text, num, unit, retained)
    return State(name, kind, time, text, states.number(kind, text), unit, retained)


def fits(state: State, unit: str | None) -> bool:
    """Whether a state's number may stand among those of an item in `unit`."""
    return not state.unit or not unit or state.unit == unit


def sample(state: State, unit: str | None) -> Sample:
    """The row of a state for an item whose numbers are in `unit`; a number in another unit is kept as the text."""
    if state.num is None or not fits(state, unit):
        return Sample(state.item, state.time, None, state.text)
    return Sample(state.item, state.time, state.num, None if state.kind in AS_NUMBER else state.text)


def state_text(stored: Sample, unit: str | None) -> str:
    """The state as OpenHAB writes it, from its row: the way back."""
    if stored.text is not None:
        return stored.text
    number = repr(stored.num).removesuffix(".0")
    return f"{number} {unit}" if unit else number


def _sighting(known: Read, _time: int) -> Sighting:
    seen: ScanResult = known.payload
    at, turned = seen.position, seen.orientation
    sx, sy, sz = _deviations(seen.covariance)
    return Sighting(
        scan=_name(seen.scan, 64, "scan"), camera=_name(seen.camera, 64, "camera"), marker=_marker(seen.marker),
        dictionary=_name(seen.dictionary, 40, "dictionary"), place=_cut(seen.place, 100),
        stamp=_time_of(seen.stamp), first_seen=_time_of(seen.first_seen),
        x=at.x if at else None, y=at.y if at else None, z=at.z if at else None,
        qx=turned.x if turned else None, qy=turned.y if turned else None, qz=turned.z if turned else None,
        qw=turned.w if turned else None, sx=sx, sy=sy, sz=sz, distance=seen.distance, zoom=seen.zoom,
        frames=seen.frames, mode=_cut(seen.mode, 10), why=_cut(seen.why, 200) if seen.why else None,
    )  # fmt: skip


def _deviations(covariance: Sequence[Sequence[float]] | None) -> tuple[float | None, float | None, float | None]:
    """Standard deviations of x, y, z in metres, the roots of the diagonal."""
    if covariance is None:
        return None, None, None
    diagonal = [covariance[axis][axis] for axis in range(3)]
    sx, sy, sz = (math.sqrt(value) if value >= 0 else None for value in diagonal)
    return sx, sy, sz


def _scan(known: Read, time: int) -> Scan | None:
    """A scan began `elapsed_s` ago, and ended when it said so; of an idle camera there is nothing to keep."""
    told: ScanState = known.payload
    if told.scan is None or told.state == "idle":
        return None
    return Scan(
        scan=_name(told.scan, 64, "scan"), camera=_name(known.levels["cam"], 64, "camera"), state=told.state,
        targets=_cut(",".join(map(str, told.targets)), 400), found=_cut(",".join(map(str, told.found)), 400),
        started=_within(time - told.elapsed_s * 1e6, "elapsed_s"), ended=None if told.state == "running" else time,
        frames_taken=told.frames_taken, frames_analysed=told.frames_analysed,
    )  # fmt: skip


def _order(known: Read, time: int) -> CameraOrder:
    told: OrderResult = known.payload
    value = told.value if isinstance(told.value, str) else json.dumps(told.value, ensure_ascii=False)
    return CameraOrder(
        order_id=_name(told.id, 64, "id"), camera=_name(known.levels["cam"], 64, "camera"), name=_cut(told.key, 20),
        value=_cut(value, 400), state=told.state, error=_cut(told.error, 400) if told.error else None, at=time,
    )  # fmt: skip


def _mission(known: Read, _time: int) -> Mission | None:
    """A mission under way; of a robot without one there is nothing to keep."""
    told: MissionState = known.payload
    if told.id is None or told.marker is None or told.state == "idle":
        return None
    started = _within(_time_of(told.since) - told.elapsed_s * 1e6, "elapsed_s")
    return Mission(
        mission=_name(told.id, 64, "id"), robot=_name(known.levels["robot"], 64, "robot"), marker=_marker(told.marker),
        state=told.state, reason=_cut(told.reason, 400), place=_cut(told.place, 200) if told.place else None,
        x=None, y=None, z=None, seen_by=None, started=started, ended=None, story=None,
    )  # fmt: skip


def _mission_end(known: Read, _time: int) -> Mission | None:
    told: MissionResult = known.payload
    if not told.id:
        return None
    at, ended = told.position, _time_of(told.stamp)
    story = [[one.at_s, one.state, one.text] for one in told.story]
    return Mission(
        mission=_name(told.id, 64, "id"), robot=_name(known.levels["robot"], 64, "robot"), marker=_marker(told.marker),
        state=told.state, reason=_cut(told.reason, 400), place=_cut(told.place, 200) if told.place else None,
        x=at.x if at else None, y=at.y if at else None, z=at.z if at else None,
        seen_by=_name(told.by, 64, "by") if told.by else None,
        started=_within(ended - told.elapsed_s * 1e6, "elapsed_s"), ended=ended,
        story=json.dumps(story, ensure_ascii=False) if story else None,
    )  # fmt: skip


def _diagnostic(known: Read, time: int) -> DiagnosticRow:
    told: Diagnostic = known.payload
    details = {"hardware_id": told.hardware_id, "values": told.values}
    text = json.dumps({key: value for key, value in details.items() if value}, ensure_ascii=False)
    component = _name(known.levels["component"], 200, "component")
    return DiagnosticRow(component, time, told.level, _cut(told.message, 1000), None if text == "{}" else text)


READERS: dict[str, Callable[[Read, int], Row | None]] = {
    CAMERA_SCAN_RESULT.pattern: _sighting,
    CAMERA_SCAN_STATE.pattern: _scan,
    CAMERA_ORDER_RESULT.pattern: _order,
    DIAGNOSTICS.pattern: _diagnostic,
    MISSION_STATE.pattern: _mission,
    MISSION_RESULT.pattern: _mission_end,
}


def _cut(text: str, limit: int) -> str:
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


def _name(text: str, limit: int, what: str) -> str:
    if len(text) > limit:
        raise BadMessage(f"{what}: expected at most {limit} characters, got {len(text)}")
    return text


def _time_of(text: str) -> int:
    try:
        return _within(seconds(text) * 1e6, "time")
    except ValueError as error:
        raise BadMessage(f"time: expected one like 2026-01-31T07:05:00Z, got {text[:40]!r}") from error


def _marker(number: int) -> int:
    if number not in MARKERS:
        raise BadMessage(f"marker: expected 32 bits, got {number}")
    return number


def _within(microseconds: float, what: str) -> int:
    if not EARLIEST <= microseconds <= LATEST:
        raise BadMessage(f"{what}: expected a time from 1970 to 2038")
    return round(microseconds)
