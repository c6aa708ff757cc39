"""Fields to the messages of installed types, and back."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import pytest

from services.bridge.rules import Rule
from services.errors import BadMessage

pytestmark = pytest.mark.ros
pytest.importorskip("genpy", reason="apt-get install python3-genpy and message packages")

from services.bridge.messages import build, faults, fields_of, message_class, on_the_wire  # noqa: E402


@pytest.mark.parametrize(
    ("kind", "fields", "path", "value"),
    [
        ("diagnostic_msgs/KeyValue", {"key": "a", "value": "21.5 °C"}, "value", "21.5 °C"),
        ("diagnostic_msgs/KeyValue", {"key": 582, "value": True}, "key", "582"),
        ("diagnostic_msgs/KeyValue", {"key": "a", "value": {"x": 1}}, "value", '{"x": 1}'),
        ("std_msgs/Bool", {"data": "ON"}, "data", True),
        ("std_msgs/Bool", {"data": "CLOSED"}, "data", False),
        ("std_msgs/Bool", {"data": True}, "data", True),
        ("std_msgs/Float64", {"data": "21.5 °C"}, "data", 21.5),
        ("std_msgs/Float64", {"data": 3}, "data", 3.0),
        ("std_msgs/Int32", {"data": "-7"}, "data", -7),
        ("std_msgs/Int64", {"data": 2**62 + 1}, "data", 2**62 + 1),
        ("std_msgs/Time", {"data": "2026-01-31T07:05:00.123Z"}, "data.secs", 1769843100),
        ("std_msgs/Time", {"data": 1.5}, "data.nsecs", 500_000_000),
        ("std_msgs/Duration", {"data": "1.5"}, "data.secs", 1),
        ("geometry_msgs/PoseStamped", {"pose": {"position": {"x": 1}}}, "pose.position.x", 1.0),
        ("geometry_msgs/PoseStamped", {"header": {"frame_id": "map"}}, "header.frame_id", "map"),
        ("sensor_msgs/CompressedImage", {"data": b"\xff\xd8"}, "data", b"\xff\xd8"),
        ("diagnostic_msgs/DiagnosticStatus", {"level": 2}, "level", 2),
    ],
)
def test_a_field_becomes_what_its_type_wants(kind: str, fields: Any, path: str, value: Any) -> None:
    message = build(message_class(kind), fields)
    for name in path.split("."):
        message = getattr(message, name)
    assert message == value


@pytest.mark.parametrize(
    ("kind", "fields", "told"),
    [
        ("diagnostic_msgs/KeyValue", {"kee": "a"}, "kee: expected one of key, value"),
        ("diagnostic_msgs/KeyValue", {"value": "\ud800"}, "surrogates not allowed"),
        ("diagnostic_msgs/KeyValue", {"value": b"raw"}, "value: expected string"),
        ("diagnostic_msgs/DiagnosticStatus", {"level": 300}, "level"),
        ("diagnostic_msgs/DiagnosticStatus", {"values": {"key": "a"}}, "values: expected"),
        ("diagnostic_msgs/DiagnosticStatus", {"values": [{"key": "a"}, {"x": 1}]}, r"values\[1\].x: expected"),
        ("std_msgs/Bool", {"data": "perhaps"}, "data: expected bool"),
        ("std_msgs/Float64", {"data": "warm"}, "data: expected float64"),
        ("std_msgs/Float64", {"data": None}, "data: expected float64"),
        ("std_msgs/Int32", {"data": 1.5}, "whole"),
        ("std_msgs/Int32", {"data": 2**40}, "std_msgs/Int32|data"),
        ("std_msgs/UInt8", {"data": -1}, "std_msgs/UInt8|data"),
        ("std_msgs/Time", {"data": "tomorrow"}, "data: expected time"),
        ("std_msgs/Time", {"data": -1}, "data: expected time"),
        ("std_msgs/Time", {"data": 1e300}, "std_msgs/Time|data"),
        ("geometry_msgs/PoseStamped", {"pose": {"position": 3}}, r"pose.position: expected the fields"),
        ("geometry_msgs/PoseStamped", {"pose": {"position": {"q": 3}}}, r"pose.position.q: expected one of"),
        ("geometry_msgs/PoseWithCovariance", {"covariance": [1.0] * 35}, "PoseWithCovariance|covariance"),
    ],
)
def test_a_field_that_does_not_fit_is_named(kind: str, fields: Any, told: str) -> None:
    with pytest.raises(BadMessage, match=told):
        on_the_wire(build(message_class(kind), fields))


def test_a_message_becomes_plain_fields() -> None:
    fields = {
        "header": {"stamp": 1.5, "frame_id": "map"},
        "status": [{"level": 1, "name": "n", "values": [{"key": "a", "value": "b"}]}],
    }
    plain = fields_of(build(message_class("diagnostic_msgs/DiagnosticArray"), fields))
    assert plain["header"] == {"seq": 0, "stamp": 1.5, "frame_id": "map"}
    assert plain["status"][0]["values"] == [{"key": "a", "value": "b"}]


def test_what_was_built_can_be_read_back() -> None:
    kind: Any = message_class("geometry_msgs/PoseWithCovarianceStamped")
    out = BytesIO()
    build(kind, {"pose": {"covariance": [float(index) for index in range(36)]}}).serialize(out)
    assert kind().deserialize(out.getvalue()).pose.covariance[35] == 35.0


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"type": "diagnostic_msgs/Nothing"}, "installed message type"),
        ({"type": "no_such_msgs/Nothing"}, "installed message type"),
        ({"fields": {"kee": "x"}}, "expected one of key, value"),
        ({"type": "geometry_msgs/PoseStamped", "fields": {"pose": {"place": {}}}}, "expected one of position"),
        ({"type": "diagnostic_msgs/DiagnosticStatus", "fields": {"values": [{"kee": "x"}]}}, "expected one of key"),
        ({"direction": "to_mqtt", "payload": "{vlaue}"}, "got {vlaue}"),
        ({"direction": "to_mqtt", "mqtt": "my/{kee}", "payload": "{value}"}, "got {kee}"),
        ({"direction": "to_mqtt", "type": "geometry_msgs/PoseStamped", "payload": "{pose.place}"}, "got {pose.place}"),
    ],
)
def test_a_rule_for_unknown_types_or_fields_is_told(changes: Any, told: str) -> None:
    rule = {"direction": "to_ros", "mqtt": "my/topic", "ros": "a", "type": "diagnostic_msgs/KeyValue", **changes}
    (fault,) = faults(Rule.model_validate(rule))
    assert told in fault[1]


@pytest.mark.parametrize("payload", ["{pose.position.x}", "{header.frame_id}", "{pose}", {"at": "{header.stamp}"}])
def test_nested_fields_are_known(payload: Any) -> None:
    rule = {"direction": "to_mqtt", "mqtt": "my/topic", "ros": "a", "type": "geometry_msgs/PoseStamped"}
    assert not list(faults(Rule.model_validate({**rule, "payload": payload})))
