"""A mission as messages: what the robot and the cameras are told, and what everybody may know of it."""

from __future__ import annotations

from typing import Literal

from services import topics
from services.bus import Message
from services.mission.events import Action, Go, Halt, Scan
from services.mission.memory import point
from services.mission.state import ENDS, Mission, Stand
from services.payloads import Order, stamp
from services.payloads.robot import (
    MissionEvent,
    MissionOrder,
    MissionResult,
    MissionState,
    RobotCancel,
    RobotGoto,
)  # fmt: skip

End = Literal["refused", "cancelled"]


def goal_id(mission: Mission, goal: int) -> str:
    """Under which the robot answers."""
    return f"{mission.id[:40]}-g{goal}"


def scan_id(mission: Mission, camera: str, scan: int) -> str:
    """Under which a camera answers."""
    return f"{mission.id[:24]}-s{scan}-{camera}"[:58]


def goto(robot: str, mission: Mission, goal: int, stand: Stand) -> Message:
    """Sends the robot there."""
    ours = goal_id(mission, goal)
    if stand.point is not None:
        return topics.ROBOT_GOTO.message(RobotGoto(point=stand.point, id=ours), robot=robot)
    x, y, yaw = round(stand.x, 3), round(stand.y, 3), round(stand.yaw_deg, 1)
    return topics.ROBOT_GOTO.message(RobotGoto(x=x, y=y, yaw_deg=yaw, id=ours), robot=robot)


def wanted(robot: str, mission: Mission, action: Action) -> Message:
    """What the plan wants done."""
    if isinstance(action, Go):
        return goto(robot, mission, action.goal, action.stand)
    if isinstance(action, Halt):
        return topics.ROBOT_CANCEL.message(RobotCancel(id=goal_id(mission, action.goal)), robot=robot)
    ours = scan_id(mission, action.camera, action.scan)
    if isinstance(action, Scan):
        order = Order(value={"targets": [mission.marker]}, id=ours, by="mission")
    else:
        order = Order(value="OFF", id=f"{ours}-off", by="mission")
    return topics.CAMERA_ORDER.message(order, cam=action.camera, key="Scan")


def state(mission: Mission | None, waiting: list[MissionOrder], since: str) -> MissionState:
    """What everybody sees; `since` where there is no mission."""
    ids = [one.id or "" for one in waiting]
    if mission is None:
        return MissionState(state="idle", since=since, waiting=ids)
    return MissionState(
        state=mission.step,
        id=mission.id,
        marker=mission.marker,
        place=mission.place,
        reason=mission.reason,
        since=stamp(mission.since),
        elapsed_s=round(mission.since - mission.began, 1),
        waiting=ids,
    )


def ended(robot: str, mission: Mission, now: float) -> Message:
    """How it went."""
    assert mission.step in ENDS
    at = mission.position
    result = MissionResult(
        id=mission.id,
        marker=mission.marker,
        state=mission.step,
        reason=mission.reason,
        place=mission.place,
        position=None if at is None else point((round(at[0], 3), round(at[1], 3), round(at[2], 3))),
        by=robot if mission.step == "found" else None,
        elapsed_s=round(now - mission.began, 1),
        story=[MissionEvent(at_s=one.at_s, state=one.step, text=one.text) for one in mission.story],
        stamp=stamp(now),
    )
    return topics.MISSION_RESULT.message(result, robot=robot)


def refused(robot: str, order_id: str | None, marker: int | None, reason: str, now: float) -> Message:
    """An order that is not taken; id and marker as far as they are known."""
    return _without_a_mission(robot, order_id, marker, "refused", reason, now)


def withdrawn(robot: str, order: MissionOrder, reason: str, now: float) -> Message:
    """An order that was taken back before its turn came, or whose turn did not come."""
    return _without_a_mission(robot, order.id, order.find, "cancelled", reason, now)


def _without_a_mission(
    robot: str, order_id: str | None, marker: int | None, end: End, reason: str, now: float
) -> Message:
    result = MissionResult(id=order_id or "", marker=marker or 0, state=end, reason=reason, stamp=stamp(now))
    return topics.MISSION_RESULT.message(result, robot=robot)
