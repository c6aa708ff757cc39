"""The table of topics: pattern, kind, payload, who writes and who reads, whether it is stored, what it means.

`bus_topics.md`, the broker's ACL and every read and publish come from this table; nothing else spells a topic.
What a row is stands in `topic.py`, the payload models in `payloads.py`, OpenHAB's string forms in `states.py`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel, ValidationError

from services import payloads as p
from services.bus import Message
from services.errors import BadMessage
from services.topic import STALE_AFTER_S, Kind, Topic

__all__ = ["BLOB_LIMIT", "TABLE", "TEXT_LIMIT", "Kind", "Read", "Topic", "find", "markdown", "read", "reply"]

TEXT_LIMIT = 256 * 1024
BLOB_LIMIT = 4 * 1024 * 1024


@dataclass(frozen=True)
class Read:
    """A message as the table understands it."""

    topic: Topic
    levels: dict[str, str]
    payload: Any
    message: Message = field(repr=False)


ALL = (
    "bridge",
    "persistence",
    "history",
    "mission",
    "dashboard",
    "openhab",
    "operator",
    "robot",
    "camera-<cam>",
)
SHOWN = ("bridge", "persistence", "history", "mission", "dashboard", "operator")
STEERS = ("bridge", "dashboard", "operator", "mission")

HOME_STATE = Topic(
    "home/<item>/state",
    Kind.STATE,
    str,
    ("openhab", "persistence"),
    (*SHOWN, "camera-<cam>"),
    "the state of an item in OpenHAB's string form (`ON`, `21.5 °C`, `UNDEF`)",
    stored=True,
)
HOME_COMMAND = Topic(
    "home/<item>/command",
    Kind.COMMAND,
    str,
    (*STEERS, "camera-<cam>"),
    ("openhab", "dashboard", "operator"),
    "sendCommand",
)
HOME_SET = Topic(
    "home/<item>/set", Kind.COMMAND, str, (*STEERS, "camera-<cam>"), ("openhab", "dashboard", "operator"), "postUpdate"
)
SERVICE_STATUS = Topic(
    "service/<service>/status", Kind.STATE, str, ("<service>",), ALL, "`online` or `offline`, the latter as last will"
)
SERVICE_INFO = Topic(
    "service/<service>/info", Kind.STATE, p.ServiceInfo, ("<service>",), SHOWN, "version, start and counters"
)
CAMERA_STATUS = Topic(
    "camera/<cam>/status",
    Kind.STATE,
    p.CameraStatus,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "whether the camera can be used, and why not",
)
CAMERA_ORDER = Topic(
    "camera/<cam>/order/<key>",
    Kind.COMMAND,
    p.Order,
    (*STEERS, "openhab"),
    ("camera-<cam>",),
    "an order: plain text is the value and a human's, or JSON with `value`, `id`, `by`",
)
CAMERA_ORDER_RESULT = Topic(
    "camera/<cam>/order_result",
    Kind.EVENT,
    p.OrderResult,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "what became of an order; also to the MQTT 5 response topic",
    stored=True,
)
CAMERA_POSITION = Topic(
    "camera/<cam>/position",
    Kind.STATE,
    p.Position,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "where the camera looks, degrees as it reads them",
)
CAMERA_POSITION_SET = Topic(
    "camera/<cam>/position/set",
    Kind.COMMAND,
    p.PositionSet,
    (*STEERS, "openhab"),
    ("camera-<cam>",),
    "look there; answered like an order, key `Position`",
)
CAMERA_PLACES = Topic(
    "camera/<cam>/places", Kind.STATE, p.Places, ("camera-<cam>",), (*SHOWN, "openhab"), "the named places"
)
CAMERA_MOTION = Topic(
    "camera/<cam>/motion",
    Kind.STATE,
    p.Motion,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "1 for 15 s after motion, -1 when the alarm is in trouble",
)
CAMERA_SCAN_STATE = Topic(
    "camera/<cam>/scan/state",
    Kind.STATE,
    p.ScanState,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "how far a scan is",
    stored=True,
)
CAMERA_SCAN_RESULT = Topic(
    "camera/<cam>/scan/result",
    Kind.EVENT,
    p.ScanResult,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "a marker and where it is",
    stored=True,
)
CAMERA_MARKER = Topic(
    "camera/<cam>/marker/<marker>",
    Kind.STATE,
    p.ScanResult,
    ("camera-<cam>",),
    (*SHOWN, "openhab", "camera-<cam>"),
    "the newest scan result of that marker",
)
CAMERA_SCAN_IMAGE = Topic(
    "camera/<cam>/scan/image",
    Kind.BLOB,
    bytes,
    ("camera-<cam>",),
    SHOWN,
    "an analysed frame as JPEG with the markers drawn, while ScanImgPub is on",
)
CAMERA_SNAPSHOT_GET = Topic(
    "camera/<cam>/snapshot/get", Kind.COMMAND, str, (*STEERS, "openhab"), ("camera-<cam>",), "asks for a snapshot"
)
CAMERA_SNAPSHOT = Topic("camera/<cam>/snapshot", Kind.BLOB, bytes, ("camera-<cam>",), (*SHOWN, "openhab"), "a JPEG")
CAMERA_AUDIO = Topic(
    "camera/<cam>/audio", Kind.EVENT, p.Audio, ("camera-<cam>",), (*SHOWN, "openhab"), "a recording is done"
)
CAMERA_STREAM = Topic(
    "camera/<cam>/stream",
    Kind.STATE,
    p.Stream,
    ("camera-<cam>",),
    (*SHOWN, "openhab"),
    "which streams are on, and the address of ours",
)
DIAGNOSTICS = Topic(
    "diagnostics/<component>",
    Kind.STATE,
    p.Diagnostic,
    ALL,
    (*SHOWN, "openhab"),
    "health of a component, about once a second",
    stored=True,
)
HOMEASSISTANT_ENTITY = Topic(
    "homeassistant/<platform>/<cam>/<entity>/config",
    Kind.STATE,
    str,
    ("camera-<cam>",),
    ("openhab", "operator", "camera-<cam>"),
    "Home Assistant's discovery, for openHAB too: JSON of one entity, empty when there is none (any more)",
)
HOMEASSISTANT_STATUS = Topic(
    "homeassistant/status",
    Kind.STATE,
    str,
    ("openhab",),
    ("camera-<cam>", "operator"),
    "`online` when Home Assistant (with the account of openHAB) has started and wants to hear its entities again",
)

TABLE: tuple[Topic, ...] = tuple(value for value in list(globals().values()) if isinstance(value, Topic))


def find(topic: str) -> tuple[Topic, dict[str, str]]:
    """The row of a topic and the levels that vary; BadMessage when no row knows it."""
    for row in TABLE:
        if match := row.regex.fullmatch(topic):
            return row, match.groupdict()
    raise BadMessage(f"no topic like {topic[:200]!r}")


class LateCommand(BadMessage):
    """A command that is retained or too old; `read` is what it wanted, for an answer."""

    def __init__(self, read: Read, why: str) -> None:
        super().__init__(f"{read.message.topic}: refused, {why}")
        self.read = read


def read(message: Message, now: float) -> Read:
    """From untrusted bytes to the payload's type; BadMessage says what was expected and what came.

    A command that is retained or older than STALE_AFTER_S is a LateCommand.
    """
    known = _read(message)
    if known.topic.kind is Kind.COMMAND:
        if message.retain:
            raise LateCommand(known, "a retained command")
        if now - message.received > STALE_AFTER_S:
            raise LateCommand(known, f"{now - message.received:.1f} s old (limit {STALE_AFTER_S:.0f})")
    return known


def _read(message: Message) -> Read:
    row, levels = find(message.topic)
    limit = BLOB_LIMIT if row.payload is bytes else TEXT_LIMIT
    if len(message.payload) > limit:
        raise BadMessage(f"{message.topic}: {len(message.payload)} bytes, at most {limit} allowed")
    return Read(row, levels, _payload(row, message), message)


def _payload(row: Topic, message: Message) -> Any:
    if row.payload is bytes:
        return message.payload
    try:
        text = message.payload.decode()
    except UnicodeDecodeError as error:
        raise BadMessage(f"{message.topic}: expected UTF-8, {error.reason} at byte {error.start}") from error
    if row.payload is str:
        return text
    if row.payload is p.Order and not text.lstrip().startswith("{"):
        return p.Order(value=text)
    assert issubclass(row.payload, BaseModel)
    try:
        return row.payload.model_validate_json(text, strict=True)
    except ValidationError as error:
        raise BadMessage(f"{message.topic}: {_first_fault(error)}") from error


def _first_fault(error: ValidationError) -> str:
    fault = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in fault["loc"]) or "payload"
    return f"{where}: {fault['msg']}, got {str(fault['input'])[:80]!r}"


def reply(message: Message, to: Message) -> Message | None:
    """The same answer for the one who asked by MQTT 5's response topic; None when nobody did."""
    if not to.reply_to:
        return None
    return message._replace(topic=to.reply_to, retain=False, correlation=to.correlation)


def markdown(rows: Iterable[Topic] = TABLE) -> str:
    """`bus_topics.md`: the table for people."""
    lines = [
        "# Topics of the bus",
        "",
        "Written by `apartment topics --write` from `services/topics.py`; a test keeps them equal. Kinds: **state**",
        "(retained, QoS 1), **event** and **command** (not retained, QoS 1; a retained command, or one older than",
        f"{STALE_AFTER_S:.0f} s, is refused), **blob** (QoS 0). Payloads that are not text are the models of",
        "`services/payloads.py`.",
        "",
        "| Topic | Kind | Payload | Stored | Written by | Read by | Meaning |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        payload = {str: "text", bytes: "JPEG"}.get(row.payload, f"`{row.payload.__name__}`")
        lines.append(
            f"| `{row.pattern}` | {row.kind.value} | {payload} | {'yes' if row.stored else ''} "
            f"| {_listed(row.writers)} | {_listed(row.readers)} | {row.meaning} |"
        )
    return "\n".join(lines) + "\n"


def _listed(roles: tuple[str, ...]) -> str:
    return ", ".join(f"`{role}`" for role in roles)
