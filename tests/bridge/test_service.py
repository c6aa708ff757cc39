"""The service with a node in memory: lists of messages in and out."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from services.bridge import Config, limits, start
from services.bridge.node import LINK, Link
from services.bridge.rules import Rule
from services.bridge.service import Bridge, GivenUp
from services.bridge.simulated import SimulatedNode
from services.bus import Message
from services.errors import BadMessage

CONFIG = Path(__file__).parents[2] / "config"
NOW = 1000.0
OWN_RULES = """
  - {direction: to_ros, mqtt: lab/two, ros: lab/first, type: std_msgs/String, fields: {data: '{payload.first}'}}
  - {direction: to_ros, mqtt: lab/two, ros: lab/second, type: std_msgs/String, fields: {data: '{payload.second}'}}
  - {direction: to_ros, mqtt: 'lab/{bench}/temp', ros: lab/{0}, type: std_msgs/Float64, fields: {data: '{payload}'},
     rate: 2, replay: true}
  - {direction: to_mqtt, ros: lab/goal, type: geometry_msgs/PoseStamped, mqtt: lab/goal, rate: 2, qos: 0, retain: true,
     payload: {x: '{pose.position.x}', frame: '{header.frame_id}'}}
  - {direction: to_ros, mqtt: lab/where, ros: lab/where, type: geometry_msgs/PoseStamped,
     fields: {header: {stamp: '{payload.at}', frame_id: map}, pose: {position: '{payload.position}'}}}
