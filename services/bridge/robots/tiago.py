"""PAL's TIAGo, and every robot of ROS 1 that drives by move_base: `robot/<robot>/...` of the bus is its ROS names.

`/goto` goes to move_base as a pose, or to PAL's server of named points where `poi` names it; `/cancel` ends the goal.
Where it is comes from tf or amcl, what it sees from its pictures or from aruco_detect (`senses.py`). Nothing of PAL's
has to be installed here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import inf
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from services import topics
from services.bridge.child import Child
from services.bridge.node import Inlet, Node, Outlet, Ports
from services.bridge.part import Part, status
from services.bridge.robots import Where, actions
from services.bridge.robots.actions import Action
from services.bridge.robots.commander import SERVICE, Commander
from services.bridge.robots.goals import Goals, Said, Send
from services.bridge.robots.kept import Kept
from services.bridge.robots.pipe import Felt, UnderWay, Wanted
from services.bridge.rules import Fields, Heard
from services.bus import Message
from services.errors import BadMessage
from services.payloads.robot import GotoResult, MissionState, RobotCancel, RobotGoto, RobotPose, RobotSeen
from services.section import Section

if TYPE_CHECKING:
    from services.apartment.robot_places import RobotPlaces

EVERY_S = 0.1  # between two looks at what the senses say
WELL_S = 5.0  # poses and pictures that are older are a fault
OK, WARN, ERROR = 0, 1, 2
DICTIONARY = (  # OpenCV's names
    r"^DICT_((4X4|5X5|6X6|7X7)_(50|100|250|1000)|ARUCO_ORIGINAL|ARUCO_MIP_36[hH]12"
    r"|APRILTAG_(16[hH]5|25[hH]9|36[hH]1[01]))$"
)
Name = Annotated[str, Field(pattern=r"^/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*$")]


class Markers(Section):
    """How large the printed black squares are, metres: `size`, and `sizes` of those that are not so."""

    size: float = Field(default=0.14, gt=0, le=2)
    sizes: dict[int, Annotated[float, Field(gt=0, le=2)]] = {}


class Settings(Section):
    """The robot's section, `bridge.robots.<robot>`. The defaults are those of a TIAGo."""

    kind: Literal["tiago"] = "tiago"
    places: Path | None = None  # the file of its named points; poses of move_base
    move_base: Name = "/move_base"
    poi: Name | None = None  # PAL's action server for points of its own map, such as /poi_navigation_server/go_to_poi
    map_frame: str = "map"
    base_frame: str = "base_footprint"
    amcl_pose: Name | None = "/amcl_pose"  # where there is no tf; null: tf alone
    image: Name | None = "/xtion/rgb/image_raw/compressed"  # what our own detector looks at
    camera_info: Name | None = "/xtion/rgb/camera_info"
    fiducials: Name | None = None  # of aruco_detect, such as /fiducial_transforms; instead of image
    dictionary: str = Field(default="DICT_5X5_1000", pattern=DICTIONARY)
    markers: Markers = Markers()
    look_every_s: float = Field(default=0.5, ge=0.1, le=10)
    pose_every_s: float = Field(default=0.25, ge=0.05, le=10)

    @model_validator(mode="after")
    def sees_by_one_of_both(self) -> Self:
        if self.fiducials is not None and self.image is not None and "image" in self.model_fields_set:
            raise ValueError("expected either image or fiducials, got both")
        return self


def check(settings: Section, folder: Path) -> None:
    """Reads the robot's places; ConfigError tells their faults."""
    from services.apartment import robot_places  # maps and pictures are for who runs the bridge, settings for everybody

    assert isinstance(settings, Settings)
    if settings.places is not None:
        robot_places.read(folder / settings.places)


def part(robot: str, settings: Section, where: Where) -> Tiago:
    """See `robots/__init__`; ConfigError when its places cannot be read."""
    from services.apartment import robot_places

    assert isinstance(settings, Settings)
    given = settings.places
    places = robot_places.read(where.folder / given)[0] if given else robot_places.RobotPlaces()
    child = Child(robot, _feel, wanted(robot, settings, where), 1.0)
    return Tiago(robot, settings, places, child, Kept(where.state / "robots" / robot if where.state else None))


