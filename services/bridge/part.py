"""A part of the bridge that the rules cannot say: what it hears of the bus, has on ROS, and says by itself."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from typing import Protocol

from services.bridge.node import Call, Node, Ports
from services.bridge.rules import Fields, Heard
from services.bus import Message
from services.topic import Topic


class Part(Protocol):
    """All calls come from the service's thread; what a part does not need does nothing."""

    rows: tuple[Topic, ...] = ()  # the topics of the bus that it hears
    ports: Ports = Ports()
    due: float = inf  # when `tick` is wanted next

    def hear(self, heard: Heard, now: float) -> None:
        """Takes a message of one of its topics."""
        return None

    def said(self, message: Message, now: float) -> None:
        """Takes note of what a robot said to the bus."""
        return None

    def heard_ros(self, topic: str, fields: Fields, now: float) -> Iterable[Message]:
        """Takes what a robot said on one of its topics; BadMessage when it is nothing of that kind."""
        return ()

    def called(self, name: str, call: Call, now: float) -> Iterable[Message]:
        """Takes a call of one of its services."""
        return ()

    def lost(self, now: float) -> None:
        """The connection to the bus broke: nobody can be heard for a while."""
        return None

    def tick(self, node: Node, now: float) -> Iterable[Message]:
        """Says what is to be said now."""
        return ()

    def statuses(self, now: float) -> list[Fields]:
        """What it adds to `/diagnostics`, each a DiagnosticStatus."""
        return []

    def close(self) -> None:
        """Ends what it has started."""
        return None


def status(level: int, name: str, message: str, hardware_id: str, **values: str) -> Fields:
    """A DiagnosticStatus."""
    pairs = [{"key": key, "value": value} for key, value in values.items()]
    return {"level": level, "name": name, "message": message, "hardware_id": hardware_id, "values": pairs}
