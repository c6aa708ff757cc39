"""The service for sites whose OpenHAB has no MQTT binding: its members of group ROS on the bus, and back.

States come from OpenHAB's event stream, all of them once after every connection; commands and updates go to its REST
interface, in order. Not here: the connection (`rest.py`).
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Protocol

from pydantic import Field, SecretStr, field_validator

from services import topics
from services.apartment.home import GROUP_ROS, Home
from services.bus import Message
from services.errors import BadMessage
from services.openhab.rest import ANSWER, LOST, STATE, STATES, Answer, Connection, Write
from services.runner import Post
from services.section import Section
from services.states import check_command, check_state

log = logging.getLogger(__name__)
COUNTERS = ("connected", "states", "commands", "updates", "refused", "unconfirmed")


class Config(Section):
    """The section `openhab`."""

    url: str  # of OpenHAB, such as http://openhab.lan:8080
    token: SecretStr | None = None  # an API token, from 3 on where its settings ask for one
    topic: str = Field(default="openhab", pattern="^(openhab|smarthome)$")  # of its events: smarthome in 2.x
    silence_s: float = Field(default=60.0, gt=0, le=3600)  # without an event this long everything is read again
    home: Home

    @field_validator("url")
    @classmethod
    def is_an_address(cls, url: str) -> str:
        if not url.startswith(("http://", "https://")) or "@" in url:
            raise ValueError(f"expected http://host:port or https://host without a password in it, got {url[:80]!r}")
        return url.rstrip("/")


class Writer(Protocol):
    """Who brings commands and updates to OpenHAB."""

    def write(self, write: Write) -> None:
        """Takes one; its answer is posted."""
        ...


@contextmanager
def start(config: Config, post: Post) -> Iterator[Mirror]:
    """The service; OpenHAB is looked for until it is there."""
    token = config.token.get_secret_value() if config.token is not None else None
    with Connection(config.url, token, config.topic, config.silence_s, post) as connection:
        yield Mirror(config.home, connection)


class Mirror:
    """The service; see `services.runner.Service`."""

    subscribes = (topics.HOME_COMMAND.filter, topics.HOME_SET.filter)

    def __init__(self, home: Home, writer: Writer) -> None:
        self.due: float | None = None
        self.counters: Counter[str] = Counter(dict.fromkeys(COUNTERS, 0))
        self._home, self._writer = home, writer
        self._members: dict[str, str] = {}  # of group ROS in OpenHAB, with their types

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """What OpenHAB said, or what it is to be told; BadMessage when it would not take it."""
        if message.topic == STATES:
            return self._all(message.value)
        if message.topic == STATE:
            return self._one(message.value)
        if message.topic in (ANSWER, LOST):
            self._note(message.value)
            return []
        self._write(topics.read(message, now))
        return []

    def tick(self, now: float) -> Iterable[Message]:
        """Nothing happens by itself."""
        return []

    def _all(self, value: object) -> Iterator[Message]:
        assert isinstance(value, dict)
        self.counters["connected"] = 1
        members = {name: item for name, item in value.items() if GROUP_ROS in item.groups and item.type != "Image"}
        self._members = {name: item.type for name, item in members.items()}
        for name, item in members.items():
            yield from self._one((name, item.state))

    def _one(self, value: object) -> Iterator[Message]:
        assert isinstance(value, tuple)
        name, text = value
        if name in self._members:
            self.counters["states"] += 1
            yield topics.HOME_STATE.message(text, item=name)

    def _write(self, read: topics.Read) -> None:
        name, text = read.levels["item"], read.payload
        command = read.topic is topics.HOME_COMMAND
        try:
            if name not in self._members:
                raise BadMessage(f"not a member of {GROUP_ROS} in OpenHAB")
            (check_command if command else check_state)(self._members[name], text)
        except BadMessage as error:
            self.counters["refused"] += 1
            raise BadMessage(f"{read.message.topic}: {error}") from error
        self._writer.write(Write(name, text, command, read.message.received))

    def _note(self, value: object) -> None:
        if not isinstance(value, Answer):
            self.counters["connected"] = 0
            return
        if value.fault is None:
            self.counters["commands" if value.write.command else "updates"] += 1
            return
        self.counters["unconfirmed"] += 1
        log.warning("%s %s: %s", value.write.item, value.write.text, value.fault)