""".replace("{0}", "temp")
HOME = {
    "items": {
        "Lamp": {"type": "Switch", "label": "Lamp"},
        "Temp": {"type": "Number:Temperature", "label": "Temperature", "read_only": True},
        "Door": {"type": "Contact", "label": "Door"},
        "Note": {"type": "String", "label": "Note"},
        "Private": {"type": "Switch", "label": "Not for robots", "ros": False},
    }
}
RESULT = {
    "camera": "ip1", "marker": 582, "dictionary": "DICT_5X5_1000", "place": "Kitchen",
    "position": {"x": 1.0, "y": 2.0, "z": 0.5}, "covariance": [[1e-4, 0, 0], [0, 2e-4, 0], [0, 0, 3e-4]],
    "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, "first_seen": "2026-01-31T07:05:00.123Z",
    "stamp": "2026-01-31T07:05:00.123Z", "scan": "s1",
}  # fmt: skip


class Driven:
    """The service, its node, and what it posted to itself, delivered at once."""

    def __init__(self, service: Bridge, posted: list[Message]) -> None:
        self.service = service
        self.posted = posted
        assert isinstance(service.node, SimulatedNode)
        self.node = service.node

    def hears(self, topic: str, payload: str | dict[str, Any], now: float = NOW, **flags: Any) -> list[tuple[str, Any]]:
        """A bus message; returns what ROS is told."""
        text = payload if isinstance(payload, str) else json.dumps(payload)
        return self.hears_bytes(topic, text.encode(), now, **flags)

    def hears_bytes(self, topic: str, payload: bytes, now: float = NOW, **flags: Any) -> list[tuple[str, Any]]:
        """The same with a payload that is no text."""
        self.node.published.clear()
        assert not list(self.service.handle(Message(topic, payload, received=now, **flags), now))
        return list(self.node.published)

    def robot_says(self, topic: str, key: str, value: str, now: float = NOW) -> list[tuple[str, str]]:
        """A KeyValue on a ROS topic; returns what the bus is told."""
        self.node.send(topic, {"key": key, "value": value})
        published = [out for message in self.take() for out in self.service.handle(message, now)]
        return [(message.topic, message.payload.decode()) for message in published]

    def take(self) -> list[Message]:
        taken, self.posted[:] = list(self.posted), []
        return taken

    def own_health(self, now: float) -> dict[str, Any]:
        (message,) = self.service.tick(now)
        assert (message.topic, message.retain) == ("diagnostics/bridge", True)
        health: dict[str, Any] = json.loads(message.payload)
        return health


@pytest.fixture
def bridge() -> Iterator[Driven]:
    config = Config.model_validate({"home": HOME, "cameras": ("ip1", "ip2"), "folder": CONFIG, "simulated": True})
    posted: list[Message] = []
    with start(config, posted.append) as service:
        driven = Driven(service, posted)
        for message in driven.take():
            assert not list(service.handle(message, NOW))
        list(service.tick(NOW))
        yield driven


def test_it_asks_for_what_the_rules_need(bridge: Driven) -> None:
    assert set(bridge.service.subscribes) == {
        "home/+/state", "diagnostics/#", "camera/ip1/scan/result", "camera/ip2/scan/result",
        "camera/ip1/motion", "camera/ip2/motion", "camera/ip1/scan/image", "camera/ip2/scan/image",
        "camera/+/position", "camera/+/marker/+", "camera/+/status", "camera/+/snapshot", "camera/+/order_result",
    }  # fmt: skip


@pytest.mark.parametrize(("item", "state"), [("Lamp", "ON"), ("Temp", "21.5 °C"), ("Temp", "UNDEF"), ("Note", "")])
def test_a_state_is_an_update_for_the_robot(bridge: Driven, item: str, state: str) -> None:
    assert bridge.hears(f"home/{item}/state", state) == [("/iot_updates", {"key": item, "value": state})]


def test_an_item_outside_group_ros_stays_at_home(bridge: Driven) -> None:
    assert bridge.hears("home/Private/state", "ON") == []
    assert bridge.hears("home/Unknown/state", "ON") == []


def test_a_state_that_its_item_cannot_have_is_refused(bridge: Driven) -> None:
    with pytest.raises(BadMessage, match="expected one of ON, OFF"):
        bridge.hears("home/Lamp/state", "21.5")


def test_a_new_subscriber_is_first_sent_every_current_state_and_only_it(bridge: Driven) -> None:
    early: list[Any] = []
    late: list[Any] = []
    bridge.node.subscribe("/iot_updates", early.append)
    for item, state in (("Lamp", "ON"), ("Door", "OPEN"), ("Lamp", "OFF")):
        bridge.hears(f"home/{item}/state", state)
    bridge.node.subscribe("/iot_updates", late.append)
    bridge.hears("home/Door/state", "CLOSED")
    assert [f"{fields['key']} {fields['value']}" for fields in late] == ["Lamp OFF", "Door OPEN", "Door CLOSED"]
    assert [f"{fields['key']} {fields['value']}" for fields in early] == [
        "Lamp ON", "Door OPEN", "Lamp OFF", "Door CLOSED",
    ]  # fmt: skip


@pytest.mark.parametrize("topic", ["/iot_command", "/iot_set"])
def test_refresh_says_everything_again_to_all(bridge: Driven, topic: str) -> None:
    bridge.hears("home/Lamp/state", "ON")
    bridge.hears("home/Door/state", "OPEN")
    bridge.node.published.clear()
    assert bridge.robot_says(topic, "ROS_COMMAND", "REFRESH") == []
    assert list(bridge.node.published) == [
        ("/iot_updates", {"key": "Lamp", "value": "ON"}),
        ("/iot_updates", {"key": "Door", "value": "OPEN"}),
    ]


@pytest.mark.parametrize(
    ("topic", "key", "value", "said"),
    [
        ("/iot_command", "Lamp", "ON", ("home/Lamp/command", "ON")),
        ("/iot_command", "Note", "hello", ("home/Note/command", "hello")),
        ("/iot_set", "Door", "OPEN", ("home/Door/set", "OPEN")),
        ("/iot_set", "Temp", "UNDEF", ("home/Temp/set", "UNDEF")),
    ],
)
def test_a_robots_word_reaches_the_home(bridge: Driven, topic: str, key: str, value: str, said: Any) -> None:
    assert bridge.robot_says(topic, key, value) == [said]


@pytest.mark.parametrize(
    ("topic", "key", "value", "reason"),
    [
        ("/iot_command", "Door", "OPEN", "takes no commands"),
        ("/iot_command", "Temp", "20", "read only"),
        ("/iot_command", "Lamp", "UNDEF", "use `set`"),
        ("/iot_command", "Lamp", "BLUE", "expected one of ON, OFF"),
        ("/iot_command", "Private", "ON", "expected an item of group ROS"),
        ("/iot_command", "Nobody", "ON", "expected an item of group ROS"),
        ("/iot_command", "ROS_COMMAND", "DANCE", "expected an item of group ROS"),
        ("/iot_set", "Lamp", "BLUE", "expected one of ON, OFF"),
        ("/iot_set", "Lamp/state", "ON", "without / "),
        ("/iot_set", "#", "ON", "without / "),
        ("/iot_set", "", "ON", "1 to 128 characters"),
        ("/iot_set", "x" * 200, "ON", "1 to 128 characters"),
        ("/iot_set", "a\tb", "ON", "control characters"),
        ("/ip_camera_order", "Go To", "Kitchen", "no topic like"),
    ],
)
def test_a_refused_word_is_told_on_the_diagnostics(
    bridge: Driven, topic: str, key: str, value: str, reason: str
) -> None:
    with pytest.raises(BadMessage, match=reason):
        bridge.robot_says(topic, key, value, NOW + 0.5)
    health = bridge.own_health(NOW + 0.5)
    assert (health["level"], health["values"]["refused"]) == (1, "1")
    assert topic in health["message"]
    assert reason in health["message"]
    assert bridge.service.counters["refused"] == 1


def latched(topic: str, key: str, value: str) -> Message:
    return Message(f"/ros{topic}", value={"key": key, "value": value}, retain=True)


@pytest.mark.parametrize("word", [("/iot_command", "Lamp", "ON"), ("/ip_camera_order", "Move", "Left")])
def test_a_command_that_was_latched_before_the_bridge_was_there_is_refused(
    bridge: Driven, word: tuple[str, str, str]
) -> None:
    with pytest.raises(BadMessage, match="latched before the bridge was there"):
        list(bridge.service.handle(latched(*word), NOW))
    assert bridge.own_health(NOW + 0.5)["level"] == 1


def test_a_state_or_a_question_that_was_latched_is_taken(bridge: Driven) -> None:
    bridge.hears("home/Lamp/state", "ON")
    (told,) = bridge.service.handle(latched("/iot_set", "Door", "OPEN"), NOW)
    assert (told.topic, told.payload) == ("home/Door/set", b"OPEN")
    assert not list(bridge.service.handle(latched("/iot_command", "ROS_COMMAND", "REFRESH"), NOW))
    assert bridge.service.counters["refused"] == 0


def test_the_warning_passes(bridge: Driven) -> None:
    with pytest.raises(BadMessage):
        bridge.robot_says("/iot_command", "Door", "OPEN")
    assert bridge.own_health(NOW + 5)["level"] == 1
    assert bridge.own_health(NOW + 11)["level"] == 0


def test_a_flood_of_refusals_does_not_become_one_of_diagnostics(bridge: Driven) -> None:
    said = 0
    for step in range(1000):
        with pytest.raises(BadMessage):
            bridge.robot_says("/iot_command", "Door", "OPEN", NOW + step / 1000)
        said += len(list(bridge.service.tick(NOW + step / 1000)))
    assert said <= 6


def test_orders_and_positions_reach_the_camera_they_name(bridge: Driven) -> None:
    ((topic, order),) = bridge.robot_says("/ip_camera_order", "Goto", "Kitchen")
    assert (topic, json.loads(order)["value"]) == ("camera/ip1/order/Goto", "Kitchen")
    ((topic, _),) = bridge.robot_says("/ip2/ip_camera_order", "Scan", "ON")
    assert topic == "camera/ip2/order/Scan"
    bridge.node.send("/ip_camera_position", {"x": 41.0, "y": 34.5, "z": 0.0})
    (message,) = bridge.service.handle(bridge.take()[0], NOW)
    assert message.topic == "camera/ip1/position/set"
    assert json.loads(message.payload)["pan"] == 41.0


def test_a_scan_result_is_place_position_and_pose(bridge: Driven) -> None:
    place, position, pose = bridge.hears("camera/ip1/scan/result", RESULT)
    assert place == ("/ip_camera_scan/result/place", {"key": 582, "value": "Kitchen"})
    assert position == ("/ip_camera_scan/result/position", {"x": 1.0, "y": 2.0, "z": 0.5})
    assert pose[0] == "/ip_camera_scan/result/pose"
    assert pose[1]["header"] == {"stamp": "2026-01-31T07:05:00.123Z", "frame_id": "apartment"}
    assert pose[1]["pose"]["pose"] == {"position": RESULT["position"], "orientation": RESULT["orientation"]}
    covariance = pose[1]["pose"]["covariance"]
    assert [covariance[7 * axis] for axis in range(6)] == [1e-4, 2e-4, 3e-4, 0.03, 0.03, 0.03]
    assert len(covariance) == 36


def test_a_result_without_a_position_is_a_place_only(bridge: Driven) -> None:
    said = bridge.hears("camera/ip2/scan/result", {**RESULT, "camera": "ip2", "position": None, "why": "too far"})
    assert [topic for topic, _ in said] == ["/ip2/ip_camera_scan/result/place"]


@pytest.mark.parametrize(("value", "level"), [(0, 0), (1, 1), (-1, 2)])
def test_motion_is_a_status_with_its_value(bridge: Driven, value: int, level: int) -> None:
    ((topic, status),) = bridge.hears("camera/ip1/motion", {"value": value, "since": "2026-01-31T07:05:00.123Z"})
    assert (topic, status["level"], status["values"][0]) == (
        "/ip_camera_motion_alarm", level, {"key": "motion", "value": value},
    )  # fmt: skip


def test_many_statuses_are_said_some_at_a_time_and_each_once_a_second(bridge: Driven) -> None:
    for number in range(120):
        bridge.hears(f"diagnostics/service/s{number}", {"level": 0, "message": "ok"}, NOW)
    bridge.node.published.clear()
    said: list[tuple[float, list[str]]] = []
    now = NOW + 1.0
    while now < NOW + 3.0:
        list(bridge.service.tick(now))
        said += [(now, [one["name"] for one in fields["status"]]) for _, fields in bridge.node.published]
        bridge.node.published.clear()
        assert bridge.service.due is not None
        now = max(bridge.service.due, now + 0.001)
    assert max(len(names) for _, names in said) == 50
    times = [at for at, names in said if "service: s7" in names]
    assert [at - times[0] for at in times] == pytest.approx([0.0, 1.0])
    assert sum("service: s119" in names for _, names in said) == 2


def test_diagnostics_are_one_array_a_second_and_turn_stale(bridge: Driven) -> None:
    bridge.hears(
        "diagnostics/camera/ip1", {"level": 1, "message": "slow", "values": {"fps": "3"}, "hardware_id": "ip1"}
    )
    bridge.hears("diagnostics/persistence", {"level": 0, "message": "ok"}, NOW + 4)
    list(bridge.service.tick(NOW + 0.5))
    list(bridge.service.tick(NOW + 4))
    list(bridge.service.tick(NOW + 6))
    arrays = [fields for topic, fields in bridge.node.published if topic == "/diagnostics"]
    assert [array["header"]["stamp"] for array in arrays] == [NOW + 4, NOW + 6]
    assert arrays[0]["status"][0] == {
        "level": 1, "name": "camera: ip1", "message": "slow", "hardware_id": "ip1",
        "values": [{"key": "fps", "value": "3"}],
    }  # fmt: skip
    assert [(status["name"], status["level"]) for status in arrays[1]["status"][:2]] == [
        ("camera: ip1", 3), ("persistence: health", 0),
    ]  # fmt: skip


def test_without_a_master_it_says_so_and_the_home_goes_on(bridge: Driven) -> None:
    away = Message(LINK, value=Link(up=False, text="connection refused", registrations=1))
    assert not list(bridge.service.handle(away, NOW + 2))
    health = bridge.own_health(NOW + 2)
    assert (health["level"], health["message"]) == (2, "no ROS master: connection refused")
    assert bridge.hears("home/Lamp/state", "ON", NOW + 2)


def test_a_node_that_was_shut_down_ends_the_service(bridge: Driven) -> None:
    gone = Message(LINK, value=Link(up=False, text="shut down from outside", ended=True))
    assert not list(bridge.service.handle(gone, NOW))
    with pytest.raises(GivenUp, match="shut down from outside"):
        list(bridge.service.tick(NOW))


@pytest.mark.parametrize("topic", ["/bridge/link", "/ros/iot_command", "home/a/b/c", "$SYS/x", ""])
def test_a_topic_that_only_looks_like_ours_is_no_crash(bridge: Driven, topic: str) -> None:
    try:
        assert bridge.hears(topic, "payload") == []
    except BadMessage:
        assert topic == "home/a/b/c"


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Driven]:
    """A bridge with rules of its owner's own."""
    (tmp_path / "bridge.yaml").write_text((CONFIG / "bridge.yaml").read_text(encoding="utf-8") + OWN_RULES)
    config = Config.model_validate({"home": HOME, "cameras": ("ip1",), "folder": tmp_path, "simulated": True})
    posted: list[Message] = []
    with start(config, posted.append) as service:
        driven = Driven(service, posted)
        driven.take()
        yield driven


