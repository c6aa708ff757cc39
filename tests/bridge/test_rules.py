"""What one rule makes of one message, in both directions."""

from __future__ import annotations

import json
from typing import Any

import pytest
from pydantic import ValidationError

from services.bridge.rules import Rule, read, to_mqtt, to_ros
from services.bus import Message, topic_matches
from services.errors import BadMessage

NOW = 1000.0
UPDATES = {
    "direction": "to_ros",
    "mqtt": "home/{item}/state",
    "ros": "iot_updates",
    "type": "diagnostic_msgs/KeyValue",
    "fields": {"key": "{item}", "value": "{payload}"},
}
COMMAND = {
    "direction": "to_mqtt",
    "mqtt": "home/{key}/command",
    "ros": "/iot_command",
    "type": "diagnostic_msgs/KeyValue",
    "payload": "{value}",
}


def rule(base: dict[str, Any], **changes: Any) -> Rule:
    return Rule.model_validate({**base, **changes})


def out(rule_: Rule, topic: str, payload: str | bytes) -> Any:
    payload = payload.encode() if isinstance(payload, str) else payload
    return to_ros(rule_, read(Message(topic, payload, received=NOW), NOW))


@pytest.mark.parametrize(
    ("changes", "topic", "payload", "fields"),
    [
        ({}, "home/Lamp/state", "ON", {"key": "Lamp", "value": "ON"}),
        ({}, "home/Temp/state", "21.5 °C", {"key": "Temp", "value": "21.5 °C"}),
        ({}, "home/Temp/state", "UNDEF", {"key": "Temp", "value": "UNDEF"}),
        ({}, "home/Temp/command", "ON", None),
        (
            {"mqtt": "my/{room}/pose", "fields": {"x": "{payload.position.x}", "in": "{room}"}},
            "my/hall/pose", '{"position": {"x": 1.5}}', {"x": 1.5, "in": "hall"},
        ),
        ({"mqtt": "my/{a}/#", "fields": {"t": "{topic}"}}, "my/x/y/z", "", {"t": "my/x/y/z"}),
        ({"mqtt": "my/{a}/#", "fields": {"t": "{a}"}}, "my/x", "", {"t": "x"}),
        ({"mqtt": "my/+/{a}", "fields": {"t": "{a}", "at": "{received}"}}, "my/x/y", "", {"t": "y", "at": NOW}),
        ({"mqtt": "my/{a}", "fields": {"v": "{payload.v}"}}, "my/x", '{"v": null}', None),
        ({"mqtt": "my/a.b", "fields": {"v": 1}}, "my/aXb", "", None),
        (
            {"mqtt": "my/{a}", "fields": {"data": "{payload}"}, "tables": {"data": {"ON": True, "OFF": False}}},
            "my/x", "ON", {"data": True},
        ),
        (
            {"mqtt": "camera/{cam}/motion", "fields": {"l": "{payload.value}"}, "tables": {"l": {"-1": 2}}},
            "camera/ip1/motion", '{"value": -1, "since": "2026-01-31T07:05:00Z"}', {"l": 2},
        ),
        ({"mqtt": "my/{a}", "fields": {"data": "{payload}"}}, "my/x", '{"a": 1}', {"data": '{"a": 1}'}),
    ],
)  # fmt: skip
def test_a_bus_message_becomes_fields(changes: Any, topic: str, payload: str, fields: Any) -> None:
    assert out(rule(UPDATES, **changes), topic, payload) == fields


