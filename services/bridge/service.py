"""Bus messages to ROS and back, by the rules; and what no rule can say.

That is: only items of group ROS, only what their types allow, REFRESH, and the diagnostics. The ROS side is a
`Node`, by rospy or simulated.
"""

from __future__ import annotations

import importlib.util
import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from pydantic import Field

from services import states, topics
from services.bridge import messages, rulebook
from services.bridge.health import Health
from services.bridge.node import FROM_ROS, LINK, Link, Node, Outlet, ports
from services.bridge.ros import RosNode
from services.bridge.rules import Fields, Heard, Rule, read, to_mqtt, to_ros
from services.bridge.simulated import SimulatedNode
from services.bus import Message
from services.errors import BadMessage
from services.home import Home, Item
from services.payloads import Diagnostic
from services.runner import Post
from services.section import Section

DIAGNOSTICS_EVERY_S = 1.0
SOONEST_S = 0.2  # between two diagnostics of our own, however much is refused
REFRESH = ("ROS_COMMAND", b"REFRESH")  # key and value with which a robot asks for all states once more
REMEMBERED_TOPICS = 10_000  # whose rules are found at once

log = logging.getLogger(__name__)


class Config(Section):
    """The bridge's section of the configuration."""

    rules: str = "bridge.yaml"  # which topics are bridged, and how
    node: str = Field(default="iot_bridge", pattern=r"^[A-Za-z][A-Za-z0-9_]*$")  # its name in the ROS graph
    master_uri: str | None = None  # http://host:11311; without it ROS_MASTER_URI of the environment
    simulated: bool = False  # a ROS node in memory, where there is no ROS
    name: str = "bridge"
    home: Home
    cameras: tuple[str, ...] = ()
    folder: Path


class Bridge:
    """The service. `node` is its ROS side."""

    def __init__(self, home: Home, rules: tuple[Rule, ...], node: Node) -> None:
        self.node = node
        self.counters: Counter[str] = Counter(to_ros=0, to_mqtt=0, refused=0)
        self.due: float | None = 0.0
        self._home = home
        self._to_ros = tuple(rule for rule in rules if rule.direction == "to_ros")
        self._to_mqtt = tuple(rule for rule in rules if rule.direction == "to_mqtt")
        filters = (*(rule.filter for rule in self._to_ros), topics.DIAGNOSTICS.filter)
        self.subscribes = tuple(dict.fromkeys(filters))
        self._rules_for = lru_cache(REMEMBERED_TOPICS)(self._find_rules)
        self._health = Health()
        self._next_array = self._last_own = 0.0

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """See `Service`; a refused message from ROS is a BadMessage, and a warning in `diagnostics/bridge`."""
        if message.topic == LINK and isinstance(message.value, Link):
            self._linked(message.value)
        elif message.topic.startswith(FROM_ROS) and isinstance(message.value, dict):
            return self._from_ros(message.topic.removeprefix(FROM_ROS), message.value, now)
        else:
            self._from_bus(message, now)
        return ()

    def tick(self, now: float) -> Iterator[Message]:
        """Both diagnostics once a second; our own sooner when there is news."""
        if self._health.link.ended:
            raise RuntimeError(f"the ROS node was {self._health.link.text}")
        if now >= self._next_array:
            self._next_array = now + DIAGNOSTICS_EVERY_S
            self.node.publish(rulebook.DIAGNOSTICS, self._health.array(now))
        if self.due is None or now >= self.due:
            self._last_own, self.due = now, self._next_array
            yield topics.DIAGNOSTICS.message(self._health.own(now, self.counters), component="bridge")

    def _linked(self, link: Link) -> None:
        if link.up != self._health.link.up:
            log.log(logging.INFO if link.up else logging.WARNING, "ROS %s: %s", "up" if link.up else "away", link.text)
        self._health.link = link
        self._soon()

    def _soon(self) -> None:
        self.due = min(self.due or 0.0, self._last_own + SOONEST_S)

    def _from_bus(self, message: Message, now: float) -> None:
        heard = read(message, now)
        if heard.row is topics.DIAGNOSTICS and isinstance(heard.model, Diagnostic):
            self._health.note(heard.levels["component"], heard.model, now)
        if heard.row is topics.HOME_STATE and not self._is_for_robots(heard):
            return
        faults = [fault for rule in self._rules_for(message.topic) if (fault := self._apply(rule, heard))]
        if faults:
            raise faults[0]

    def _apply(self, rule: Rule, heard: Heard) -> BadMessage | None:
        """One rule's fault does not keep the others from theirs."""
        try:
            fields = to_ros(rule, heard)
            if fields is not None:
                self.node.publish(rule.ros, fields, key=heard.message.topic)
                self.counters["to_ros"] += 1
        except BadMessage as error:
            return BadMessage(f"{heard.message.topic} to {rule.ros}: {error}")
        return None

    def _find_rules(self, topic: str) -> tuple[Rule, ...]:
        return tuple(rule for rule in self._to_ros if rule.pattern.fullmatch(topic))

    def _is_for_robots(self, heard: Heard) -> bool:
        """Whether the item is in group ROS; BadMessage when the text is no state of it."""
        item = self._home.ros_items.get(heard.levels["item"])
        if item is not None:
            states.check_state(item.type, str(heard.payload))
        return item is not None

    def _from_ros(self, topic: str, fields: Fields, now: float) -> list[Message]:
        try:
            wanted = [to_mqtt(rule, fields, now) for rule in self._to_mqtt if rule.ros == topic]
            allowed = [message for message in wanted if not self._is_refresh(message)]
            for message in allowed:
                self._check_home(message)
        except BadMessage as error:
            self.counters["refused"] += 1
            text = f"{topic} {_short(fields)}: {error}"
            self._health.refused(text, now)
            self._soon()
            raise BadMessage(text) from error
        if len(allowed) < len(wanted):
            self.node.refresh()
        self.counters["to_mqtt"] += len(allowed)
        return allowed

    def _is_refresh(self, message: Message) -> bool:
        row, levels = _known(message.topic)
        return row in (topics.HOME_COMMAND, topics.HOME_SET) and (levels["item"], message.payload) == REFRESH

    def _check_home(self, message: Message) -> None:
        """BadMessage when OpenHAB would not take it: better said to the robot than lost there."""
        row, levels = _known(message.topic)
        if row is topics.HOME_SET:
            states.check_state(self._item(levels["item"]).type, message.payload.decode())
        elif row is topics.HOME_COMMAND:
            item = self._item(levels["item"])
            states.check_command(item.type, message.payload.decode())
            if not item.takes_commands:
                raise BadMessage("the item is read only")

    def _item(self, name: str) -> Item:
        if name not in self._home.ros_items:
            raise BadMessage(f"expected an item of group ROS, got {name!r}")
        return self._home.ros_items[name]