def test_one_rules_fault_does_not_keep_the_others_from_theirs(lab: Driven) -> None:
    with pytest.raises(BadMessage, match=r"lab/two to /lab/first: expected 'first' in it"):
        lab.hears("lab/two", '{"second": "b"}')
    assert list(lab.node.published) == [("/lab/second", {"data": "b"})]


def test_what_comes_faster_than_its_rule_allows_waits_and_only_the_newest_goes(lab: Driven) -> None:
    assert lab.hears("lab/a/temp", "1", NOW) == [("/lab/temp", {"data": "1"})]
    assert lab.hears("lab/b/temp", "7", NOW) == [("/lab/temp", {"data": "7"})], "each topic has its own time"
    assert lab.hears("lab/a/temp", "2", NOW + 0.1) == lab.hears("lab/a/temp", "3", NOW + 0.2) == []
    list(lab.service.tick(NOW + 0.4))
    assert ("/lab/temp", {"data": "3"}) not in lab.node.published
    assert lab.service.due <= NOW + 0.5
    list(lab.service.tick(NOW + 0.5))
    assert [fields for topic, fields in lab.node.published if topic == "/lab/temp"] == [{"data": "3"}]


def test_a_robots_word_waits_too_where_its_rule_says_so(lab: Driven) -> None:
    def says(x: float, now: float) -> list[Message]:
        lab.node.send("/lab/goal", {"pose": {"position": {"x": x}}, "header": {"frame_id": "map"}})
        return [out for message in lab.take() for out in lab.service.handle(message, now)]

    (first,) = says(1.0, NOW)
    assert (first.topic, first.retain, first.qos) == ("lab/goal", True, 0)
    assert json.loads(first.payload) == {"x": 1.0, "frame": "map"}
    assert says(2.0, NOW + 0.1) == says(3.0, NOW + 0.2) == []
    later = [message for message in lab.service.tick(NOW + 0.6) if message.topic == "lab/goal"]
    assert [json.loads(message.payload)["x"] for message in later] == [3.0]


