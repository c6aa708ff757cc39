"""What the bridge does besides its rules: frames, joints, snapshots, answers of the home, items by room."""

from __future__ import annotations

import json
from collections.abc import Iterator
from math import inf, nan, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from services.bridge import Config, start
from services.bridge.confirm import ANSWER_S
from services.bridge.snapshots import ANSWER_S as PICTURE_S
from services.bus import Message
from services.errors import BadMessage
from services.vision.frames import Mount, Transform, camera_in_apartment
from tests.bridge.test_service import CONFIG, HOME, NOW, RESULT, Driven

MOUNT = {"position": [3.05, 2.25, 2.6], "yaw_deg": 35.0, "lean_deg": [1, -2], "pan_to_tilt_m": [0.006, 0.078],
         "tilt_to_lens_m": [0.024, 0.004], "sensor_roll_deg": 3}  # fmt: skip
ROOMS = {**HOME, "rooms": {"hall": {"label": "Hall"}}, "things": {"lamp": {"label": "Lamp", "room": "hall"}}}
ROOMS["items"] = {**HOME["items"], "Lamp": {"type": "Switch", "label": "Lamp", "thing": "lamp"}}
JPEG = b"\xff\xd8 a picture \xff\xd9"


@pytest.fixture
def bridge(tmp_path: Path) -> Iterator[Driven]:
    places = tmp_path / "robot_places.yaml"
    places.write_text("apartment_to_map: {x: 1.0, y: 2.0, yaw_deg: 90.0}\n", encoding="utf-8")
    config = {"home": ROOMS, "cameras": ("ip1", "ip2"), "folder": CONFIG, "state": tmp_path, "simulated": True,
              "camera_sections": {"ip1": {"mount": MOUNT, "brand": "amcrest"}, "ip2": {"mount": 3}},
              "places": places, "robot": "tiago"}  # fmt: skip
    posted: list[Any] = []
    with start(Config.model_validate(config), posted.append) as service:
        driven = Driven(service, posted)
        for message in driven.take():
            assert not list(service.handle(message, NOW))
        yield driven


def said(bridge: Driven, topic: str, now: float = NOW) -> list[Any]:
    """What a tick says on a ROS topic."""
    bridge.node.published.clear()
    list(bridge.service.tick(now))
    return [fields for name, fields in bridge.node.published if name == topic]


def transform(fields: Any) -> Transform:
    """A TF transform as ours."""
    x, y, z, w = (fields["transform"]["rotation"][name] for name in "xyzw")
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    return Transform(rotation, np.array([fields["transform"]["translation"][name] for name in "xyz"]))


def by_child(messages: list[Any]) -> dict[str, Any]:
    return {one["child_frame_id"]: one for message in messages for one in message["transforms"]}


def test_the_tree_leads_from_the_map_to_the_picture(bridge: Driven) -> None:
    bridge.hears("camera/ip1/position", {"pan": 41.0, "tilt": 34.5, "zoom": 0.0})
    fixed = by_child(said(bridge, "/tf_static"))
    moving = by_child([fields for topic, fields in bridge.node.published if topic == "/tf"])
    assert {child: one["header"]["frame_id"] for child, one in (fixed | moving).items()} == {
        "apartment": "map", "ip1_base": "apartment", "ip1": "ip1_base", "ip1_optical_frame": "ip1",
    }  # fmt: skip
    chain = transform(fixed["ip1_base"]) @ transform(moving["ip1"]) @ transform(fixed["ip1_optical_frame"])
    truth = camera_in_apartment(Mount(**MOUNT), 41.0, 34.5)  # type: ignore[arg-type]
    assert np.allclose(chain.rotation, truth.rotation)
    assert np.allclose(chain.translation, truth.translation)
    assert np.allclose(transform(fixed["apartment"]).apply(np.array([1.0, 0, 0])), [1.0, 3.0, 0.0])


def test_the_camera_moves_on_with_fresh_stamps_until_it_is_away(bridge: Driven) -> None:
    bridge.hears("camera/ip1/position", {"pan": 90.0, "tilt": 0.0, "zoom": 0.0})
    for step in range(3):
        (message,) = said(bridge, "/tf", NOW + step / 5)
        assert message["transforms"][0]["header"]["stamp"] == NOW + step / 5
    (joints,) = said(bridge, "/joint_states", NOW + 1)
    assert (joints["name"], joints["position"]) == (["ip1_pan", "ip1_tilt"], [pi / 2, 0.0])
    bridge.hears("camera/ip1/status", {"state": "offline", "reason": "cable"})
    assert said(bridge, "/tf", NOW + 2) == said(bridge, "/joint_states", NOW + 3) == []


def test_a_camera_that_hangs_nobody_knows_where_still_has_joints(bridge: Driven) -> None:
    bridge.hears("camera/ip2/position", {"pan": 0.0, "tilt": 90.0, "zoom": 0.0})
    (joints,) = said(bridge, "/ip2/joint_states")
    assert joints["position"] == [0.0, pi / 2]


