"""A rule, and which message it turns into which. Pure: no bus, no ROS, no clock.

How the rules are read from their file and checked against each other: `rulebook.py`. What a ROS type has for
fields: `messages.py`.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, Field, FiniteFloat, field_validator, model_validator

from services import topics
from services.bridge import template
from services.bus import Message, topic_matches
from services.errors import BadMessage
from services.section import Section

Fields = dict[str, Any]  # of a ROS message: plain values, nested messages as dicts, times in seconds
KEY_LIMIT = 128  # characters of one topic level that comes from ROS; OpenHAB's own names are far shorter
GRAPH_NAME = re.compile(r"/[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z0-9_]+)*")
TYPE = re.compile(r"[a-z][a-z0-9_]*/[A-Z][A-Za-z0-9]*")
LEVEL = re.compile(r"\{([A-Za-z_][A-Za-z0-9_]*)\}")
TABLE_ROOTS = frozenset(row.pattern.partition("/")[0] for row in topics.TABLE)
KNOWN = ("payload", "topic", "received")  # what a field may name besides the levels of its topic


def _rising(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise ValueError(f"expected [low, high], got {list(pair)}")
    return pair


Range = Annotated[tuple[FiniteFloat, FiniteFloat], AfterValidator(_rising)]


class Rule(Section):
    """One entry of `bridge.yaml`: what is said on one side, and how it is said on the other."""

    direction: Literal["to_ros", "to_mqtt"]
    mqtt: str  # to_ros: a filter, `{name}` captures a level; to_mqtt: the topic, `{name}` is a field
    ros: str  # a ROS topic; global, with or without the `/` before it
    type: str  # of an installed package, `diagnostic_msgs/KeyValue`
    each: Literal["camera"] | None = None  # once per camera: `{cam}` is its name; only the default one has no prefix
    fields: Fields = {}  # to_ros: from levels, `{payload}`, `{payload.key}`, `{topic}`, `{received}`
    payload: Any = None  # to_mqtt: a text, or a mapping that becomes JSON
    tables: dict[str, dict[str, Any]] = {}  # of a field (`level`) or of `payload`: text to value, after the template
    latch: bool | None = None  # ROS keeps the newest message for who comes later; not said: as MQTT does there
    replay: bool = False  # who comes later is sent the newest message of every MQTT topic, and only he
    queue: int = Field(default=100, ge=1, le=100_000)  # per subscriber; the oldest goes when it is full
    rate: float | None = Field(default=None, gt=0)  # per second and topic at most; of what comes faster the newest goes
    most: float | None = Field(default=None, gt=0)  # to_mqtt: a second at most; what is more is refused
    ranges: dict[str, Range] = {}  # to_mqtt: by field (`x`), or by the key of a KeyValue; a number outside is refused
    retain: bool = False  # to_mqtt, on a topic of your own; those of the table know it themselves
    qos: Literal[0, 1] = 1  # the same; what comes from MQTT has that of its publisher

    @field_validator("ros")
    @classmethod
    def is_a_graph_name(cls, name: str) -> str:
        name = name if name.startswith("/") else f"/{name}"
        if not GRAPH_NAME.fullmatch(name):
            raise ValueError(f"expected a ROS name of letters, digits, _ and /, got {name!r}")
        return name

    @field_validator("type")
    @classmethod
    def is_a_type_name(cls, name: str) -> str:
        if not TYPE.fullmatch(name):
            raise ValueError(f"expected a type like diagnostic_msgs/KeyValue, got {name!r}")
        return name

    @field_validator("mqtt")
    @classmethod
    def has_whole_levels(cls, topic: str) -> str:
        levels = topic.split("/")
        for index, level in enumerate(levels):
            last_hash = level == "#" and index == len(levels) - 1
            if not (
                LEVEL.fullmatch(level) or level == "+" or last_hash or (level and not re.search(r"[+#{}\0]", level))
            ):
                raise ValueError(f"expected levels that are a text, {{name}}, + or a last #, got {level!r}")
        return topic

    @model_validator(mode="after")
    def fits_its_direction(self) -> Self:
        if self.direction == "to_ros":
            self._check_to_ros()
        else:
            self._check_to_mqtt()
        if self.each == "camera" and "{cam}" not in self.mqtt:
            raise ValueError("expected {cam} in mqtt of a rule for each camera")
        return self

    def _check_to_ros(self) -> None:
        if self.payload is not None or self.retain or self.qos != 1 or self.most or self.ranges:
            raise ValueError("expected fields, and neither payload, retain, qos, most nor ranges, in a rule to_ros")
        names = LEVEL.findall(self.mqtt)
        if len(names) != len(set(names)):
            raise ValueError("expected every {name} once in mqtt")
        known = (*KNOWN, *names)
        for path in template.places(self.fields):
            if path[0] not in known:
                raise ValueError(f"expected one of {', '.join(known)} in fields, got {{{'.'.join(path)}}}")

    def _check_to_mqtt(self) -> None:
        if self.fields or self.latch or self.replay:
            raise ValueError("expected payload, and neither fields, latch nor replay, in a rule to_mqtt")
        if self.payload is None:
            raise ValueError("expected payload in a rule to_mqtt")
        if "+" in self.mqtt or "#" in self.mqtt:
            raise ValueError("expected no + or # in mqtt of a rule to_mqtt")

    @cached_property
    def latches(self) -> bool:
        """Whether the newest message is kept: what the table calls a state is retained on MQTT, and latched on ROS."""
        if self.latch is not None:
            return self.latch
        kinds = [row.kind for row in topics.TABLE if topic_matches(row.filter, self.filter)]
        return self.direction == "to_ros" and not self.replay and kinds == [topics.Kind.STATE]

    @cached_property
    def filter(self) -> str:
        """The MQTT filter to subscribe to."""
        return LEVEL.sub("+", self.mqtt)

    @cached_property
    def pattern(self) -> re.Pattern[str]:
        """Matches a whole topic, with a group for each captured level."""
        text = re.sub(r"\\\{(\w+)\\\}", r"(?P<\1>[^/]+)", re.escape(self.mqtt))
        return re.compile(text.replace(r"/\#", r"(?:/.*)?").replace(r"\#", ".*").replace(r"\+", "[^/]+"))


@dataclass
class Heard:
    """A bus message that was read: `row` and `levels` where the topic table knows it. Nobody changes it; frozen it
    would cost a microsecond of each message more."""

    message: Message
    payload: str | bytes
    model: BaseModel | None = None
    row: topics.Topic | None = None
    levels: dict[str, str] = field(default_factory=dict)

    @cached_property
    def data(self) -> Any:
        """The payload as plain values, where it is JSON; BadMessage where it is not."""
        if self.model is not None:
            return self.model.model_dump(mode="json")
        try:
            return json.loads(self.payload, parse_constant=_not_json)
        except (ValueError, RecursionError) as error:
            raise BadMessage(f"{self.message.topic}: expected JSON, got {self.payload[:80]!r}") from error


def read(message: Message, now: float) -> Heard:
    """From untrusted bytes: by the topic table where it knows the topic, else as text."""
    if _is_own(message.topic):
        return Heard(message, _own_text(message))
    known = topics.read(message, now)
    if isinstance(known.payload, BaseModel):
        return Heard(message, message.payload.decode(), known.payload, known.topic, known.levels)
    return Heard(message, known.payload, None, known.topic, known.levels)


def to_ros(rule: Rule, heard: Heard) -> Fields | None:
    """The ROS message's fields; None when the topic is not this rule's, or a value is null: nothing to say."""
    match = rule.pattern.fullmatch(heard.message.topic)
    if match is None:
        return None
    levels = match.groupdict()

    def look(path: template.Path) -> Any:
        if path[0] in levels:
            return template.walk(levels[path[0]], path[1:])
        if path[0] == "payload":
            return template.walk(heard.data, path[1:]) if path[1:] else heard.payload
        return heard.message.topic if path[0] == "topic" else heard.message.received

    try:
        fields = template.fill(rule.fields, look)
    except template.Absent:
        return None
    return {name: _from_table(rule, name, value) for name, value in fields.items()}


def to_mqtt(rule: Rule, fields: Fields, now: float) -> Message:
    """The bus message; BadMessage when a level or the payload is not what its topic allows."""

    def look(path: template.Path) -> Any:
        value = template.walk(fields, path)
        if value is None:
            raise BadMessage(f"{rule.ros}: expected a value of {'.'.join(path)}, got none")
        return value

    topic = "/".join(_level(part, look) if "{" in part else part for part in rule.mqtt.split("/"))
    payload = _from_table(rule, "payload", template.fill(rule.payload, look))
    return _said(rule, topic, template.as_text(payload), now)


def _from_table(rule: Rule, name: str, value: Any) -> Any:
    if name not in rule.tables:
        return value
    table = rule.tables[name]
    if (text := template.as_text(value)) not in table:
        raise BadMessage(f"{rule.ros} {name}: expected one of {', '.join(table)}, got {text[:80]!r}")
    return table[text]


def _level(part: str, look: template.Look) -> str:
    """A level that comes from ROS: it must not break out of its place in the topic."""
    text = template.as_text(template.fill(part, look))
    if not text or len(text) > KEY_LIMIT:
        raise BadMessage(f"expected a key of 1 to {KEY_LIMIT} characters, got {len(text)}")
    if re.search(r"[/+#]", text) or not text.isprintable():
        raise BadMessage(f"expected a key without / + # and control characters, got {text!r}")
    return text


def _said(rule: Rule, topic: str, text: str, now: float) -> Message:
    """What we publish is what the table would read: flags and payload are its own."""
    try:
        payload = text.encode()
    except UnicodeEncodeError as error:
        raise BadMessage(f"{rule.ros}: expected a text that UTF-8 can carry, {error.reason}") from error
    if _is_own(topic):
        return Message(topic, payload, retain=rule.retain, qos=rule.qos)
    known = topics.read(Message(topic, payload, received=now), now)
    return known.topic.message(known.payload, **known.levels)


def _is_own(topic: str) -> bool:
    """Whether a topic belongs to the rules' author: nothing in the topic table begins like it."""
    return topic.partition("/")[0] not in TABLE_ROOTS


def _own_text(message: Message) -> str:
    if len(message.payload) > topics.TEXT_LIMIT:
        raise BadMessage(f"{message.topic}: {len(message.payload)} bytes, at most {topics.TEXT_LIMIT} allowed")
    try:
        return message.payload.decode()
    except UnicodeDecodeError as error:
        raise BadMessage(f"{message.topic}: expected UTF-8, {error.reason} at byte {error.start}") from error


def _not_json(text: str) -> None:
    raise ValueError(f"{text} is no JSON")