def test_more_than_a_rule_allows_is_refused_and_told_until_the_second_is_over(bridge: Driven) -> None:
    for number in range(20):
        assert bridge.robot_says("/ip_camera_order", "Move", "Left", NOW + number / 1000)
    with pytest.raises(BadMessage, match="at most 20 a second"):
        bridge.robot_says("/ip_camera_order", "Move", "Right", NOW + 0.03)
    assert "at most 20 a second" in bridge.own_health(NOW + 0.5)["message"]
    assert bridge.robot_says("/ip_camera_order", "Move", "Right", NOW + 0.1)
    assert bridge.robot_says("/ip2/ip_camera_order", "Move", "Right", NOW + 0.03), "each topic has its own"


def test_a_stop_is_never_one_too_many(bridge: Driven) -> None:
    for _ in range(50):
        ((topic, order),) = bridge.robot_says("/ip_camera_order", "Move", "Stop")
        assert (topic, json.loads(order)["value"]) == ("camera/ip1/order/Move", "Stop")
    assert bridge.robot_says("/ip_camera_order", "Goto", "Kitchen")


@pytest.mark.parametrize(("x", "z"), [(361.0, 0.0), (-1e9, 0.0), (10.0, 8.5)])
def test_a_position_out_of_range_is_the_cameras_to_refuse(bridge: Driven, x: float, z: float) -> None:
    bridge.node.send("/ip_camera_position", {"x": x, "y": 0.0, "z": z})
    (message,) = bridge.service.handle(bridge.take()[0], NOW)
    said = json.loads(message.payload)
    assert (message.topic, said["pan"], said["zoom"]) == ("camera/ip1/position/set", x, z)