def test_markers_hang_on_the_apartment_and_stay_where_they_were_seen(bridge: Driven) -> None:
    bridge.hears("camera/ip1/marker/582", RESULT)
    marker = by_child(said(bridge, "/tf_static"))["aruco_582"]
    assert marker["header"]["frame_id"] == "apartment"
    assert marker["transform"]["translation"] == RESULT["position"]
    older = {**RESULT, "camera": "ip2", "stamp": "2026-01-30T07:05:00.123Z", "position": {"x": 9.0, "y": 9.0, "z": 9.0}}
    bridge.hears("camera/ip2/marker/582", older)
    assert said(bridge, "/tf_static", NOW + 1) == []
    late: list[Any] = []
    bridge.node.subscribe("/tf_static", late.append)
    assert by_child(late)["aruco_582"] == marker


@pytest.mark.parametrize("change", [{"position": None, "why": "too far"}, {"orientation": None}])
def test_a_marker_of_which_too_little_is_known_has_no_frame(bridge: Driven, change: Any) -> None:
    bridge.hears("camera/ip1/marker/582", {**RESULT, **change})
    assert "aruco_582" not in by_child(said(bridge, "/tf_static"))


def test_of_two_orientations_the_likelier_one_is_shown(bridge: Driven) -> None:
    two = [{"x": 1.0, "y": 0.0, "z": 0.0, "w": 0.0, "weight": 0.4}, {"x": 0, "y": 1.0, "z": 0, "w": 0.0, "weight": 0.6}]
    bridge.hears("camera/ip1/marker/582", {**RESULT, "orientation": None, "orientations": two})
    rotation = by_child(said(bridge, "/tf_static"))["aruco_582"]["transform"]["rotation"]
    assert rotation == {"x": 0.0, "y": 1.0, "z": 0.0, "w": 0.0}


def call(bridge: Driven, name: str, now: float = NOW) -> tuple[list[Any], list[str]]:
    """Calls a service: its answers as they come, and where the bridge asks the bus."""
    answers: list[Any] = []
    bridge.node.call(name, {}, answers.append)
    return answers, [out.topic for message in bridge.take() for out in bridge.service.handle(message, now)]


def test_a_snapshot_is_answered_with_its_file_and_shown(bridge: Driven) -> None:
    answers, asked = call(bridge, "/ip2/snapshots_ip_camera")
    assert (answers, asked) == ([], ["camera/ip2/snapshot/get"])
    shown = bridge.hears_bytes("camera/ip2/snapshot", JPEG)
    assert Path(answers[0]["message"]).read_bytes() == JPEG
    assert answers[0]["success"]
    assert shown[0][0] == "/ip2/ip_camera_snapshot/compressed"
    assert (shown[0][1]["format"], shown[0][1]["data"]) == ("jpeg", JPEG)
    assert shown[0][1]["header"]["frame_id"] == "ip2_optical_frame"
    bridge.hears_bytes("camera/ip2/snapshot", JPEG)
    assert len(answers) == 1


def test_a_snapshot_that_does_not_come_is_told(bridge: Driven) -> None:
    answers, _ = call(bridge, "/snapshots_ip_camera")
    list(bridge.service.tick(NOW + PICTURE_S - 1))
    assert answers == []
    list(bridge.service.tick(NOW + PICTURE_S))
    assert answers == [{"success": False, "message": "ip1 gave no picture within 25 s"}]


def test_a_camera_that_is_away_is_not_asked(bridge: Driven) -> None:
    bridge.hears("camera/ip1/status", {"state": "locked", "reason": "a wrong password"})
    assert call(bridge, "/snapshots_ip_camera") == (
        [{"success": False, "message": "ip1 is locked: a wrong password"}], [],
    )  # fmt: skip


INFO = {"width": 640, "height": 360, "distortion_model": "plumb_bob", "D": [0.1, 0, 0, 0, 0], "K": [1.0] * 9,
        "R": [0.0] * 9, "P": [0.0] * 12, "binning_x": 0, "header": {}}  # fmt: skip


@pytest.mark.parametrize(
    ("state", "answer"),
    [
        ("done", {"success": True, "status_message": "the camera has it"}),
        ("refused", {"success": False, "status_message": "refused: too wide"}),
    ],
)
def test_a_calibration_is_handed_to_the_camera_and_its_word_to_the_calibrator(
    bridge: Driven, state: str, answer: Any
) -> None:
    answers: list[Any] = []
    bridge.node.call("/ip_camera_rtsp/set_camera_info", {"camera_info": INFO}, answers.append)
    ((order),) = [out for message in bridge.take() for out in bridge.service.handle(message, NOW)]
    said = json.loads(order.payload)
    assert order.topic == "camera/ip1/order/SetCameraInfo"
    assert said["value"] == {key: INFO[key] for key in ("width", "height", "distortion_model", "D", "K", "R", "P")}
    for step, error in (("accepted", None), ("running", None), (state, "too wide")):
        result = {"id": said["id"], "key": "SetCameraInfo", "value": {}, "state": step, "error": error}
        bridge.hears("camera/ip1/order_result", result)
    assert answers == [answer]


