"""The file of rules: repeated for each camera, checked against each other, every fault with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.bridge import rulebook
from services.errors import ConfigError

SHIPPED = Path(__file__).parents[2] / "config" / "bridge.yaml"
GOOD = "rules:\n- {direction: to_ros, mqtt: 'my/{a}', ros: a, type: std_msgs/String, fields: {data: '{payload}'}}\n"


def faults(folder: Path, text: str, cameras: tuple[str, ...] = ("ip1",)) -> list[str]:
    file = folder / "bridge.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        rulebook.load(file, cameras)
    return [fault.removeprefix(f"{file}:") for fault in caught.value.faults]


def test_the_shipped_rules_have_the_names_that_were_promised() -> None:
    rules = rulebook.load(SHIPPED, ("ip1", "ip2"))
    names = {rule.ros for rule in rules}
    camera = {
        "/ip_camera_order",
        "/ip_camera_position",
        "/ip_camera_motion_alarm",
        "/ip_camera_scan/result/place",
        "/ip_camera_scan/result/position",
        "/ip_camera_scan/result/pose",
        "/ip_camera_scan/image/compressed",
        "/ip_camera_snapshot/compressed",
    }
    assert names == {"/iot_updates", "/iot_command", "/iot_set"} | camera | {f"/ip2{name}" for name in camera}


def test_a_rule_for_each_camera_names_its_camera() -> None:
    rules = rulebook.load(SHIPPED, ("hall", "kitchen"))
    topics = {rule.ros: rule.mqtt for rule in rules}
    assert topics["/ip_camera_order"] == "camera/hall/order/{key}"
    assert topics["/kitchen/ip_camera_order"] == "camera/kitchen/order/{key}"


def test_without_cameras_only_the_home_is_bridged() -> None:
    assert {rule.ros for rule in rulebook.load(SHIPPED, ())} == {"/iot_updates", "/iot_command", "/iot_set"}


def test_all_faults_are_told_with_their_lines(tmp_path: Path) -> None:
    text = GOOD + (
        "- {direction: sideways, mqtt: a, ros: b, type: std_msgs/String}\n"
        "- {direction: to_mqtt, mqtt: a, ros: b-c, type: String, payload: x}\n"
        "- {direction: to_mqtt, mqtt: a, ros: c, payload: x}\n"
        "- {direction: to_mqtt, mqtt: a, ros: c, type: std_msgs/String, payload: x, colour: red}\n"
    )
    told = faults(tmp_path, text)
    assert [fault.split(": ")[:2] for fault in told] == [
        ["3", "rules[1].direction"],
        ["4", "rules[2].ros"],
        ["4", "rules[2].type"],
        ["5", "rules[3].type"],
        ["6", "rules[4].colour"],
    ]
    assert all("expected" in fault and "got" in fault for fault in told)


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        (
            "{direction: to_ros, mqtt: 'my/{b}', ros: /a, type: std_msgs/Bool, fields: {data: '{payload}'}}",
            "expected type",
        ),
        ("{direction: to_mqtt, mqtt: my/b, ros: a, type: std_msgs/String, payload: '{data}'}", "expected direction"),
        ("{direction: to_ros, mqtt: my/b, ros: a, type: std_msgs/String, latch: true}", "expected latch"),
        ("{direction: to_ros, mqtt: my/b, ros: a, type: std_msgs/String, replay: true}", "expected replay"),
        ("{direction: to_ros, mqtt: 'my/{a}', ros: a, type: std_msgs/String}", "once"),
        ("{direction: to_ros, mqtt: my/b, ros: diagnostics, type: std_msgs/String}", "another topic"),
    ],
)
def test_rules_that_cannot_be_together_are_told(tmp_path: Path, entry: str, told: str) -> None:
    (fault,) = faults(tmp_path, f"{GOOD}- {entry}\n")
    assert fault.startswith("3: rules[1]: ")
    assert told in fault


def test_a_camera_that_takes_another_topics_name_is_told(tmp_path: Path) -> None:
    text = GOOD.replace("ros: a", "ros: ip2/a") + (
        "- {direction: to_ros, each: camera, mqtt: 'camera/{cam}/position', ros: a, type: geometry_msgs/Point}\n"
    )
    wrong_type, _ = faults(tmp_path, text, ("ip1", "ip2"))
    assert "expected type" in wrong_type


@pytest.mark.parametrize("text", ["", "rules: 3", "rule: []", "rules: []\nmore: 1", "rules: [", "rules: [3]"])
def test_another_file_is_told(tmp_path: Path, text: str) -> None:
    assert len(faults(tmp_path, text)) == 1


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.yaml:1: file: expected a readable file"):
        rulebook.load(tmp_path / "nowhere.yaml", ())
