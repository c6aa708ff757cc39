"""The node without ROS, in memory: for tests, for virtual time, and for a home that has no robot."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial

from services.bridge.node import CALLED, FROM_ROS, LINK, Call, Link, Ports, Say
from services.bridge.rules import Fields
from services.bus import Message
from services.errors import BadMessage
from services.runner import Post

Hear = Callable[[Fields], None]
REMEMBERED = 1000  # published messages that a test can look at


class SimulatedNode:
    """Keeps `published`, and hands each message to those who `subscribe`, as rospy's node would."""

    def __init__(self, ports: Ports, post: Post) -> None:
        self.ports = ports
        self._outlets = {outlet.topic: outlet for outlet in ports.outlets}
        self._inlets = {inlet.topic for inlet in ports.inlets}
        self._servers = {server.name for server in ports.servers}
        self._post = post
        self._kept: dict[str, dict[str, Fields]] = {}
        self._subscribers: dict[str, list[Hear]] = {}
        self.published: deque[tuple[str, Fields]] = deque(maxlen=REMEMBERED)
        post(Message(LINK, value=Link(up=True, text="simulated, no ROS", registrations=1)))

    def prepare(self, topic: str, fields: Fields, key: str = "") -> Say:
        """See `Node`; here every topic takes any fields."""
        return partial(self._say, topic, fields, key)

    def publish(self, topic: str, fields: Fields, key: str = "") -> None:
        """See `Node`."""
        self.prepare(topic, fields, key)()

    def flush(self) -> None:
        """See `Node`; here everything is said at once."""

    def refresh(self) -> None:
        """See `Node`."""
        for topic, outlet in self._outlets.items():
            for key, fields in list(self._kept.get(topic, {}).items()) if outlet.replay else ():
                self._say(topic, fields, key)

    def listeners(self, topic: str) -> int:
        """See `Node`."""
        return len(self._subscribers.get(topic, ()))

    def close(self) -> None:
        """See `Node`."""
        self._subscribers.clear()

    def subscribe(self, topic: str, hear: Hear) -> None:
        """What `rostopic echo` does: first what is kept, then everything."""
        for fields in self._kept.get(topic, {}).values():
            hear(fields)
        self._subscribers.setdefault(topic, []).append(hear)

    def send(self, topic: str, fields: Fields) -> None:
        """What `rostopic pub` does; BadMessage when nobody here listens to that topic."""
        if topic not in self._inlets:
            raise BadMessage(f"expected one of {', '.join(sorted(self._inlets))}, got {topic!r}")
        self._post(Message(FROM_ROS + topic, value=fields))

    def call(self, name: str, fields: Fields, answer: Callable[[Fields], None]) -> None:
        """What `rosservice call` does; BadMessage when there is no such service."""
        if name not in self._servers:
            raise BadMessage(f"expected one of {', '.join(sorted(self._servers))}, got {name!r}")
        self._post(Message(CALLED + name, value=Call(fields, answer)))

    def _say(self, topic: str, fields: Fields, key: str) -> None:
        outlet = self._outlets[topic]
        if outlet.replay or outlet.latch:
            self._kept.setdefault(topic, {})[key if outlet.replay else ""] = fields
        self.published.append((topic, fields))
        for hear in self._subscribers.get(topic, ()):
            hear(fields)
