"""What navigation is asked for: actions of actionlib, their goals' fields and definitions, and what a status means.

The definitions stand here so that no package of the robot's has to be installed; ROS compares their fingerprints (md5)
when it connects, so a robot with another definition is noticed and told. Pure.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin

from services.bridge.rules import Fields

ONGOING = {0: "pending", 1: "active", 6: "preempting", 7: "recalling"}  # actionlib_msgs/GoalStatus
ENDED = {2: "preempted", 3: "succeeded", 4: "aborted", 5: "rejected", 8: "recalled", 9: "lost"}
RULE = "\n" + "=" * 80 + "\nMSG: "
HEADER = "std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
GOAL_ID = "actionlib_msgs/GoalID\ntime stamp\nstring id\n"
POSE = (
    "geometry_msgs/PoseStamped\nHeader header\nPose pose\n",
    "geometry_msgs/Pose\nPoint position\nQuaternion orientation\n",
    "geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
)


@dataclass(frozen=True)
class Action:
    """One action server: the name before /goal, /cancel, /status and /result, and its goal's type."""

    name: str
    type: str
    definition: str

    @property
    def goal(self) -> str:
        """Topic of new goals."""
        return f"{self.name}/goal"

    @property
    def cancel(self) -> str:
        """Topic that ends goals."""
        return f"{self.name}/cancel"

    @property
    def status(self) -> str:
        """Topic of what all goals do, five times a second."""
        return f"{self.name}/status"

    @property
    def result(self) -> str:
        """Topic that says how a goal ended."""
        return f"{self.name}/result"


def move_base(name: str) -> Action:
    """`move_base_msgs/MoveBaseAction`: to a pose."""
    goal = "move_base_msgs/MoveBaseGoal\ngeometry_msgs/PoseStamped target_pose\n"
    return Action(name, "move_base_msgs/MoveBaseActionGoal", _definition("MoveBaseGoal goal", goal, *POSE))


def go_to_poi(name: str) -> Action:
    """`pal_navigation_msgs/GoToPOIAction`: to a point that PAL's map names."""
    goal = "pal_navigation_msgs/GoToPOIGoal\nstd_msgs/String poi\n"
    text = _definition("GoToPOIGoal goal", goal, "std_msgs/String\nstring data\n")
    return Action(name, "pal_navigation_msgs/GoToPOIActionGoal", text)


def _definition(last: str, *more: str) -> str:
    return RULE.join((f"Header header\nactionlib_msgs/GoalID goal_id\n{last}\n", HEADER, GOAL_ID, *more))


def to_pose(frame: str, x: float, y: float, yaw_deg: float) -> Fields:
    """The goal of a MoveBaseGoal. No stamp: where the frame is now."""
    half = radians(yaw_deg) / 2
    turned = {"x": 0.0, "y": 0.0, "z": sin(half), "w": cos(half)}
    pose = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turned}
    return {"target_pose": {"header": {"frame_id": frame}, "pose": pose}}


def to_point(name: str) -> Fields:
    """The goal of a GoToPOIGoal."""
    return {"poi": {"data": name}}