@pytest.mark.parametrize(
    ("changes", "topic", "payload", "told"),
    [
        ({}, "home/Lamp/state", b"\xff", "expected UTF-8"),
        ({}, "home/1st/state", "ON", "no topic like"),
        ({"mqtt": "my/{a}"}, "my/x", b"\xff", "expected UTF-8"),
        ({"mqtt": "my/{a}"}, "my/x", "x" * 300_000, "at most"),
        ({"mqtt": "my/{a}", "fields": {"v": "{payload.v}"}}, "my/x", "no json", "expected JSON"),
        ({"mqtt": "my/{a}", "fields": {"v": "{payload.v}"}}, "my/x", '{"v": NaN}', "expected JSON"),
        ({"mqtt": "my/{a}", "fields": {"v": "{payload.v}"}}, "my/x", "[" * 100_000, "expected JSON"),
        ({"mqtt": "my/{a}", "fields": {"v": "{payload.v}"}}, "my/x", '{"w": 1}', "expected 'v' in it"),
        ({"mqtt": "my/{a}", "tables": {"value": {"ON": 1}}}, "my/x", "OFF", "expected one of ON"),
    ],
)
def test_what_cannot_be_said_on_ros_is_told(changes: Any, topic: str, payload: str, told: str) -> None:
    changes = {"fields": {"value": "{payload}"}, **changes}
    with pytest.raises(BadMessage, match=told):
        out(rule(UPDATES, **changes), topic, payload)


@pytest.mark.parametrize(
    ("changes", "fields", "topic", "payload"),
    [
        ({}, {"key": "Lamp", "value": "ON"}, "home/Lamp/command", "ON"),
        ({"mqtt": "home/{key}/set"}, {"key": "Temp", "value": "21.5 °C"}, "home/Temp/set", "21.5 °C"),
        ({"mqtt": "my/topic", "payload": "{data}"}, {"data": True}, "my/topic", "true"),
        ({"mqtt": "my/{a}", "payload": "{x} m"}, {"a": "hall", "x": 2.0}, "my/hall", "2.0 m"),
        ({"mqtt": "my/a", "payload": "{data}", "tables": {"payload": {"true": "ON"}}}, {"data": True}, "my/a", "ON"),
    ],
)  # fmt: skip
def test_fields_become_a_bus_message(changes: Any, fields: Any, topic: str, payload: str) -> None:
    message = to_mqtt(rule(COMMAND, **changes), fields, NOW)
    assert (message.topic, message.payload.decode(), message.retain) == (topic, payload, False)


def test_a_point_becomes_a_position_to_go_to() -> None:
    point = rule(COMMAND, mqtt="camera/ip1/position/set", payload={"pan": "{x}", "tilt": "{y}", "zoom": "{z}"})
    message = to_mqtt(point, {"x": 10.0, "y": -5.5, "z": 0.0}, NOW)
    assert {"pan": 10.0, "tilt": -5.5, "zoom": 0.0}.items() <= json.loads(message.payload).items()
    assert message.expires_s, "a command expires"


@pytest.mark.parametrize(("value", "by"), [("Kitchen", "human"), ('{"value": "Kitchen", "by": "mission"}', "mission")])
def test_an_order_is_a_humans_unless_it_says_more(value: str, by: str) -> None:
    order = rule(COMMAND, mqtt="camera/ip1/order/{key}")
    said = json.loads(to_mqtt(order, {"key": "Goto", "value": value}, NOW).payload)
    assert (said["value"], said["by"]) == ("Kitchen", by)


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("", "1 to 128 characters, got 0"),
        ("x" * 129, "1 to 128 characters, got 129"),
        ("a/b", "without / "),
        ("+", "without / "),
        ("#", "without / "),
        ("a\nb", "control characters"),
        ("a\x00", "control characters"),
        ("1st", "no topic like"),
        ("$SYS", "no topic like"),
        ("ø", "no topic like"),
    ],
)
def test_a_key_does_not_break_out_of_its_topic(key: str, told: str) -> None:
    with pytest.raises(BadMessage, match=told):
        to_mqtt(rule(COMMAND), {"key": key, "value": "ON"}, NOW)


