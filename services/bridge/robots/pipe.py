"""What the bridge and the process of a robot's senses say to each other. What that one does is in `senses.py`."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Wanted:
    """What the process is to do. Topics that are None are not there; lengths in metres."""

    node: str
    master_uri: str | None
    cancels: tuple[str, ...]  # topics of actionlib_msgs/GoalID
    map_frame: str = "map"
    base_frame: str = "base_link"
    amcl_pose: str | None = None
    fiducials: str | None = None
    image: str | None = None
    camera_info: str | None = None
    dictionary: str = "DICT_5X5_1000"
    size: float = 0.14
    sizes: dict[int, float] = field(default_factory=dict)
    pose_every_s: float = 0.25
    look_every_s: float = 0.5


@dataclass(frozen=True)
class UnderWay:
    """The goal that is to be cancelled when the bridge is gone: its topic and name; None: there is none.

    `mission`: whether somebody waits for what the robot sees.
    """

    goal: tuple[str, str] | None
    mission: bool = False


@dataclass(frozen=True)
class Felt:
    """How the process does: the ROS link, and when (monotonic) there was a frame, a pose and a picture."""

    link: str
    up: bool
    pose_age_s: float
    picture_age_s: float
