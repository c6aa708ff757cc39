"""Topics of missions and of the robots that they send."""

from __future__ import annotations

from services.payloads import robot as r
from services.topic import Kind, Topic
from services.topics.roles import SHOWN

SENDS = ("bridge", "dashboard", "operator")
ROBOTS = ("bridge", "robot")  # the ROS bridge speaks for its robot; a robot on the bus for itself

MISSION_ORDER = Topic(
    "mission/<robot>/order",
    Kind.COMMAND,
    r.MissionOrder,
    (*SENDS, "openhab"),
    ("mission",),
    "find a marker, or cancel",
)
MISSION_STATE = Topic(
    "mission/<robot>/state",
    Kind.STATE,
    r.MissionState,
    ("mission",),
    (*SHOWN, "openhab"),
    "what the mission does now, and why",
    stored=True,
)
MISSION_RESULT = Topic(
    "mission/<robot>/result",
    Kind.EVENT,
    r.MissionResult,
    ("mission",),
    (*SHOWN, "openhab"),
    "how a mission ended, and its story",
    stored=True,
)
MISSION_WHERE = Topic(
    "mission/<robot>/where", Kind.COMMAND, r.Where, (*SENDS, "openhab"), ("mission",), "where was a marker last?"
)
MISSION_WHERE_REPLY = Topic(
    "mission/<robot>/where/reply/<id>", Kind.EVENT, r.WhereReply, ("mission",), (*SHOWN, "openhab"), "the answer"
)
ROBOT_GOTO = Topic(
    "robot/<robot>/goto",
    Kind.COMMAND,
    r.RobotGoto,
    ("mission", "dashboard", "operator"),
    ROBOTS,
    "to a pose in the map frame or to a point of the map",
)
ROBOT_CANCEL = Topic(
    "robot/<robot>/cancel", Kind.COMMAND, r.RobotCancel, ("mission", "dashboard", "operator"), ROBOTS, "stop"
)
ROBOT_GOTO_RESULT = Topic("robot/<robot>/goto/result", Kind.EVENT, r.GotoResult, ROBOTS, SHOWN, "what became of a goal")
ROBOT_POSE = Topic("robot/<robot>/pose", Kind.STATE, r.RobotPose, ROBOTS, SHOWN, "where it stands")
ROBOT_SEEN = Topic("robot/<robot>/seen", Kind.EVENT, r.RobotSeen, ROBOTS, SHOWN, "markers that its own camera sees")
