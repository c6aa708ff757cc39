"""What the service needs of ROS: a node that publishes fields, posts what it hears, and answers calls.

Kept by `ros.py` (rospy) and `simulated.py` (no ROS). What comes from ROS is posted as `/ros/<topic>` with the
fields as value, and `retain` when it was latched before we were there; a call of a service of ours as
`/ros-call/<service>` with a `Call`; a change of the link to the master as `LINK`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol

from services.bridge.rules import Fields, Rule

FROM_ROS = "/ros"  # before the ROS topic: `/ros/iot_command`
CALLED = "/ros-call"  # before the name of the ROS service
LINK = "/bridge/link"
ANY = "*"  # type of an inlet: whatever its publisher says that it is, installed or not
Say = Callable[[], None]
CALL_S = 30.0  # a call that we have not answered by then fails


@dataclass(frozen=True)
class Outlet:
    """A topic that we publish. `latch`, `replay`: what is kept for who comes, the newest or that of every key.

    `definition`: the type's text, with those that it needs, where it need not be installed.
    """

    topic: str
    type: str
    latch: bool = False
    replay: bool = False
    queue: int = 10  # per subscriber, in turns: all that a turn says is one entry
    definition: str = ""


@dataclass(frozen=True)
class Inlet:
    """A topic that we subscribe to. `newest`: of large messages that came together only the newest."""

    topic: str
    type: str
    newest: bool = False


@dataclass(frozen=True)
class Server:
    """A ROS service that we offer."""

    name: str
    type: str  # std_srvs/Trigger


@dataclass(frozen=True)
class Call:
    """Somebody calls a service of ours; `answer` takes the response's fields, once, from any thread."""

    fields: Fields
    answer: Callable[[Fields], None]


@dataclass(frozen=True)
class Ports:
    """All that a node has; `parameters` are set at the master by their full names."""

    outlets: tuple[Outlet, ...] = ()
    inlets: tuple[Inlet, ...] = ()
    servers: tuple[Server, ...] = ()
    parameters: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Link:
    """How we stand with the ROS master; `registrations`: how often everything was registered, 1 after the start."""

    up: bool
    text: str
    registrations: int = 0
    ended: bool = False  # somebody else has our name, or shut us down; the node cannot come back in this process
    advice: str = ""  # what is wrong with it although it is up


class Node(Protocol):
    """A ROS node as the service sees it. All calls come from the main thread and none waits for anything."""

    def prepare(self, topic: str, fields: Fields, key: str = "") -> Say:
        """What says it with the next `flush`; `key`: whose newest message this is, on a topic with replay.

        BadMessage when the fields do not fit the topic's type.
        """

    def publish(self, topic: str, fields: Fields, key: str = "") -> None:
        """Prepares and says it."""

    def flush(self) -> None:
        """Sends what was published since, as far as somebody listens."""

    def refresh(self) -> None:
        """Says every message that replay keeps once more, to all."""

    def listeners(self, topic: str) -> int:
        """How many listen to a topic of ours."""

    def close(self) -> None:
        """Leaves the ROS graph."""


def ports(rules: Iterable[Rule]) -> Ports:
    """The ROS topics of the rules, each once."""
    outlets: dict[str, Outlet] = {}
    inlets: dict[str, Inlet] = {}
    for rule in rules:
        if rule.direction == "to_mqtt":
            inlets[rule.ros] = Inlet(rule.ros, rule.type)
            continue
        queue = max(rule.queue, outlets[rule.ros].queue if rule.ros in outlets else 0)
        outlets[rule.ros] = Outlet(rule.ros, rule.type, rule.latches, rule.replay, queue)
    return Ports(tuple(outlets.values()), tuple(inlets.values()))
