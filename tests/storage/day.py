"""One day at home as messages of the bus, 2026-01-31: what the queries in fixtures/history/queries.sql ask about."""

from __future__ import annotations

from datetime import UTC, datetime

from services.apartment.home import Home, Item
from services.bus import Message
from services.payloads import Diagnostic, Point, ScanResult, ScanState, stamp
from services.topics import CAMERA_SCAN_RESULT, CAMERA_SCAN_STATE, DIAGNOSTICS, HOME_STATE

HOME = Home(
    items={
        "Lab_Temp": Item(
            type="Number:Temperature", label="Lab", unit="°C", persist=("everyUpdate", "restoreOnStartup")
        ),
        "Kitchen_Light": Item(type="Switch", label="Light"),
        "Front_Door": Item(type="Contact", label="Door"),
        "Hall_Dimmer": Item(type="Dimmer", label="Hall"),
        "Lamp_Color": Item(type="Color", label="Lamp"),
        "Cam1_Goto": Item(type="String", label="Goto"),
    }
)
STATES = {
    "Lab_Temp": "06:00 20.0 °C; 06:30 20.5 °C; 07:00 21.5 °C; 07:30 UNDEF; 08:00 22.0 °C; "
    "08:30:00.250 21.0 °C; 09:00 21.0 °C",
    "Kitchen_Light": "06:10 ON; 06:40 OFF; 07:15:00.250 ON; 08:45:00.250 OFF",
    "Front_Door": "06:05 CLOSED; 07:14:58 OPEN; 07:15:02 CLOSED",
    "Hall_Dimmer": "06:00:00 0; 07:00 60; 08:00 100",
    "Lamp_Color": "07:00 120,100,50",
    "Cam1_Goto": "07:05 Kitchen; 07:06 Salón",
}
SIGHTINGS = [
    ("s1", 582, "Living room", "07:20", Point(x=1.234, y=0.87, z=0.74)),
    ("s2", 582, "Kitchen", "08:20", Point(x=3.1, y=0.4, z=0.9)),
    ("s2", 17, "Kitchen", "08:20:03", Point(x=3.3, y=0.5, z=0.9)),
]
SCANS = [
    ("s1", "done", "07:18", "07:20:10"),
    ("s2", "done", "08:18", "08:20:30"),
    ("s3", "cancelled", "08:50", "08:50:40"),
]
LEVELS = [("06:00", 0), ("07:40", 2), ("07:42:30", 0)]


def at(clock: str) -> float:
    """Seconds since 1970 of a time of that day, UTC."""
    return datetime.fromisoformat(f"2026-01-31T{clock}").replace(tzinfo=UTC).timestamp()


def messages() -> list[Message]:
    """The whole day, in order."""
    told = [*_states(), *_sightings(), *_scans(), *_levels()]
    return sorted(told, key=lambda message: message.received)


def _states() -> list[Message]:
    return [
        _at(pair.partition(" ")[0], HOME_STATE.message(pair.partition(" ")[2], item=item))
        for item, pairs in STATES.items()
        for pair in pairs.split("; ")
    ]


def _sightings() -> list[Message]:
    return [
        _at(
            clock,
            CAMERA_SCAN_RESULT.message(
                ScanResult(
                    camera="ip1", marker=marker, dictionary="DICT_5X5_1000", place=place, position=position, scan=scan,
                    first_seen=stamp(at(clock) - 1), stamp=stamp(at(clock)),
                ),
                cam="ip1",
            ),
        )
        for scan, marker, place, clock, position in SIGHTINGS
    ]  # fmt: skip


def _scans() -> list[Message]:
    return [
        _at(clock, CAMERA_SCAN_STATE.message(ScanState(scan=scan, state=state, targets=[582]), cam="ip1"))
        for scan, outcome, began, ended in SCANS
        for clock, state in ((began, "running"), (ended, outcome))
    ]


def _levels() -> list[Message]:
    return [
        _at(clock, DIAGNOSTICS.message(Diagnostic(level=level, message=f"level {level}"), component="camera/ip1"))
        for clock, level in LEVELS
    ]


def _at(clock: str, message: Message) -> Message:
    """As it arrives live: without the retain flag."""
    return Message(topic=message.topic, payload=message.payload, received=at(clock))
