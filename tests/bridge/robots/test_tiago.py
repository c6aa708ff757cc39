"""The robot's part of the bridge with a node in memory: orders of the bus, words of actionlib, and their end."""

from __future__ import annotations

import json
import re
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from services.apartment.robot_places import PointPose, RobotPlaces
from services.bridge import Config
from services.bridge.program import check
from services.bridge.robots import kinds
from services.bridge.robots.commander import GONE_S
from services.bridge.robots.goals import AGAIN_S, FORGOTTEN_S, SILENT_S, TAKEN_S
from services.bridge.robots.kept import Kept
from services.bridge.robots.tiago import DICTIONARY, Settings, Tiago
from services.bridge.rules import read
from services.bridge.service import Bridge
from services.bridge.simulated import SimulatedNode
from services.bus import LOST_TOPIC, Message
from services.errors import ConfigError
from services.vision.codes import DICTIONARIES
from tests.bridge.test_service import CONFIG, HOME, NOW

PENDING, ACTIVE, PREEMPTED, SUCCEEDED, ABORTED, REJECTED = range(6)
PLACES = RobotPlaces(points={"Kitchen": PointPose(x=1.0, y=2.0, yaw_deg=90.0)})
OURS = "apartment/tiago/"


class Robot:
    """The part, its node, and what both said."""

    def __init__(self, kept: Path | None = None, **settings: Any) -> None:
        self.part = Tiago("tiago", Settings(**settings), PLACES, None, Kept(kept))
        self.node = SimulatedNode(self.part.ports, lambda _: None)
        self.now = NOW
        self.sent: list[tuple[str, Any]] = []
        for outlet in self.part.ports.outlets:
            self.node.subscribe(outlet.topic, lambda fields, topic=outlet.topic: self.sent.append((topic, fields)))

    def says(self, topic: str, **payload: Any) -> list[tuple[str, str]]:
        """The bus says it; what the bus is told then."""
        message = Message(f"robot/tiago/{topic}", json.dumps(payload).encode(), received=self.now)
        self.part.hear(read(message, self.now), self.now)
        return self.tick()

    def tick(self, seconds: float = 0.0) -> list[tuple[str, str]]:
        self.now += seconds
        return _told(self.part.tick(self.node, self.now))

    def status(self, *goals: tuple[str, int], text: str = "", server: str = "/move_base") -> list[tuple[str, str]]:
        """A server's status array."""
        listed = [{"goal_id": {"id": name}, "status": status, "text": text} for name, status in goals]
        told = _told(self.part.heard_ros(f"{server}/status", {"status_list": listed}, self.now))
        return told + self.tick()

    def result(self, name: str, status: int, text: str = "") -> list[tuple[str, str]]:
        said = {"status": {"goal_id": {"id": name}, "status": status, "text": text}}
        return _told(self.part.heard_ros("/move_base/result", said, self.now))

    def cancels(self) -> list[tuple[str, str]]:
        return [(topic, fields.get("id", "")) for topic, fields in self.sent if topic.endswith("/cancel")]


def _told(messages: Any) -> list[tuple[str, str]]:
    """States and reasons."""
    payloads = [json.loads(one.payload) for one in messages]
    assert all(one.topic == "robot/tiago/goto/result" for one in messages)
    return [(f"{one['id']} {one['state']}", one["reason"]) for one in payloads]


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_a_pose_is_a_goal_without_a_stamp_and_its_end_an_answer(robot: Robot) -> None:
    assert robot.says("goto", x=1.5, y=-0.5, yaw_deg=90.0, id="m-g1") == []
    ((topic, goal),) = robot.sent
    assert topic == "/move_base/goal"
    assert goal["goal_id"] == {"id": f"{OURS}m-g1"}
    target = goal["goal"]["target_pose"]
    assert target["header"] == {"frame_id": "map"}
    assert target["pose"]["position"] == {"x": 1.5, "y": -0.5, "z": 0.0}
    assert target["pose"]["orientation"] == {"x": 0.0, "y": 0.0, "z": sin(radians(45)), "w": cos(radians(45))}
    assert robot.status((f"{OURS}m-g1", PENDING)) == [("m-g1 accepted", "")]
    assert robot.status((f"{OURS}m-g1", ACTIVE)) == []
    assert robot.result(f"{OURS}m-g1", SUCCEEDED, "Goal reached.") == [("m-g1 arrived", "Goal reached.")]
    assert robot.part.goals.under_way is None


