"""Bus messages to ROS and back, by the rules; and what no rule can say.

That is: only items of group ROS, only what their types allow, REFRESH, and the diagnostics; more of it is in the
parts (`part.py`). The ROS side is a `Node`, by rospy or simulated. How all is put together: `program.py`.
"""

from __future__ import annotations

import logging
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from functools import lru_cache

from services import states, topics
from services.apartment.home import Home, Item
from services.bridge import limits, rulebook
from services.bridge.health import Health
from services.bridge.node import CALLED, FROM_ROS, LINK, Call, Link, Node, Say
from services.bridge.pace import Pace
from services.bridge.part import Part
from services.bridge.rules import Fields, Heard, Rule, read, to_mqtt, to_ros
from services.bus import LOST_TOPIC, Message, topic_matches
from services.errors import ApartmentError, BadMessage
from services.payloads import Diagnostic

DIAGNOSTICS_EVERY_S = 1.0
TOLD_AT_ONCE = 50  # statuses: a millisecond, in which nothing else goes on
NEXT_S = 0.02  # until the next ones
SOONEST_S = 0.2  # between two diagnostics of our own, however much is refused
REFRESH = ("ROS_COMMAND", b"REFRESH")  # key and value with which a robot asks for all states once more
REMEMBERED_TOPICS = 10_000  # whose rules are found at once

log = logging.getLogger(__name__)


class GivenUp(ApartmentError):
    """The ROS node is gone and cannot come back in this process; the message says why."""


