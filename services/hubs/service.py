"""Keeps other hubs told of the home: says what there is when it changes or when they ask, takes away what went.

Not here: what they are told (`homeassistant.py`, `homie.py`).
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from pydantic import Field

from services import topics
from services.apartment.home import Home
from services.bus import Message
from services.hubs import homeassistant, homie
from services.runner import Post
from services.section import Section

log = logging.getLogger(__name__)
BIRTH = "online"
OURS = '"unique_id": "apartment_home_'  # in whatever we told Home Assistant of the home, now or before


class Config(Section):
    """The section `hubs`."""

    homeassistant: bool = True  # discovery of the home's items; a camera has `discovery` of its own
    homie: bool = False  # the home as a device of Homie 4.0
    home_service: str = Field(default="openhab", pattern=r"^[a-z0-9_-]+$")  # its status says whether the home is there
    home: Home


@contextmanager
def start(config: Config, post: Post) -> Iterator[Hubs]:
    """The service; it holds nothing that has to be closed."""
    yield Hubs(config)


class Hubs:
    """The service; see `services.runner.Service`."""

    def __init__(self, config: Config) -> None:
        own = (topics.HOMEASSISTANT_ITEM.filter, topics.HOMEASSISTANT_STATUS.filter)
        projected = (topics.HOMIE_SET.filter, topics.HOME_STATE.filter) if config.homie else ()
        self.subscribes: tuple[str, ...] = (*own, *projected)
        self.due: float | None = 0.0
        self.counters: Counter[str] = Counter(entities=0, commands=0)
        wanted = homeassistant.entities(config.home, config.home_service) if config.homeassistant else {}
        self._wanted = {
            topics.HOMEASSISTANT_ITEM.name(platform=one, item=item): text for (one, item), text in wanted.items()
        }
        self._said: dict[str, str] = {}
        self._homie = homie.Projection(config.home) if config.homie else None
        self._described = False

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """What a hub wants, a state of the home, or what is retained of ours from before."""
        read = topics.read(message, now)
        if read.topic is topics.HOMEASSISTANT_STATUS:
            if read.payload == BIRTH:
                self._said.clear()
        elif read.topic is topics.HOMEASSISTANT_ITEM:
            if message.retain and message.topic not in self._wanted and OURS in read.payload:
                self._said[message.topic] = read.payload
        elif self._homie is not None and read.topic is topics.HOMIE_SET:
            self.counters["commands"] += 1
            yield self._homie.command(read.levels["node"], read.payload)
        elif self._homie is not None and read.topic is topics.HOME_STATE:
            value = self._homie.state(read.levels["item"], read.payload)
            yield from [value] if value is not None else []

    def tick(self, now: float) -> Iterable[Message]:
        """Says what has changed since it was said."""
        self.due = None
        if self._homie is not None and not self._described:
            self._described = True
            yield from self._homie.description()
        for topic in [topic for topic in self._said if topic not in self._wanted]:
            del self._said[topic]
            yield _entity(topic, "")
        for topic, text in self._wanted.items():
            if self._said.get(topic) != text:
                self._said[topic] = text
                yield _entity(topic, text)
        self.counters["entities"] = len(self._said)


def _entity(topic: str, text: str) -> Message:
    _, platform, item, _ = topic.split("/")
    return topics.HOMEASSISTANT_ITEM.message(text, platform=platform, item=item)
