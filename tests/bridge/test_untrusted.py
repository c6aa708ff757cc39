"""Whatever a robot says: on every topic and service that the bridge has, the worst that comes of it is a BadMessage."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from typing import Any

import pytest

from services import states, topics
from services.apartment.home import Home
from services.apartment.robot_places import Relation
from services.bridge import node, rulebook
from services.bridge.confirm import Confirm
from services.bridge.items import Items
from services.bridge.lenses import Lenses
from services.bridge.missions import Missions
from services.bridge.part import Part
from services.bridge.robots.kept import Kept
from services.bridge.robots.tiago import Settings, Tiago
from services.bridge.rules import Fields, Rule, read
from services.bridge.service import Bridge
from services.bridge.simulated import SimulatedNode
from services.bridge.snapshots import Snapshots
from services.bridge.tree import Tree
from services.bus import Message, topic_matches
from services.errors import BadMessage
from tests.bridge.robots.test_tiago import OURS, PLACES
from tests.bridge.test_service import CONFIG, NOW, RESULT
from tests.fuzz import payloads

pytestmark = pytest.mark.ros
pytest.importorskip("genpy", reason="apt-get install python3-genpy and message packages")

from services.bridge.messages import ARRAY, build, fields_of, message_class, on_the_wire, service_class  # noqa: E402

DRAWS = 2000  # of each topic
CALLS = 40  # of each service
ITEMS = {kind: {"type": kind, "label": kind} for kind in states.ITEM_TYPES}
WORDS = (*["find", "582"] * 8, "Zoom", "AudioRec", "Scan", "SetTarget", "Move", "tiago", "²", "9" * 5000, "٣", "0x10",
         "1e400", "{}", '{"value": NaN}', '{"id": 3}', '{"targets": [1e999]}', OURS, f"{OURS}g", f"{OURS}{'x' * 100}",
         *ITEMS, *(text.encode(errors="replace").decode() for text in payloads.TEXTS))  # fmt: skip
NUMBERS = (0.0, -0.0, 1.0, -1.5, 1e-320, 1e308, -1e308, float("nan"), float("inf"), float("-inf"))
BITS = {"byte": 8, "char": 8, **{f"{sign}int{bits}": bits for sign in ("", "u") for bits in (8, 16, 32, 64)}}
ANYTHING = ("std_msgs/String", "actionlib_msgs/GoalStatus", "actionlib_msgs/GoalStatusArray", "std_msgs/Empty",
            "diagnostic_msgs/DiagnosticStatus", "sensor_msgs/CameraInfo", "geometry_msgs/PoseStamped")  # fmt: skip


class Strict(SimulatedNode):
    """Builds what it publishes, as the node over rospy does."""

    def prepare(self, topic: str, fields: Fields, key: str = "") -> node.Say:
        kind = next(one.type for one in self.ports.outlets if one.topic == topic)
        if message_class(kind) is not None:  # move_base's goals need not be installed
            on_the_wire(build(message_class(kind), fields))
        return super().prepare(topic, fields, key)


@pytest.fixture
def bridge() -> Bridge:
    home, cameras = Home.model_validate({"items": ITEMS}), ("ip1",)
    robot = Tiago("tiago", Settings(poi="/poi"), PLACES, None, Kept(None))
    parts: list[Part] = [Items(home), Confirm(), Tree(cameras, {}, Relation()), Snapshots(cameras, None)]
    parts += [Lenses(cameras), Missions("tiago"), robot]
    rules = rulebook.load(CONFIG / "bridge.yaml", cameras)
    ports = [node.ports(rules), *(part.ports for part in parts)]
    outlets = [node.Outlet(rulebook.DIAGNOSTICS, "diagnostic_msgs/DiagnosticArray")]
    outlets += [one for each in ports for one in each.outlets]
    inlets, servers = ([one for each in ports for one in getattr(each, what)] for what in ("inlets", "servers"))
    whole = node.Ports(tuple(outlets), tuple(inlets), tuple(servers))
    return Bridge(home, rules, Strict(whole, lambda _: None), tuple(parts))


def drawn(rng: random.Random, slot: str) -> Any:
    """What may stand in a field, as ROS hands it over: its texts are UTF-8, its numbers any."""
    if array := ARRAY.fullmatch(slot):
        count = int(array[2]) if array[2] else rng.choice([0, 1, 3])
        return rng.randbytes(count) if array[1] in ("uint8", "char") else [drawn(rng, array[1]) for _ in range(count)]
    if slot == "string":
        return rng.choice(WORDS)
    if slot == "bool":
        return rng.random() < 0.5
    if slot in BITS:
        low = 0 if slot.startswith("u") else -(2 ** (BITS[slot] - 1))
        return rng.choice([low, low + 2 ** BITS[slot] - 1, 0, rng.randrange(10)])
    if slot.startswith("float"):
        return rng.choice(NUMBERS)
    if slot in ("time", "duration"):
        return rng.choice([0.0, 2.0**32 - 1, NOW])
    return fields(rng, message_class("std_msgs/Header" if slot == "Header" else slot))


def fields(rng: random.Random, kind: Any) -> dict[str, Any]:
    made = {name: drawn(rng, slot) for name, slot in zip(kind.__slots__, kind._slot_types, strict=True)}
    assert made.keys() == fields_of(kind()).keys()
    return made


def anything(rng: random.Random) -> dict[str, Any]:
    """Of a type that the publisher has chosen; perhaps an action's result."""
    kind = message_class(rng.choice(ANYTHING))
    return {"status": fields(rng, kind)} if rng.random() < 0.5 else fields(rng, kind)