class Bridge:
    """The service. `node` is its ROS side."""

    def __init__(self, home: Home, rules: tuple[Rule, ...], node: Node, parts: tuple[Part, ...] = ()) -> None:
        self.node = node
        self.parts = parts
        self.counters: Counter[str] = Counter(to_ros=0, to_mqtt=0, refused=0)
        self._home = home
        self._to_ros = tuple(rule for rule in rules if rule.direction == "to_ros")
        self._to_mqtt: defaultdict[str, list[Rule]] = defaultdict(list)
        for rule in rules:
            if rule.direction == "to_mqtt":
                self._to_mqtt[rule.ros].append(rule)
        self._allowance = limits.Allowance()
        self._slow_to_ros: Pace[Say] = Pace()
        self._slow_to_mqtt: Pace[Message] = Pace()
        rows = (topics.DIAGNOSTICS, *(row for part in parts for row in part.rows))
        self.subscribes = _apart([*(rule.filter for rule in self._to_ros), *(row.filter for row in rows)])
        self.subscribes += (LOST_TOPIC,) if any(type(part).lost is not Part.lost for part in parts) else ()
        self._listening = {row: tuple(part for part in parts if row in part.rows) for row in rows}
        self._serving = {server.name: part for part in parts for server in part.ports.servers}
        self._hearing = {inlet.topic: part for part in parts for inlet in part.ports.inlets}
        self._rules_for = lru_cache(REMEMBERED_TOPICS)(self._find_rules)
        self._health = Health()
        self._own_due = 0.0
        self._untold: list[Fields] = []  # statuses that are still to be said in this second
        self._next_array = self._next_statuses = self._last_own = 0.0

    @property
    def due(self) -> float:
        """See `Service`."""
        slow = self._slow_to_ros.due, self._slow_to_mqtt.due
        return min([self._own_due, self._next_array, *slow, *(part.due for part in self.parts)])

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """See `Service`; a refused message from ROS is a BadMessage, and a warning in `diagnostics/bridge`."""
        if message.topic == LOST_TOPIC:
            for part in self.parts:
                part.lost(now)
        elif message.value is None:
            self._from_bus(message, now)
        elif message.topic == LINK and isinstance(message.value, Link):
            self._linked(message.value)
        elif message.topic.startswith(CALLED) and isinstance(message.value, Call):
            name = message.topic.removeprefix(CALLED)
            return self._serving[name].called(name, message.value, now)
        elif isinstance(message.value, dict):
            return self._from_ros(message.topic.removeprefix(FROM_ROS), message.value, now, kept=message.retain)
        return ()

    def tick(self, now: float) -> Iterator[Message]:
        """Both diagnostics once a second, our own sooner when there is news; and sends all that this turn said."""
        if self._health.link.ended:
            raise GivenUp(f"bridge: {self._health.link.text}")
        yield from self._what_waited(now)
        for part in self.parts:
            yield from part.tick(self.node, now)
        if now >= self._next_array:
            self._tell_statuses(now)
        if now >= self._own_due:
            self._last_own, self._own_due = now, now + DIAGNOSTICS_EVERY_S
            yield topics.DIAGNOSTICS.message(self._health.own(now, self.counters), component="bridge")
        self.node.flush()

    def _tell_statuses(self, now: float) -> None:
        """Each once a second, some at a time."""
        if not self._untold:
            self._untold = [*self._health.statuses(now), *(one for part in self.parts for one in part.statuses(now))]
            self._next_statuses = now + DIAGNOSTICS_EVERY_S
        told, self._untold = self._untold[:TOLD_AT_ONCE], self._untold[TOLD_AT_ONCE:]
        self.node.publish(rulebook.DIAGNOSTICS, {"header": {"stamp": now}, "status": told})
        self._next_array = now + NEXT_S if self._untold else self._next_statuses

    def _linked(self, link: Link) -> None:
        if link.up != self._health.link.up:
            log.log(logging.INFO if link.up else logging.WARNING, "ROS %s: %s", "up" if link.up else "away", link.text)
        self._health.link = link
        self._soon()

    def _soon(self) -> None:
        self._own_due = min(self._own_due, self._last_own + SOONEST_S)

    def _from_bus(self, message: Message, now: float) -> None:
        heard = read(message, now)
        if heard.row is topics.DIAGNOSTICS and isinstance(heard.model, Diagnostic):
            self._health.note(heard.levels["component"], heard.model, now)
        if heard.row is topics.HOME_STATE and not self._is_for_robots(heard):
            return
        for part in self._listening.get(heard.row, ()) if heard.row else ():
            part.hear(heard, now)
        faults = [fault for rule in self._rules_for(message.topic) if (fault := self._apply(rule, heard, now))]
        if faults:
            raise faults[0]

    def _apply(self, rule: Rule, heard: Heard, now: float) -> BadMessage | None:
        """One rule's fault does not keep the others from theirs."""
        topic = heard.message.topic
        try:
            fields = to_ros(rule, heard)
            say = self.node.prepare(rule.ros, fields, key=topic) if fields is not None else None
            if say is not None and rule.rate is not None:
                say = self._slow_to_ros.take((rule.ros, topic), rule.rate, say, now)
            if say is not None:
                say()
                self.counters["to_ros"] += 1
        except BadMessage as error:
            return BadMessage(f"{topic} to {rule.ros}: {error}")
        return None

    def _what_waited(self, now: float) -> Iterator[Message]:
        """What came faster than its rule allows, as far as its time has come."""
        for say in self._slow_to_ros.ready(now):
            say()
            self.counters["to_ros"] += 1
        for message in self._slow_to_mqtt.ready(now):
            self.counters["to_mqtt"] += 1
            yield message

    def _find_rules(self, topic: str) -> tuple[Rule, ...]:
        return tuple(rule for rule in self._to_ros if rule.pattern.fullmatch(topic))

    def _is_for_robots(self, heard: Heard) -> bool:
        """Whether the item is in group ROS; BadMessage when the text is no state of it."""
        item = self._home.ros_items.get(heard.levels["item"])
        if item is not None:
            states.check_state(item.type, str(heard.payload))
        return item is not None

    def _from_ros(self, topic: str, fields: Fields, now: float, *, kept: bool) -> list[Message]:
        try:
            wanted = [(rule, to_mqtt(rule, fields, now)) for rule in self._to_mqtt[topic]]
            for rule, _ in wanted:
                limits.check(rule, fields, self._allowance, now)
            asked = [(rule, message) for rule, message in wanted if not self._is_refresh(message)]
            for _, message in asked:
                self._check_home(message)
            own = list(self._hearing[topic].heard_ros(topic, fields, now)) if topic in self._hearing else []
            if kept and any(_moves(message) for message in (*own, *(message for _, message in asked))):
                raise BadMessage(
                    "expected a word that is said now, got one that was latched before the bridge was there"
                )
        except BadMessage as error:
            self.counters["refused"] += 1
            text = f"{topic} {_short(fields)}: {error}"
            self._health.refused(text, now)
            self._soon()
            raise BadMessage(text) from error
        if len(asked) < len(wanted):
            self.node.refresh()
        allowed = [*own, *(message for rule, message in asked if self._may_go(rule, message, now))]
        self.counters["to_mqtt"] += len(allowed)
        for message in allowed:
            for part in self.parts:
                part.said(message, now)
        return allowed

    def _may_go(self, rule: Rule, message: Message, now: float) -> bool:
        """Whether it may go now; otherwise it waits until it may."""
        if rule.rate is None:
            return True
        return self._slow_to_mqtt.take((rule.ros, message.topic), rule.rate, message, now) is not None

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


def _apart(filters: list[str]) -> tuple[str, ...]:
    """Filters without those that another one covers: a broker may send what matches two of them twice."""
    each = dict.fromkeys(filters)
    return tuple(one for one in each if not any(other != one and topic_matches(other, one) for other in each))


@lru_cache(REMEMBERED_TOPICS)
def _known(topic: str) -> tuple[topics.Topic | None, dict[str, str]]:
    """The row of the topic table; none for topics of the rules' author."""
    try:
        return topics.find(topic)
    except BadMessage:
        return None, {}


def _moves(message: Message) -> bool:
    """Whether it is a command that has something done, other than to take note of a state."""
    row, _ = _known(message.topic)
    return row is not None and row.kind is topics.Kind.COMMAND and row is not topics.HOME_SET


def _short(fields: Fields) -> str:
    return text if len(text := repr(fields)) <= 120 else f"{text[:117]}..."
