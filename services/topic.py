"""What a row of the table of topics is: pattern, kind, payload, roles; and the messages that it makes.

Not here: the rows, and reading what comes; that is `topics/`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Annotated

from pydantic import AfterValidator, BaseModel

from services.bus import Message
from services.errors import BadMessage

STALE_AFTER_S = 5.0  # contract section 2: an older command is refused


def lateness(received: float, now: float) -> str | None:
    """How late a command that came at `received` is, in words; None: it is not. Both in seconds since 1970."""
    late = now - received
    return f"{late:.1f} s old (limit {STALE_AFTER_S:.0f})" if late > STALE_AFTER_S else None


class Kind(Enum):
    """What a topic is for; it alone decides retain, QoS and expiry."""

    STATE = "state"  # retained, the latest wins
    EVENT = "event"  # happened, never retained
    COMMAND = "command"  # wanted; never retained, refused when late
    BLOB = "blob"  # a picture, QoS 0


CHOICES = {"trait": ("$name", "$datatype", "$settable", "$retained", "$format", "$unit")}  # of a property in Homie
LEVELS = {
    "item": r"[A-Za-z_][A-Za-z0-9_]*",
    "cam": r"[a-z][a-z0-9_]*",
    "robot": r"[a-z][a-z0-9_]*",
    "service": r"[a-z0-9_-]+",
    "key": r"[A-Za-z]+",
    "marker": r"[0-9]{1,4}",
    "id": r"[A-Za-z0-9_-]{1,64}",
    "platform": r"[a-z_]+",
    "entity": r"[a-z0-9_-]+",
    "device": r"[a-z0-9][a-z0-9-]*",  # of Homie, as are the next three
    "node": r"[a-z0-9][a-z0-9-]*",
    "property": r"[a-z0-9][a-z0-9-]*",
    "attribute": r"\$[a-z]+",
    "trait": "|".join(map(re.escape, CHOICES["trait"])),
    "component": r"[A-Za-z0-9_-]+(?:/[A-Za-z0-9_-]+)*",
}


def _robot(name: str) -> str:
    if not re.fullmatch(LEVELS["robot"], name):
        raise ValueError(f"expected a name of a-z, 0-9 and _ beginning with a letter, got {name!r}")
    return name


RobotName = Annotated[str, AfterValidator(_robot)]  # as it stands in a configuration


@dataclass(frozen=True)
class Topic:
    """One row of the table. `writers` and `readers` are roles (`ROLES`); `<service>` and `<cam>` in a role name
    stand for the level of that name, so that a service owns its own topics only."""

    pattern: str
    kind: Kind
    payload: type[BaseModel] | type[str] | type[bytes]
    writers: tuple[str, ...]
    readers: tuple[str, ...]
    meaning: str
    stored: bool = False

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the levels that vary, in order."""
        return tuple(re.findall(r"<(\w+)>", self.pattern))

    @cached_property
    def filter(self) -> str:
        """The MQTT filter of all its topics."""
        return re.sub(r"<\w+>", "+", self.pattern.replace("<component>", "#"))

    @cached_property
    def regex(self) -> re.Pattern[str]:
        """Matches a whole topic; one group per level that varies."""
        literal = re.sub(r"<(\w+)>", lambda m: f"(?P<{m[1]}>{LEVELS[m[1]]})", self.pattern)
        return re.compile(literal)

    def name(self, **levels: object) -> str:
        """The topic with these levels; BadMessage when one of them is not what the pattern allows."""
        topic = re.sub(r"<(\w+)>", lambda m: str(levels[m[1]]), self.pattern)
        if not self.regex.fullmatch(topic):
            raise BadMessage(f"{topic!r} is not a topic like {self.pattern}")
        return topic

    def message(self, payload: BaseModel | str | bytes, **levels: object) -> Message:
        """The message that says `payload` there, with the flags of its kind."""
        return Message(
            topic=self.name(**levels),
            payload=encode(payload),
            retain=self.kind is Kind.STATE,
            qos=0 if self.kind is Kind.BLOB else 1,
            expires_s=int(STALE_AFTER_S) if self.kind in (Kind.COMMAND, Kind.BLOB) else None,
        )

    def filters_for(self, **levels: str) -> list[str]:
        """The filters with some levels given, one for each choice where there are few: `+` would let in more."""
        named = next((name for name in self.names if name in CHOICES), None)
        if named is None:
            return [self.filter_for(**levels)]
        return [self.filter_for(**levels, **{named: choice}) for choice in CHOICES[named]]

    def filter_for(self, **levels: str) -> str:
        """The filter with some levels given: `camera/ip1/order/+`."""
        return re.sub(r"<(\w+)>", lambda m: levels.get(m[1], "#" if m[1] == "component" else "+"), self.pattern)


def encode(payload: BaseModel | str | bytes) -> bytes:
    """Bytes on the wire: JSON of a model, UTF-8 of a text."""
    if isinstance(payload, BaseModel):
        return payload.model_dump_json().encode()
    return payload.encode() if isinstance(payload, str) else payload