def test_a_named_point_is_its_pose_where_no_server_knows_points(robot: Robot) -> None:
    robot.says("goto", point="kitchen", id="p")
    assert robot.sent[0][1]["goal"]["target_pose"]["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 0.0}
    assert robot.says("goto", point="Attic", id="q") == [("q failed", "no point 'Attic'")]
    assert robot.part.goals.under_way == ("/move_base/cancel", f"{OURS}p")


def test_a_named_point_goes_to_the_server_of_points_where_there_is_one() -> None:
    robot = Robot(poi="/poi_navigation_server/go_to_poi")
    robot.says("goto", point="Living room", id="p")
    assert robot.sent == [
        ("/poi_navigation_server/go_to_poi/goal",
         {"goal_id": {"id": f"{OURS}p"}, "goal": {"poi": {"data": "Living room"}}}),
    ]  # fmt: skip
    robot.status((f"{OURS}p", ACTIVE), server="/poi_navigation_server/go_to_poi")
    assert robot.says("goto", x=0.0, y=0.0, id="q") == [("p cancelled", "another goal came")]
    assert robot.cancels() == [("/poi_navigation_server/go_to_poi/cancel", f"{OURS}p")]


@pytest.mark.parametrize(
    ("status", "state", "reason"),
    [
        (SUCCEEDED, "arrived", "why"),
        (ABORTED, "failed", "why"),
        (REJECTED, "failed", "why"),
        (PREEMPTED, "cancelled", "why"),
    ],
)
def test_a_result_that_was_lost_is_read_in_the_status(robot: Robot, status: int, state: str, reason: str) -> None:
    robot.says("goto", x=0.0, y=0.0, id="g")
    assert robot.status((f"{OURS}g", status), text="why") == [("g accepted", ""), (f"g {state}", reason)]


def test_a_goal_that_the_server_has_not_named_is_sent_again_and_then_given_up(robot: Robot) -> None:
    robot.says("goto", x=0.0, y=0.0, id="g")
    robot.tick(AGAIN_S)
    assert [fields["goal_id"]["id"] for _, fields in robot.sent] == [f"{OURS}g"] * 2
    assert robot.tick(TAKEN_S) == [("g failed", "/move_base does not take the goal")]
    assert robot.cancels() == [("/move_base/cancel", f"{OURS}g")]


def test_a_robot_without_navigation_is_told_as_such() -> None:
    robot = Robot()
    robot.node.close()
    robot.says("goto", x=0.0, y=0.0, id="g")
    assert robot.tick(TAKEN_S) == [("g failed", "/move_base is not there, or of another definition")]


def test_a_goal_that_comes_twice_is_one_and_its_end_is_told_again(robot: Robot) -> None:
    robot.says("goto", x=0.0, y=0.0, id="g")
    assert robot.says("goto", x=0.0, y=0.0, id="g") == []
    robot.status((f"{OURS}g", ACTIVE))
    assert robot.says("goto", x=0.0, y=0.0, id="g") == [("g accepted", "")]
    robot.result(f"{OURS}g", SUCCEEDED)
    assert robot.says("goto", x=0.0, y=0.0, id="g") == [("g arrived", "")]
    assert len([topic for topic, _ in robot.sent if topic.endswith("/goal")]) == 1


def test_a_new_goal_ends_the_old_one_whose_later_words_are_nobodys(robot: Robot) -> None:
    robot.says("goto", x=0.0, y=0.0, id="old")
    robot.status((f"{OURS}old", ACTIVE))
    assert robot.says("goto", x=1.0, y=0.0, id="new") == [("old cancelled", "another goal came")]
    assert robot.status((f"{OURS}old", PREEMPTED), (f"{OURS}new", ACTIVE)) == [("new accepted", "")]
    assert robot.result(f"{OURS}old", PREEMPTED) == []
    assert robot.part.goals.under_way == ("/move_base/cancel", f"{OURS}new")


def test_a_cancel_ends_the_goal_at_once_and_is_said_until_the_server_obeys(robot: Robot) -> None:
    robot.says("goto", x=0.0, y=0.0, id="g")
    robot.status((f"{OURS}g", ACTIVE))
    assert robot.says("cancel", id="another") == []
    assert robot.says("cancel", id="g") == [("g cancelled", "")]
    assert robot.cancels() == [("/move_base/cancel", f"{OURS}g")]
    robot.status((f"{OURS}g", ACTIVE))
    robot.status((f"{OURS}g", ACTIVE))
    assert len(robot.cancels()) == 2
    robot.tick(AGAIN_S)
    robot.status((f"{OURS}g", ACTIVE))
    assert len(robot.cancels()) == 3
    assert robot.status((f"{OURS}g", PREEMPTED)) == []


def test_a_cancel_without_an_id_stops_whatever_moves_the_robot(robot: Robot) -> None:
    assert robot.says("cancel") == []
    assert robot.cancels() == [("/move_base/cancel", "")]


def test_a_server_that_falls_silent_ends_the_goal(robot: Robot) -> None:
    robot.says("goto", x=0.0, y=0.0, id="g")
    robot.status((f"{OURS}g", ACTIVE))
    assert robot.tick(SILENT_S) == []
    assert robot.tick(0.1) == [("g failed", "/move_base has been silent for 5 s")]
    assert robot.cancels() == [("/move_base/cancel", f"{OURS}g")]


def test_a_server_that_was_started_anew_has_forgotten_the_goal(robot: Robot) -> None:
    robot.says("goto", x=0.0, y=0.0, id="g")
    robot.status((f"{OURS}g", ACTIVE))
    robot.tick(FORGOTTEN_S)
    assert robot.status(("somebody's", ACTIVE)) == []
    robot.tick(0.2)
    assert robot.status() == [("g failed", "/move_base has forgotten the goal")]


def test_a_goal_of_a_bridge_before_us_is_cancelled_and_told_of(robot: Robot) -> None:
    told = robot.status((f"{OURS}m-g3", ACTIVE), ("rviz-1", ACTIVE), (f"{OURS}~1", SUCCEEDED))
    assert told == [("m-g3 cancelled", "nobody was there to follow it")]
    assert robot.cancels() == [("/move_base/cancel", f"{OURS}m-g3")]
    assert robot.status((f"{OURS}m-g3", PREEMPTED)) == []


def test_the_goal_that_ended_with_the_bridge_is_told_of_by_the_next_one(tmp_path: Path) -> None:
    file = tmp_path / "robots" / "tiago"
    Robot(file).says("goto", x=0.0, y=0.0, id="m-g3")
    after = Robot(file)
    assert after.tick() == [("m-g3 cancelled", "the bridge was started anew")]
    assert after.status((f"{OURS}m-g3", PREEMPTED)) == []
    assert Robot(file).tick() == []


def test_a_file_that_cannot_be_read_or_written_stops_nobody(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.says("goto", x=0.0, y=0.0, id="g")
    assert robot.part.goals.under_way is not None
    (tmp_path / "rubbish").write_bytes(b"\xff\xfe")
    assert Robot(tmp_path / "rubbish").tick() == []


def test_the_goal_of_a_lost_bus_is_cancelled(robot: Robot) -> None:
    robot.says("goto", x=0.0, y=0.0, id="g")
    robot.status((f"{OURS}g", ACTIVE))
    robot.part.lost(robot.now)
    ((state, reason),) = robot.tick()
    assert state == "g cancelled"
    assert "the bus was lost" in reason
    assert robot.cancels() == [("/move_base/cancel", f"{OURS}g")]


@pytest.mark.parametrize(
    ("goal", "back", "ends"), [("m-g3", False, True), ("m-g3", True, False), ("by-hand", False, False)]
)
def test_the_goal_of_a_mission_service_that_stays_away_is_cancelled(
    robot: Robot, goal: str, back: bool, ends: bool
) -> None:
    state = {"state": "go", "id": "m", "since": "2026-01-31T07:05:00Z"}
    hears(robot, "mission/tiago/state", json.dumps(state))
    robot.says("goto", x=0.0, y=0.0, id=goal)
    robot.status((f"{OURS}{goal}", ACTIVE))
    hears(robot, "service/mission/status", "offline")
    for _ in range(round(GONE_S)):
        robot.tick(1.0)
        robot.status((f"{OURS}{goal}", ACTIVE))
        if back:
            hears(robot, "service/mission/status", "online")
    robot.tick(0.1)
    assert (robot.part.goals.under_way is None) is ends
    assert set(robot.cancels()) == ({("/move_base/cancel", f"{OURS}{goal}")} if ends else set())


def hears(robot: Robot, topic: str, payload: str) -> None:
    robot.part.hear(read(Message(topic, payload.encode(), received=robot.now), robot.now), robot.now)


def test_another_robots_orders_are_not_ours(robot: Robot) -> None:
    message = Message("robot/other/goto", b'{"x": 0, "y": 0}', received=NOW)
    robot.part.hear(read(message, NOW), NOW)
    assert robot.tick() == robot.sent == []


def config(robots: Any) -> Config:
    return Config.model_validate({"home": HOME, "cameras": ("ip1",), "folder": CONFIG, "robots": robots})


@pytest.mark.parametrize(
    ("robots", "place", "text"),
    [
        ({"tiago": {"kind": "pepper"}}, ("robots", "tiago"), "expected a kind of tiago, got 'pepper'"),
        ({"tiago": {"kind": "tiago", "move": 1}}, ("robots", "tiago", "move"), "Extra inputs are not permitted"),
        ({"tiago": {"kind": "tiago", "poi": "a b"}}, ("robots", "tiago", "poi"), "String should match pattern"),
        ({"tiago": 3}, ("robots", "tiago"), "expected settings, got 3"),
        (
            {"tiago": {"kind": "tiago", "image": "/a", "fiducials": "/b"}},
            ("robots", "tiago"),
            "expected either image or fiducials, got both",
        ),
    ],
)
def test_faults_in_a_robots_section_are_told_where_they_stand(robots: Any, place: Any, text: str) -> None:
    with pytest.raises(ValidationError) as raised:
        config(robots)
    (fault,) = raised.value.errors()
    assert fault["loc"] == place
    assert text in fault["msg"]


def test_the_dictionaries_are_opencvs() -> None:
    assert [name for name in DICTIONARIES if not re.fullmatch(DICTIONARY, name)] == []
    with pytest.raises(ValidationError):
        Settings(dictionary="DICT_5X5_999")


def test_the_file_of_its_points_is_read_at_the_check() -> None:
    assert kinds() == ["tiago"]
    with pytest.raises(ConfigError, match=r"nowhere\.yaml"):
        check(config({"tiago": {"kind": "tiago", "places": "nowhere.yaml"}}))
    check(config({"tiago": {"kind": "tiago", "places": "tiago/robot_places.yaml"}}))


def test_the_bridge_hears_of_the_lost_bus_for_its_robots(robot: Robot) -> None:
    service = Bridge(config({}).home, (), robot.node, (robot.part,))
    assert LOST_TOPIC in service.subscribes
    robot.says("goto", x=0.0, y=0.0, id="g")
    assert list(service.handle(Message(LOST_TOPIC), NOW)) == []
    assert robot.part.goals.under_way is None


def test_the_goal_that_is_kept_is_whole_at_every_moment(tmp_path: Path) -> None:
    """Whoever has begun to read it reads on in the old one: it is replaced, and not written over."""
    file = tmp_path / "robots" / "tiago"
    kept = Kept(file)
    kept.write("the first")
    with file.open() as reader:
        kept.write("another")
        assert reader.read() == "the first"
    assert Kept(file).read() == "another"
    kept.write(None)
    assert Kept(file).read() is None