def _feel(wanted: Wanted, connection: Connection, every_s: float) -> None:
    """In the process: OpenCV is loaded there, not in the bridge."""
    from services.bridge.robots import senses

    senses.run(wanted, connection, every_s)


def wanted(robot: str, settings: Settings, where: Where) -> Wanted:
    """What its senses are to do."""
    image = None if settings.fiducials else settings.image
    return Wanted(
        node=f"{where.node}_{robot}",
        master_uri=where.master_uri,
        cancels=tuple(one.cancel for one in _servers(settings)),
        map_frame=settings.map_frame,
        base_frame=settings.base_frame,
        amcl_pose=settings.amcl_pose,
        fiducials=settings.fiducials,
        image=image,
        camera_info=settings.camera_info if image else None,
        dictionary=settings.dictionary,
        size=settings.markers.size,
        sizes=settings.markers.sizes,
        pose_every_s=settings.pose_every_s,
        look_every_s=settings.look_every_s,
    )


def _servers(settings: Settings) -> tuple[Action, ...]:
    poi = (actions.go_to_poi(settings.poi),) if settings.poi else ()
    return (actions.move_base(settings.move_base), *poi)


class Tiago(Part):
    """The part. `child` runs its senses; None: it has none, as in tests."""

    rows = (topics.ROBOT_GOTO, topics.ROBOT_CANCEL, topics.MISSION_STATE, topics.SERVICE_STATUS)

    def __init__(self, robot: str, settings: Settings, places: RobotPlaces, child: Child | None, kept: Kept) -> None:
        self._robot, self._settings, self._places, self._child = robot, settings, places, child
        servers = _servers(settings)
        self._move_base, self._poi = servers[0], servers[1] if len(servers) > 1 else None
        self._status = {one.status: one for one in servers}
        self._result = {one.result: one for one in servers}
        self.ports = Ports(
            (*(Outlet(one.goal, one.type, definition=one.definition) for one in servers),
             *(Outlet(one.cancel, "actionlib_msgs/GoalID") for one in servers)),
            (*(Inlet(name, "actionlib_msgs/GoalStatusArray") for name in self._status),
             *(Inlet(name, "*") for name in self._result)),
        )  # fmt: skip
        self.goals = Goals(f"apartment/{robot}/")
        self._commander = Commander()
        self._to_ros: list[Send] = []
        self._to_bus: list[GotoResult] = []
        self._kept = kept
        if (left := kept.read()) is not None:
            self._to_bus.append(self.goals.left(left))
        self._told: UnderWay | None = None  # the goal under way, as the senses know it
        self._felt: Felt | None = None
        self.due = self._feel_due = 0.0

    def hear(self, heard: Heard, now: float) -> None:
        """See `Part`."""
        if heard.levels.get("service") == SERVICE:
            self._commander.lives(str(heard.payload), now)
        if heard.levels.get("robot") != self._robot:
            return
        said = heard.model
        if isinstance(said, RobotGoto):
            self._take(self._go(said, now))
        elif isinstance(said, RobotCancel):
            self._take(self._stop(said))
        elif isinstance(said, MissionState):
            self._commander.orders(said)
        self.due = now

    def lost(self, now: float) -> None:
        """See `Part`."""
        self._take(self.goals.cancel(None, "the bus was lost, so that nobody could have stopped the robot"))
        self.due = now

    def heard_ros(self, topic: str, fields: Fields, now: float) -> Iterable[Message]:
        """See `Part`."""
        if topic in self._status:
            self._take(self.goals.status(self._status[topic], fields["status_list"], now))
        else:
            self._take(self.goals.result(self._result[topic], _goal_status(fields), now))
        return self._news()

    def tick(self, node: Node, now: float) -> Iterable[Message]:
        """See `Part`."""
        goal = self.goals.goal
        if goal is not None:
            self._take(self.goals.tick(now, listens=node.listeners(goal.action.goal) > 0))
            if self._commander.is_gone(goal.id, now):
                self._take(self.goals.cancel(goal.id, "the mission service is gone, so that nobody follows the robot"))
        self._kept.write(self.goals.goal.id if self.goals.goal else None)
        under_way = UnderWay(self.goals.under_way, self._commander.wants)
        if self._child is not None and under_way != self._told:
            self._told = under_way
            self._child.tell(under_way)
        for one in self._to_ros:
            node.publish(one.topic, one.fields)
        self._to_ros.clear()
        felt = list(self._feel(now)) if now >= self._feel_due else []
        self.due = self._feel_due
        return [*self._news(), *felt]

    def statuses(self, now: float) -> list[Fields]:
        """See `Part`."""
        if self._child is None:
            return []
        felt, name = self._felt, f"{self._robot}: senses"
        if felt is None or not self._child.runs:
            return [status(WARN, name, "starting", self._robot, starts=str(self._child.starts))]
        level, text = OK, "it says where it is, and sees"
        if not felt.up:
            level, text = ERROR, f"no ROS master: {felt.link}"
        elif felt.pose_age_s > WELL_S:
            level, text = ERROR, "it does not say where it is: neither tf nor amcl"
        elif felt.picture_age_s > WELL_S:
            level, text = WARN, "it sees nothing: no pictures"
        ages = {"pose_age_s": _age(felt.pose_age_s), "picture_age_s": _age(felt.picture_age_s)}
        return [status(level, name, text, self._robot, starts=str(self._child.starts), **ages)]

    def close(self) -> None:
        """Ends the senses, which cancel what is under way."""
        if self._child is not None:
            self._child.close()

    def _go(self, goto: RobotGoto, now: float) -> Iterator[Said]:
        if goto.point is None:
            assert goto.x is not None
            assert goto.y is not None
            fields = actions.to_pose(self._settings.map_frame, goto.x, goto.y, goto.yaw_deg)
            yield from self.goals.order(goto.id, self._move_base, fields, now)
        elif self._poi is not None:
            yield from self.goals.order(goto.id, self._poi, actions.to_point(goto.point), now)
        elif (name := self._places.named(goto.point)) is not None:
            point = self._places.points[name]
            fields = actions.to_pose(self._settings.map_frame, point.x, point.y, point.yaw_deg)
            yield from self.goals.order(goto.id, self._move_base, fields, now)
        else:
            yield self.goals.refuse(goto.id, f"no point {goto.point!r}")

    def _stop(self, cancel: RobotCancel) -> Iterator[Said]:
        """Whatever moves the robot, when no goal is named: also what somebody else has ordered."""
        yield from self.goals.cancel(cancel.id, "")
        if cancel.id is None:
            yield from (Send(server.cancel, {}) for server in _servers(self._settings))

    def _take(self, said: Iterable[Said]) -> None:
        for one in said:
            if isinstance(one, Send):
                self._to_ros.append(one)
            else:
                self._to_bus.append(one)

    def _news(self) -> list[Message]:
        said, self._to_bus = self._to_bus, []
        return [topics.ROBOT_GOTO_RESULT.message(one, robot=self._robot) for one in said]

    def _feel(self, now: float) -> Iterator[Message]:
        """What the senses said; keeps them running."""
        self._feel_due = now + EVERY_S
        if self._child is None:
            return
        for said in self._child.said():
            if isinstance(said, RobotPose):
                yield topics.ROBOT_POSE.message(said, robot=self._robot)
            elif isinstance(said, RobotSeen):
                yield topics.ROBOT_SEEN.message(said, robot=self._robot)
            elif isinstance(said, Felt):
                self._felt = said
        if self._child.tend(now):
            self._felt, self._told = None, None


def _goal_status(result: Fields) -> Fields:
    """The GoalStatus in an action's result, whose type is its publisher's choice; BadMessage when it has none."""
    try:
        told = result["status"]
        return {
            "goal_id": {"id": str(told["goal_id"]["id"])}, "status": int(told["status"]), "text": str(told["text"]),
        }  # fmt: skip
    except (KeyError, TypeError, ValueError) as error:
        raise BadMessage(
            f"expected an action's result, with an actionlib_msgs/GoalStatus as status: {error}"
        ) from error


def _age(seconds: float) -> str:
    return "never" if seconds == inf else f"{seconds:.1f}"
