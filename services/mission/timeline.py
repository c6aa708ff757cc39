"""What happened in one mission, as it was heard on the bus: steps, goals, looks, scans, sightings, and the robot's way.

Pure: messages in, values out. Drawn in `picture.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from services import topics
from services.bus import Message
from services.errors import BadMessage
from services.payloads import ScanResult, ScanState
from services.payloads.robot import GotoResult, MissionResult, MissionState, RobotGoto, RobotPose, RobotSeen

XY = tuple[float, float]
FILTERS = (
    topics.MISSION_ORDER.filter, topics.MISSION_STATE.filter, topics.MISSION_RESULT.filter, topics.ROBOT_GOTO.filter,
    topics.ROBOT_CANCEL.filter, topics.ROBOT_GOTO_RESULT.filter, topics.ROBOT_POSE.filter, topics.ROBOT_SEEN.filter,
    topics.CAMERA_ORDER.filter, topics.CAMERA_ORDER_RESULT.filter, topics.CAMERA_SCAN_STATE.filter,
    topics.CAMERA_SCAN_RESULT.filter,
)  # fmt: skip


@dataclass(frozen=True)
class Goal:
    """One that the robot was sent to: a pose in the map frame, or the name of a point; times in seconds."""

    at: float
    id: str
    pose: tuple[float, float, float] | None  # x, y in metres, yaw in degrees
    point: str | None = None
    ended: float | None = None
    end: str = ""


@dataclass(frozen=True)
class Step:
    """What the mission did from then on, and why."""

    at: float
    state: str
    text: str


@dataclass(frozen=True)
class Scan:
    """A word of a camera's scan."""

    at: float
    camera: str
    state: str
    place: str
    progress: float


@dataclass(frozen=True)
class Sighting:
    """A camera of the house saw the marker there: apartment frame, metres."""

    at: float
    camera: str
    position: XY | None


@dataclass
class Timeline:
    """One robot's mission; `heard` takes what comes, from the order on. Times are seconds since `began`."""

    robot: str
    marker: int
    began: float
    poses: list[tuple[float, float, float, float]] = field(default_factory=list)  # time, x, y, yaw in degrees; map
    steps: list[Step] = field(default_factory=list)
    goals: list[Goal] = field(default_factory=list)
    looks: list[tuple[float, bool]] = field(default_factory=list)  # whether the robot's picture had the marker
    scans: list[Scan] = field(default_factory=list)
    sightings: list[Sighting] = field(default_factory=list)
    messages: list[tuple[float, str]] = field(default_factory=list)  # their topics
    result: MissionResult | None = None

    @property
    def end(self) -> float:
        """How long it took."""
        times = [self.steps[-1].at] if self.steps else []
        return max([1.0, *times, *(at for at, _ in self.messages)])

    def heard(self, message: Message) -> None:
        """Takes one message; what is not about this mission is left out."""
        try:
            read = topics.read(message, message.received)
        except BadMessage:  # as everywhere, but here nobody is to be told
            return
        if read.levels.get("robot", self.robot) != self.robot or self.result is not None:
            return
        at = message.received - self.began
        if at >= 0:
            self._take(read.payload, read.levels, at)
            self.messages.append((at, message.topic))

    def _take(self, said: Any, levels: dict[str, str], at: float) -> None:
        if isinstance(said, RobotPose):
            self.poses.append((at, said.x, said.y, said.yaw_deg))
        elif isinstance(said, RobotSeen):
            self.looks.append((at, any(one.marker == self.marker for one in said.markers)))
        elif isinstance(said, MissionState):
            self._step(at, said.state, said.reason)
        elif isinstance(said, MissionResult):
            self.result = said
            self._step(at, said.state, said.reason)
        elif isinstance(said, RobotGoto):
            pose = (said.x, said.y, said.yaw_deg) if said.x is not None and said.y is not None else None
            if said.id not in [one.id for one in self.goals]:
                self.goals.append(Goal(at, said.id or "", pose, said.point))
        elif isinstance(said, GotoResult):
            self._goal_says(said, at)
        else:
            self._of_house(said, levels, at)

    def _goal_says(self, said: GotoResult, at: float) -> None:
        """Who may not read what the robot is told, sees a goal when it is taken, and where it ended."""
        index = next((index for index, one in enumerate(self.goals) if one.id == said.id), None)
        if index is None:
            self.goals.append(Goal(at, said.id or "", None))
        elif said.state != "accepted" and self.goals[index].ended is None:
            there = self.poses[-1][1:] if self.poses and said.state == "arrived" else None
            goal = self.goals[index]
            self.goals[index] = replace(goal, ended=at, end=said.state, pose=goal.pose or there)

    def _of_house(self, said: Any, levels: dict[str, str], at: float) -> None:
        if isinstance(said, ScanState):
            self.scans.append(Scan(at, levels["cam"], said.state, said.place or "", said.progress))
        elif isinstance(said, ScanResult) and said.marker == self.marker:
            place = None if said.position is None else (said.position.x, said.position.y)
            self.sightings.append(Sighting(at, levels["cam"], place))

    def _step(self, at: float, state: str, text: str) -> None:
        if state != "idle" and (not self.steps or (self.steps[-1].state, self.steps[-1].text) != (state, text)):
            self.steps.append(Step(at, state, text))

    def state_at(self, at: float) -> str:
        """In which step it was then."""
        return next((one.state for one in reversed(self.steps) if one.at <= at), "look")
