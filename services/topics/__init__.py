"""The table of topics: pattern, kind, payload, who writes and who reads, whether it is stored, what it means.

`bus_topics.md`, the broker's ACL and every read and publish come from this table; nothing else spells a topic. The rows
stand in the modules beside, by whose they are. What a row is stands in `services/topic.py`, the payload models in
`services/payloads/`, OpenHAB's string forms in `services/states.py`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError

from services import payloads as p
from services.bus import Message, topic_matches
from services.errors import BadMessage
from services.topic import Kind as Kind
from services.topic import Topic as Topic
from services.topic import lateness
from services.topics import camera, discovery, history, home, mission
from services.topics.camera import *
from services.topics.discovery import *
from services.topics.history import *
from services.topics.home import *
from services.topics.mission import *

TEXT_LIMIT = 256 * 1024
BLOB_LIMIT = 4 * 1024 * 1024
LONGEST_TOPIC = 1000  # bytes; MQTT has 65,535

TABLE: tuple[Topic, ...] = tuple(
    row for rows in (home, camera, mission, history, discovery) for row in vars(rows).values() if isinstance(row, Topic)
)


class Read(NamedTuple):
    """A message as the table understands it. A tuple, as Message is."""

    topic: Topic
    levels: dict[str, str]
    payload: Any
    message: Message


def find(topic: str) -> tuple[Topic, dict[str, str]]:
    """The row of a topic and the levels that vary; BadMessage when no row knows it."""
    for row in TABLE:
        if match := row.regex.fullmatch(topic):
            return row, match.groupdict()
    raise BadMessage(f"no topic like {topic[:200]!r}")


def brings_commands(topic_filter: str) -> bool:
    """Whether commands of the table can come by this MQTT filter."""
    commands = [row.filter for row in TABLE if row.kind is Kind.COMMAND]
    return any(topic_matches(topic_filter, one) or topic_matches(one, topic_filter) for one in commands)


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
        if late := lateness(message.received, now):
            raise LateCommand(known, late)
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
    """The same answer for the one who asked by MQTT 5's response topic; None when nobody did.

    None too where he wants it on a topic that he may not write himself perhaps: a state or command of the table, or no
    topic that can be published to at all.
    """
    if not to.reply_to or not _takes_answers(to.reply_to):
        return None
    return message._replace(topic=to.reply_to, retain=False, correlation=to.correlation)


def _takes_answers(topic: str) -> bool:
    if topic[0] in "$/" or any(sign in topic for sign in "+#\0") or len(topic.encode()) > LONGEST_TOPIC:
        return False
    return not any(row.regex.fullmatch(topic) for row in TABLE if row.kind is not Kind.EVENT)