@pytest.mark.parametrize(
    ("payload", "fields", "told"),
    [
        ({"pan": "{x}"}, {"x": float("nan")}, "finite"),
        ("{x}", {"x": "no json"}, "Invalid JSON|JSON"),
        ("{x}", {"x": "\ud800"}, "UTF-8"),
        ({"pan": "{y}"}, {"x": 1.0}, "expected 'y'"),
        ({"pan": "{x}"}, {"x": None}, "got none"),
        ({"pan": "{x}"}, {"x": b"raw"}, "finite numbers and texts"),
    ],
)
def test_what_cannot_be_said_on_the_bus_is_told(payload: Any, fields: Any, told: str) -> None:
    position = rule(COMMAND, mqtt="camera/ip1/position/set", payload=payload)
    with pytest.raises(BadMessage, match=told):
        to_mqtt(position, fields, NOW)


@pytest.mark.parametrize(
    ("base", "changes", "told"),
    [
        (UPDATES, {"direction": "both"}, "to_ros"),
        (UPDATES, {"ros": "iot-updates"}, "ROS name"),
        (UPDATES, {"ros": "iot//updates"}, "ROS name"),
        (UPDATES, {"ros": "iot/updates/"}, "ROS name"),
        (UPDATES, {"ros": "~private"}, "ROS name"),
        (UPDATES, {"ros": "1st"}, "ROS name"),
        (UPDATES, {"ros": ""}, "ROS name"),
        (UPDATES, {"type": "KeyValue"}, "type like"),
        (UPDATES, {"mqtt": "home/x{item}/state"}, "levels"),
        (UPDATES, {"mqtt": "home/#/state"}, "levels"),
        (UPDATES, {"mqtt": "home//state"}, "levels"),
        (UPDATES, {"mqtt": "home/{a}/{a}"}, "once"),
        (UPDATES, {"fields": {"key": "{itme}"}}, "{itme}"),
        (UPDATES, {"payload": "x"}, "neither payload"),
        (UPDATES, {"queue": 0}, "greater"),
        (UPDATES, {"each": "camera"}, "{cam}"),
        (UPDATES, {"colour": "red"}, "Extra"),
        (COMMAND, {"mqtt": "home/+/command"}, r"no \+"),
        (COMMAND, {"payload": None}, "expected payload"),
        (COMMAND, {"latch": True}, "neither fields"),
        (COMMAND, {"most": 0}, "greater"),
        (COMMAND, {"ranges": {"x": [5, 1]}}, "low, high"),
        (COMMAND, {"ranges": {"x": [0, "inf"]}}, "finite"),
        (UPDATES, {"most": 5}, "neither payload"),
        (UPDATES, {"ranges": {"x": [0, 1]}}, "neither payload"),
    ],
)
def test_a_rule_that_cannot_work_is_refused(base: Any, changes: Any, told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        rule(base, **changes)


@pytest.mark.parametrize("mqtt", ["home/{item}/state", "my/+/{a}/#", "my/topic"])
def test_filter_and_pattern_agree(mqtt: str) -> None:
    made = rule(UPDATES, mqtt=mqtt, fields={})
    for topic in ("home/x/state", "home/state", "my/a/b", "my/a/b/c/d", "my/topic", "my/topic/x"):
        assert topic_matches(made.filter, topic) == bool(made.pattern.fullmatch(topic)), topic


@pytest.mark.parametrize(
    ("changes", "latched"),
    [
        ({"mqtt": "camera/{cam}/position"}, True),
        ({"mqtt": "camera/{cam}/marker/{marker}"}, True),
        ({"mqtt": "camera/{cam}/scan/result"}, False),
        ({"mqtt": "home/{item}/state", "replay": True}, False),
        ({"mqtt": "lab/{bench}"}, False),
        ({"mqtt": "lab/{bench}", "latch": True}, True),
        ({"mqtt": "camera/{cam}/position", "latch": False}, False),
    ],
)
def test_what_is_retained_on_mqtt_is_latched_on_ros(changes: Any, latched: bool) -> None:
    assert rule(UPDATES, fields={}, **changes).latches is latched