@pytest.mark.parametrize(("key", "value"), [("Zoom", "9"), ("AudioRec", "0.5"), ("AudioRec", "601")])
def test_an_order_out_of_range_is_the_cameras_to_refuse(bridge: Driven, key: str, value: str) -> None:
    ((topic, order),) = bridge.robot_says("/ip_camera_order", key, value)
    assert (topic, json.loads(order)["value"]) == (f"camera/ip1/order/{key}", value)


@pytest.mark.parametrize("x", [float("nan"), float("inf"), -float("inf")])
def test_a_position_that_is_no_number_goes_nowhere_and_is_told(bridge: Driven, x: float) -> None:
    bridge.node.send("/ip_camera_position", {"x": x, "y": 0.0, "z": 0.0})
    with pytest.raises(BadMessage, match=r"/ip_camera_position .*: expected finite numbers"):
        list(bridge.service.handle(bridge.take()[0], NOW))
    assert "expected finite numbers" in bridge.own_health(NOW + 0.5)["message"]
    assert bridge.service.counters["refused"] == 1


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [("Temp", "21.5 °C", None), ("temp", "28", None), ("Temp", "UNDEF", None), ("Other", "99", None),
     ("Temp", "28.1", "from 5 to 28"), ("Temp", "-3 °C", "from 5 to 28"), ("Temp", ".5e9", "from 5 to 28")],
)  # fmt: skip
def test_a_range_is_of_the_value_that_belongs_to_a_key(key: str, value: str, told: str | None) -> None:
    rule = Rule.model_validate(
        {"direction": "to_mqtt", "ros": "a", "type": "diagnostic_msgs/KeyValue", "mqtt": "lab/{key}",
         "payload": "{value}", "ranges": {"Temp": [5, 28]}}
    )  # fmt: skip
    words = {"key": key, "value": value}
    if told is None:
        limits.check(rule, words, limits.Allowance(), NOW)
    else:
        with pytest.raises(BadMessage, match=told):
            limits.check(rule, words, limits.Allowance(), NOW)