@pytest.mark.parametrize("change", [{"K": [nan] * 9}, {"D": [0.1, inf, 0, 0, 0]}])
def test_a_calibration_without_numbers_is_refused_at_once(bridge: Driven, change: Any) -> None:
    answers: list[Any] = []
    bridge.node.call("/set_camera_info", {"camera_info": {**INFO, **change}}, answers.append)
    with pytest.raises(BadMessage, match="set_camera_info: expected finite numbers"):
        list(bridge.service.handle(bridge.take()[0], NOW))
    assert answers == [{"success": False, "status_message": "expected finite numbers in camera_info"}]


def test_a_calibration_that_nobody_takes_is_told(bridge: Driven) -> None:
    answers: list[Any] = []
    bridge.node.call("/ip2/set_camera_info", {"camera_info": INFO}, answers.append)
    assert [out.topic for m in bridge.take() for out in bridge.service.handle(m, NOW)] == [
        "camera/ip2/order/SetCameraInfo"
    ]
    list(bridge.service.tick(NOW + 20))
    assert answers == [{"success": False, "status_message": "the camera's service does not answer"}]


def test_a_mission_is_ordered_followed_and_cancelled(bridge: Driven) -> None:
    ((topic, order),) = bridge.robot_says("/iot_mission", "find", "582")
    assert (topic, json.loads(order)["find"]) == ("mission/tiago/order", 582)
    going = {
        "state": "go",
        "marker": 582,
        "place": "Kitchen",
        "reason": "last seen there",
        "since": "2026-01-31T07:05:00Z",
    }
    bridge.hears("mission/tiago/state", going)
    bridge.hears("mission/other/state", {**going, "state": "failed"})
    assert said(bridge, "/iot_mission/state") == [{"key": "go", "value": "Kitchen, last seen there"}]
    answers, asked = call(bridge, "/iot_mission/cancel")
    assert (answers[0]["success"], asked) == (True, ["mission/tiago/order"])


@pytest.mark.parametrize(
    ("key", "value"),
    [("find", "a marker"), ("find", "-1"), ("find", "10000"), ("find", "²"), ("find", "9" * 5000), ("eat", "582")],
)
def test_another_word_to_the_mission_is_refused(bridge: Driven, key: str, value: str) -> None:
    with pytest.raises(BadMessage, match="expected key find"):
        bridge.robot_says("/iot_mission", key, value)


def test_a_mission_that_was_latched_before_the_bridge_was_there_is_refused(bridge: Driven) -> None:
    word = Message("/ros/iot_mission", value={"key": "find", "value": "582"}, retain=True)
    with pytest.raises(BadMessage, match="latched before the bridge was there"):
        list(bridge.service.handle(word, NOW))


def status(bridge: Driven, name: str, now: float) -> tuple[int, str]:
    """Level and text of one status of `/diagnostics`."""
    (array,) = said(bridge, "/diagnostics", now)
    return next((one["level"], one["message"]) for one in array["status"] if one["name"] == name)


def test_a_command_that_no_state_follows_is_reported(bridge: Driven) -> None:
    bridge.robot_says("/iot_command", "Lamp", "ON")
    assert status(bridge, "iot: commands", NOW + 1) == (0, "every command was answered")
    assert status(bridge, "iot: commands", NOW + ANSWER_S) == (1, "no state followed: Lamp ON")
    bridge.robot_says("/iot_command", "Lamp", "ON", NOW + 10)
    bridge.hears("home/Lamp/state", "ON", NOW + 11)
    assert status(bridge, "iot: commands", NOW + 20) == (0, "every command was answered")


def test_what_is_so_already_need_not_be_said_again(bridge: Driven) -> None:
    bridge.hears("home/Lamp/state", "ON")
    bridge.robot_says("/iot_command", "Lamp", "ON")
    assert status(bridge, "iot: commands", NOW + 2 * ANSWER_S) == (0, "every command was answered")


def test_items_are_shown_by_room_and_by_what_they_say(bridge: Driven) -> None:
    bridge.hears("home/Lamp/state", "ON")
    bridge.hears("home/Temp/state", "UNDEF")
    assert status(bridge, "home hall: Lamp", NOW) == (0, "ON")
    assert status(bridge, "home outside: Temp", NOW + 1) == (1, "it has no value: UNDEF")
    assert status(bridge, "home outside: Door", NOW + 2) == (3, "no state was ever said")


def test_the_health_of_another_service_is_heard_as_json(bridge: Driven) -> None:
    bridge.hears("diagnostics/camera/ip1", json.dumps({"level": 2, "message": "no power"}))
    assert status(bridge, "camera: ip1", NOW) == (2, "no power")
