"""A mission's picture: what is taken from the bus, and that it is on the sheet."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pydantic import BaseModel

from services import topics
from services.apartment.robot_places import read
from services.bus import Message
from services.mission.chart import Chart
from services.mission.picture import STEPS, draw
from services.mission.plan_view import FLOOR
from services.mission.timeline import Timeline
from services.payloads import Point, ScanState, stamp
from services.payloads.robot import (
    GotoResult,
    MissionResult,
    MissionState,
    MissionStep,
    RobotGoto,
    RobotPose,
    RobotSeen,
    SeenMarker,
)
from tests.bridge.test_service import CONFIG

BEGAN = 1_000_000.0
END = MissionResult(
    id="m", marker=582, state="found", reason="seen", position=Point(x=3.9, y=4.52, z=0.46), stamp=stamp(BEGAN)
)


def said(row: topics.Topic, payload: BaseModel, at: float, **levels: str) -> Message:
    return row.message(payload, **{"robot": "tiago", **levels})._replace(received=BEGAN + at, retain=False)


def pose(at: float, x: float, y: float) -> Message:
    return said(topics.ROBOT_POSE, RobotPose(x=x, y=y, yaw_deg=90.0, stamp=stamp(BEGAN)), at)


def state(at: float, step: MissionStep) -> Message:
    return said(topics.MISSION_STATE, MissionState(state=step, reason=f"{step}s", since=stamp(BEGAN)), at)


@pytest.fixture
def told() -> Timeline:
    timeline = Timeline("tiago", 582, BEGAN)
    scan = ScanState(state="running", place="Sofa", progress=0.5)
    seen = RobotSeen(markers=[SeenMarker(marker=582)], stamp=stamp(BEGAN))
    for message in (
        pose(0.0, 4.5, 1.2), state(0.1, "look"), said(topics.CAMERA_SCAN_STATE, scan, 1.0, cam="ip1"), state(1.0, "go"),
        said(topics.ROBOT_GOTO_RESULT, GotoResult(id="m-g1", state="accepted"), 1.1), pose(2.0, 4.4, 2.0),
        pose(3.0, 4.2, 3.0), said(topics.ROBOT_GOTO_RESULT, GotoResult(id="m-g1", state="arrived"), 3.1),
        said(topics.ROBOT_POSE, RobotPose(x=0.0, y=0.0, yaw_deg=0.0, stamp=stamp(BEGAN)), 3.2, robot="other"),
        said(topics.ROBOT_SEEN, seen, 3.5), Message("camera/ip1/scan/state", b"rubbish", received=BEGAN + 3.6),
        said(topics.MISSION_RESULT, END, 4.0), pose(9.0, 0.0, 0.0),
    ):  # fmt: skip
        timeline.heard(message)
    return timeline


def test_it_keeps_what_concerns_this_mission_until_its_end(told: Timeline) -> None:
    assert [(one.state, one.at) for one in told.steps] == [("look", pytest.approx(0.1)), ("go", 1.0), ("found", 4.0)]
    assert [(at, x) for at, x, _, _ in told.poses] == [(0.0, 4.5), (2.0, 4.4), (3.0, 4.2)]
    assert told.looks == [(3.5, True)]
    assert told.end == 4.0
    assert (told.state_at(0.5), told.state_at(2.0)) == ("look", "go")


def test_a_goal_that_was_not_heard_is_where_the_robot_arrived(told: Timeline) -> None:
    ((goal),) = told.goals
    assert (goal.pose, goal.end) == ((4.2, 3.0, 90.0), "arrived")
    told.result = None
    told.heard(said(topics.ROBOT_GOTO, RobotGoto(x=1.0, y=2.0, id="m-g2"), 5.0))
    assert told.goals[1].pose == (1.0, 2.0, 0.0)


def test_the_picture_shows_floor_walls_and_the_way_in_the_colours_of_its_steps(told: Timeline) -> None:
    png = draw(told, Chart(*read(CONFIG / "tiago" / "robot_places.yaml")), {"ip1": (3.05, 2.25)})
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    assert pixels.shape[1] == 2800
    map_part = pixels[168:1230, 72:1600, ::-1].reshape(-1, 3)
    for colour in (*FLOOR.values(), STEPS["go"], STEPS["scan"], STEPS["found"]):
        assert (map_part == colour).all(axis=1).sum() > 50, colour


def test_a_robot_without_a_map_and_a_mission_of_many_steps_have_a_picture_too() -> None:
    timeline = Timeline("tiago", 582, BEGAN)
    for number in range(60):
        timeline.heard(state(float(number), "go" if number % 2 else "look"))
    places, _ = read(CONFIG / "tiago" / "robot_places.yaml")
    assert draw(timeline, Chart(places), {}).startswith(b"\x89PNG")
