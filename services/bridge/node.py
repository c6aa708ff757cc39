"""What the service needs of ROS: a node that publishes fields and posts what it hears.

Kept by `ros.py` (rospy) and `simulated.py` (no ROS). What comes from ROS is posted as `/ros/<topic>` with the
fields as value; a change of the link to the master as `LINK`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from services.bridge.rules import Fields, Rule

FROM_ROS = "/ros"  # before the ROS topic: `/ros/iot_command`
LINK = "/bridge/link"


@dataclass(frozen=True)
class Outlet:
    """A topic that we publish."""

    topic: str
    type: str
    latch: bool = False
    replay: bool = False
    queue: int = 10


@dataclass(frozen=True)
class Inlet:
    """A topic that we subscribe to."""

    topic: str
    type: str


@dataclass(frozen=True)
class Link:
    """How we stand with the ROS master; `registrations`: how often everything was registered, 1 after the start."""

    up: bool
    text: str
    registrations: int = 0
    ended: bool = False  # the master or someone else shut the node down; it cannot come back in this process


class Node(Protocol):
    """A ROS node as the service sees it. All calls come from the main thread and none waits for anything."""

    def publish(self, topic: str, fields: Fields, key: str = "") -> None:
        """Sends, as far as somebody listens; `key`: whose newest message this is, on a topic with replay.

        BadMessage when the fields do not fit the topic's type.
        """

    def refresh(self) -> None:
        """Sends every message that replay keeps once more, to all."""

    def close(self) -> None:
        """Leaves the ROS graph."""


class Kept:
    """The newest message of each key, for each topic with replay.

    One thread puts; any other reads a table that nobody changes any more.
    """

    def __init__(self) -> None:
        self._tables: dict[str, dict[str, Any]] = {}

    def put(self, topic: str, key: str, message: Any) -> None:
        """Keeps a message instead of the older one of that key."""
        self._tables[topic] = {**self._tables.get(topic, {}), key: message}

    def of(self, topic: str) -> Iterable[Any]:
        """All of a topic."""
        return self._tables.get(topic, {}).values()


def ports(rules: Iterable[Rule]) -> tuple[tuple[Outlet, ...], tuple[Inlet, ...]]:
    """The ROS topics of the rules, each once."""
    outlets: dict[str, Outlet] = {}
    inlets: dict[str, Inlet] = {}
    for rule in rules:
        if rule.direction == "to_mqtt":
            inlets[rule.ros] = Inlet(rule.ros, rule.type)
            continue
        queue = max(rule.queue, outlets[rule.ros].queue if rule.ros in outlets else 0)
        outlets[rule.ros] = Outlet(rule.ros, rule.type, rule.latch, rule.replay, queue)
    return tuple(outlets.values()), tuple(inlets.values())
