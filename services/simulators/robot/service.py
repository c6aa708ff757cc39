"""A robot on the bus: it drives in its map at a finite speed, fails sometimes, and sees what is in front of it.

It listens to `robot/<robot>/goto` and `/cancel`, and says `/goto/result`, `/pose` and `/seen`. Not here: the same robot
as ROS nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from random import Random

import numpy as np
from pydantic import Field

from services import topics
from services.apartment import robot_places
from services.bus import Message
from services.errors import ConfigError
from services.payloads import Point, stamp
from services.payloads.robot import GotoResult, RobotCancel, RobotGoto, RobotPose, RobotSeen, SeenMarker
from services.runner import Post, Service
from services.section import Section
from services.simulators.camera.view.solids import boxes
from services.simulators.robot import plan
from services.simulators.robot.body import Body
from services.simulators.robot.navigation import Navigation
from services.simulators.robot.route import route
from services.simulators.robot.sight import seen
from services.simulators.world import World, load
from services.topic import RobotName
from services.topics import Read

STEP_S = 0.1  # of its motion
POSE_EVERY_S, LOOK_EVERY_S = 0.5, 0.5
NOISE_M = 0.02  # of where it believes a marker to be


class Config(Section):
    """How the simulated robot runs; `folder` is given by the program."""

    folder: Path = Path()
    world: Path
    robot: RobotName = "tiago"
    places: Path | None = None  # the file of its named points
    seed: int = 1
    fails: int = Field(default=0, ge=0)  # so many goals fail first, as when somebody stands in the way
    on_bus: bool = True  # false: real ROS nodes (`nodes.py`), and the bridge speaks for them
    fps: float = Field(default=2.5, gt=0, le=30)  # of the camera of those


@contextmanager
def start(config: Config, post: Post) -> Iterator[Service]:
    """The service; ConfigError where it is to be ROS nodes and ROS is not installed."""
    robot = SimulatedRobot(config, load(config.folder / config.world))
    if config.on_bus:
        yield robot
        return
    from services.simulators.robot import nodes  # ROS and pictures, for a robot on ROS alone

    if not nodes.installed():
        raise ConfigError(
            ["simulators.robot: expected ROS 1: apt-get install python3-actionlib python3-move-base-msgs"]
        )
    navigation = Navigation(robot.grid, robot.places.radius, robot.body, config.fails, config.seed)
    with closing(nodes.Nodes(robot.world, navigation, config.seed, config.fps)):
        yield OffBus()


class OffBus:
    """The service of a robot that is ROS nodes: the bus hears nothing of it but that it runs."""

    subscribes: tuple[str, ...] = ()
    due: float | None = None

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """See `Service`."""
        return ()

    def tick(self, now: float) -> Iterable[Message]:
        """See `Service`."""
        return ()


def check(config: Config) -> None:
    """Reads the files that the settings name; ConfigError tells their faults."""
    load(config.folder / config.world)
    if config.places is not None:
        robot_places.read(config.folder / config.places)


class SimulatedRobot:
    """The service. `world` is what there really is; the robot drives by the map of it."""

    subscribes: tuple[str, ...]

    def __init__(self, config: Config, world: World) -> None:
        self.name, self.world = config.robot, world
        self.subscribes = tuple(row.filter_for(robot=config.robot) for row in (topics.ROBOT_GOTO, topics.ROBOT_CANCEL))
        self.due: float | None = 0.0
        self.counters = {"goals": 0, "failed": 0}
        self.grid = plan.grid(world)
        self.places = (
            robot_places.read(config.folder / config.places)[0] if config.places else robot_places.RobotPlaces()
        )
        start = world.robots[config.robot].pose
        self.body = Body(start.x, start.y, start.yaw_deg)
        self.fails = config.fails
        self._boxes = boxes(world)
        self._draw = Random(config.seed)
        self._goal: str | None = None  # id of what is under way
        self._under_way = False
        self._taken: set[str] = set()  # ids: a goal that comes twice is one
        self._at = 0.0
        self._pose_due = self._look_due = 0.0

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """Takes a goal or a cancel."""
        read = topics.read(message, now)
        return self._go(read.payload, now) if read.topic is topics.ROBOT_GOTO else self._cancel(read, now)

    def tick(self, now: float) -> Iterator[Message]:
        """Moves, and says what there is to say."""
        if self._at:
            self.body.advance(now - self._at)
        self._at = now
        if self._under_way and not self.body.moving:
            yield self._ended("arrived")
        if now >= self._pose_due:
            self._pose_due = now + POSE_EVERY_S
            pose = RobotPose(
                x=round(self.body.x, 3), y=round(self.body.y, 3), yaw_deg=round(self.body.yaw_deg, 2), stamp=stamp(now)
            )
            yield topics.ROBOT_POSE.message(pose, robot=self.name)
        if now >= self._look_due:
            self._look_due = now + LOOK_EVERY_S
            yield topics.ROBOT_SEEN.message(self._look(now), robot=self.name)
        self.due = now + STEP_S if self.body.moving else min(self._pose_due, self._look_due)

    def _go(self, goal: RobotGoto, now: float) -> Iterator[Message]:
        if goal.id is not None and goal.id in self._taken:
            return
        if self._under_way:
            yield self._ended("cancelled", "another goal came")
        self._taken.add(goal.id or "")
        self._goal, self._under_way = goal.id, True
        self.counters["goals"] += 1
        yield self._say("accepted")
        where = self._where(goal)
        if isinstance(where, str):
            yield self._ended("failed", where)
            return
        way = route(self.grid, (self.body.x, self.body.y), where[:2], self.places.radius)
        if way is None:
            yield self._ended("failed", "there is no way to it")
        elif self.fails > 0:
            self.fails -= 1
            yield self._ended("failed", "something stands in the way")
        else:
            self.body.set_out(way[1:], where[2])
            self.due = now

    def _where(self, goal: RobotGoto) -> tuple[float, float, float] | str:
        if goal.point is None:
            assert goal.x is not None
            assert goal.y is not None
            return goal.x, goal.y, goal.yaw_deg
        name = self.places.named(goal.point)
        if name is None:
            return f"no point {goal.point!r}"
        point = self.places.points[name]
        return point.x, point.y, point.yaw_deg

    def _cancel(self, read: Read, now: float) -> Iterator[Message]:
        cancel: RobotCancel = read.payload
        if self._under_way and cancel.id in (None, self._goal):
            self.body.stop()
            yield self._ended("cancelled")
        self.due = now

    def _ended(self, state: str, reason: str = "") -> Message:
        self._under_way = False
        self.counters["failed"] += state == "failed"
        return self._say(state, reason)

    def _say(self, state: str, reason: str = "") -> Message:
        result = GotoResult.model_validate({"id": self._goal, "state": state, "reason": reason})
        return topics.ROBOT_GOTO_RESULT.message(result, robot=self.name)

    def _look(self, now: float) -> RobotSeen:
        relation = self.world.map.apartment_to_map
        at = self.world.map.to_apartment(np.array([[self.body.x, self.body.y, 0.0]]))[0]
        found = seen(at[:2], self.body.yaw_deg - relation.yaw_deg, self.world.markers, self._boxes)
        markers = [
            SeenMarker(marker=marker.id, position=self._believed(marker.pose.translation), distance=round(far, 2))
            for marker, far in found
        ]
        return RobotSeen(markers=markers, stamp=stamp(now))

    def _believed(self, position: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Point:
        x, y, z = self.world.map.apartment_to_map.transform.apply(position)
        draw = self._draw.gauss
        return Point(x=round(x + draw(0, NOISE_M), 3), y=round(y + draw(0, NOISE_M), 3), z=round(float(z), 3))