def refused(bridge: Bridge, message: Message) -> bool:
    """Whether the bridge refuses it; anything else than taking or refusing it comes out of here."""
    try:
        list(bridge.handle(message, NOW))
    except BadMessage:
        return True
    finally:
        list(bridge.tick(NOW))
    return False


def test_a_word_on_any_topic_is_taken_or_refused(bridge: Bridge) -> None:
    assert isinstance(bridge.node, SimulatedNode)
    rng = random.Random(1)
    goal = Message("robot/tiago/goto", b'{"x": 1, "y": 2, "id": "g"}', received=NOW)
    for inlet in bridge.node.ports.inlets:
        said = 0
        for _ in range(DRAWS):
            bridge.parts[-1].hear(read(goal, NOW), NOW)
            told = anything(rng) if inlet.type == node.ANY else fields(rng, message_class(inlet.type))
            said += refused(bridge, Message(node.FROM_ROS + inlet.topic, value=told))
        assert said < DRAWS, inlet.topic


def test_a_word_on_the_bus_is_taken_or_refused_before_it_is_to_be_said(bridge: Bridge) -> None:
    rng, levels = (
        random.Random(1),
        {"cam": "ip1", "robot": "tiago", "component": "a", "service": "mission", "marker": "5"},
    )
    heard = 0
    for row in topics.TABLE:
        names = {name: levels.get(name, "Switch") for name in row.names}
        if not any(topic_matches(wanted, row.filter_for(**names)) for wanted in bridge.subscribes):
            continue
        heard += 1
        for _ in range(DRAWS // 4):
            refused(bridge, Message(row.name(**names), payloads.drawn(rng, row), received=NOW))
    assert heard > 10


@pytest.mark.parametrize("stamp", ["1969-12-31T23:59:59Z", "2106-02-07T06:28:16Z", "9999-12-31T23:59:59Z"])
def test_a_marker_seen_when_ros_has_no_time_is_refused_and_the_tree_goes_on(bridge: Bridge, stamp: str) -> None:
    assert isinstance(bridge.node, SimulatedNode)
    result = json.dumps({**RESULT, "stamp": stamp}).encode()
    with pytest.raises(BadMessage, match="1970 to 2106"):
        list(bridge.handle(Message("camera/ip1/marker/582", result, received=NOW, retain=True), NOW))
    list(bridge.tick(NOW))
    assert "/tf_static" in [topic for topic, _ in bridge.node.published]


def test_what_waits_for_its_time_can_be_said_then(bridge: Bridge) -> None:
    rule = {"direction": "to_ros", "mqtt": "lab/temp", "ros": "/lab/temp", "type": "std_msgs/Float64", "rate": 2,
            "fields": {"data": "{payload}"}}  # fmt: skip
    port = Strict(
        node.Ports((node.Outlet("/lab/temp", "std_msgs/Float64"), *bridge.node.ports.outlets)), lambda _: None
    )
    slow = Bridge(Home(items={}), (Rule.model_validate(rule),), port)

    def hears(text: bytes) -> None:
        assert not list(slow.handle(Message("lab/temp", text, received=NOW), NOW))

    hears(b"1")
    with pytest.raises(BadMessage, match=r"lab/temp to /lab/temp: data: expected float64, got 'warm'"):
        hears(b"warm")
    hears(b"2")
    list(slow.tick(NOW + 1))
    assert [fields for topic, fields in port.published if topic == "/lab/temp"] == [{"data": "1"}, {"data": "2"}]


def test_a_call_of_any_service_is_taken_or_refused_and_answered(bridge: Bridge) -> None:
    assert isinstance(bridge.node, SimulatedNode)
    rng = random.Random(1)
    for server in bridge.node.ports.servers:
        answers: list[Any] = []
        hear: Callable[[Any], None] = answers.append
        for _ in range(CALLS):
            call = node.Call(fields(rng, service_class(server.type)._request_class), hear)
            refused(bridge, Message(node.CALLED + server.name, value=call))
        list(bridge.tick(NOW + node.CALL_S))
        assert len(answers) == CALLS, server.name