def check(config: Config) -> None:
    """ConfigError with every fault of the rules; their types are checked where ROS is installed."""
    known = _types(config) if importlib.util.find_spec("genpy") else rulebook.unchecked
    rulebook.load(config.folder / config.rules, config.cameras, known)


def _types(config: Config) -> rulebook.Check:
    return rulebook.unchecked if config.simulated else messages.faults


@contextmanager
def start(config: Config, post: Post) -> Iterator[Bridge]:
    """The service with its node; ConfigError when the rules cannot be used, or ROS is not installed."""
    rules = rulebook.load(config.folder / config.rules, config.cameras, _types(config))
    with closing(_node(config, rules, post)) as node:
        yield Bridge(config.home, rules, node)


def _node(config: Config, rules: tuple[Rule, ...], post: Post) -> SimulatedNode | RosNode:
    outlets, inlets = ports(rules)
    outlets = (*outlets, Outlet(rulebook.DIAGNOSTICS, "diagnostic_msgs/DiagnosticArray"))
    outlets = tuple(_with_room(outlet, config.home) for outlet in outlets)
    if config.simulated:
        return SimulatedNode(outlets, inlets, post)
    return RosNode(config.node, config.master_uri, outlets, inlets, post)


def _known(topic: str) -> tuple[topics.Topic | None, dict[str, str]]:
    """The row of the topic table; none for topics of the rules' author."""
    try:
        return topics.find(topic)
    except BadMessage:
        return None, {}


def _with_room(outlet: Outlet, home: Home) -> Outlet:
    """A subscriber's queue holds the whole replay, and what happens meanwhile."""
    return replace(outlet, queue=outlet.queue + len(home.items)) if outlet.replay else outlet


def _short(fields: Fields) -> str:
    return text if len(text := repr(fields)) <= 120 else f"{text[:117]}..."
