"""The mission service: each message goes to the desk of the robot that it concerns, or to all. See `__init__`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from services import topics
from services.apartment import robot_places
from services.bus import Message
from services.errors import BadMessage
from services.mission import telling
from services.mission.chart import Chart
from services.mission.desk import Desk
from services.mission.memory import Memory, by_camera
from services.mission.refresh import Refresh
from services.mission.settings import Config
from services.payloads.gleaned import glean
from services.payloads.robot import Where, WhereReply
from services.runner import Post

MARKERS = range(10_000)  # that there may be
USABLE = ("online", "degraded")


@contextmanager
def start(config: Config, post: Post) -> Iterator[Missions]:
    """The service; it holds nothing that has to be closed. ConfigError when a robot's places cannot be read."""
    yield Missions(config)


def check(config: Config) -> None:
    """Reads the files that the settings name; ConfigError tells their faults."""
    for robot in config.robots.values():
        robot_places.read(config.folder / robot.places)


class Missions:
    """The service. `desks` by robot; they share one memory of what was seen."""

    subscribes = (
        topics.MISSION_ORDER.filter, topics.MISSION_WHERE.filter, topics.ROBOT_POSE.filter, topics.ROBOT_SEEN.filter,
        topics.ROBOT_GOTO_RESULT.filter, topics.CAMERA_MARKER.filter, topics.CAMERA_SCAN_RESULT.filter,
        topics.CAMERA_ORDER_RESULT.filter, topics.CAMERA_STATUS.filter, topics.SERVICE_STATUS.filter,
    )  # fmt: skip

    def __init__(self, config: Config) -> None:
        self.memory = Memory()
        self.refresh = Refresh(config.fresh_s, config.scan_s)
        self.desks = {
            name: Desk(name, config, Chart(*robot_places.read(config.folder / one.places)), self.memory)
            for name, one in config.robots.items()
        }

    @property
    def due(self) -> float | None:
        """When `tick` is wanted."""
        times = [*(desk.due for desk in self.desks.values()), self.refresh.due]
        return min((time for time in times if time is not None), default=None)

    @property
    def counters(self) -> dict[str, float]:
        """For `service/mission/info`."""
        return {"missions": sum(desk.mission is not None for desk in self.desks.values())}

    def handle(self, message: Message, now: float) -> Iterator[Message]:
        """Takes one message; BadMessage when it is for a robot that is not configured."""
        try:
            read = topics.read(message, now)
            self._check_robot(read)
        except BadMessage as error:
            yield from self._refused(message, str(error), now)
            raise
        yield from self._of_robot(read, now) if "robot" in read.levels else self._of_house(read, now)

    def tick(self, now: float) -> Iterator[Message]:
        """What is due at every desk, and whose answer has waited for long enough."""
        for robot, asked in self.refresh.late(now):
            yield self._told(robot, asked, now)
        for desk in self.desks.values():
            yield from desk.tick(now)

    def _check_robot(self, read: topics.Read) -> None:
        if "robot" in read.levels and read.levels["robot"] not in self.desks:
            raise BadMessage(f"{read.message.topic}: expected one of {', '.join(self.desks)}")

    def _refused(self, message: Message, why: str, now: float) -> Iterator[Message]:
        """An order that cannot be taken is answered, with its own id where one can be read.

        Not a cancel, and not an id that is known: the answer would be taken for the end of the mission that it names.
        """
        row, levels = topics.find(message.topic)
        desk, found = self.desks.get(levels.get("robot", "")), glean(message.payload)
        if row is not topics.MISSION_ORDER or found.told.get("cancel") or (desk is not None and desk.knows(found.id)):
            return
        marker = found.told.get("find")
        yield telling.refused(levels["robot"], found.id, marker if marker in MARKERS else None, why, now)

    def _of_robot(self, read: topics.Read, now: float) -> Iterable[Message]:
        desk = self.desks[read.levels["robot"]]
        if read.topic is topics.MISSION_ORDER:
            return desk.order(read.payload, now)
        if read.topic is topics.ROBOT_GOTO_RESULT:
            return desk.goal_ended(read.payload, now)
        if read.topic is topics.ROBOT_SEEN:
            return desk.sees(read.payload, now)
        if read.topic is topics.MISSION_WHERE:
            return self._where(desk, read.payload, now)
        desk.stands_at(read.payload, now)
        return ()

    def _where(self, desk: Desk, asked: Where, now: float) -> Iterator[Message]:
        """Answers at once; where that is too old, and no mission needs the cameras, the house looks again."""
        seen = self.memory.of(asked.marker)
        cameras = [name for name, usable in desk.cameras.items() if usable]
        free = cameras and not any(one.mission is not None for one in self.desks.values())
        again = bool(free and asked.refresh and self.refresh.wanted(asked.marker, seen[0].at if seen else None, now))
        yield self._told(desk.robot, asked, now, refreshing=again)
        if again:
            yield from self.refresh.begin(desk.robot, asked, cameras, now)

    def _told(self, robot: str, asked: Where, now: float, *, refreshing: bool = False) -> Message:
        sightings = self.memory.told(asked.marker, now)
        reply = WhereReply(id=asked.id, marker=asked.marker, sightings=sightings, refreshing=refreshing)
        return topics.MISSION_WHERE_REPLY.message(reply, robot=robot, id=asked.id)

    def _of_house(self, read: topics.Read, now: float) -> Iterator[Message]:
        if read.topic in (topics.CAMERA_MARKER, topics.CAMERA_SCAN_RESULT):
            sighting = by_camera(read.payload, read.levels["cam"])
            if self.memory.note(sighting, now):
                for desk in self.desks.values():
                    yield from desk.sighted(sighting, now)
        elif read.topic is topics.CAMERA_ORDER_RESULT:
            for robot, asked in self.refresh.ended(read.payload):
                yield self._told(robot, asked, now)
            for desk in self.desks.values():
                yield from desk.scan_ended(read.levels["cam"], read.payload, now)
        elif read.topic is topics.CAMERA_STATUS:
            yield from self._camera(read.levels["cam"], read.payload.state in USABLE, None, now)
        elif read.levels["service"].startswith("camera-"):
            yield from self._camera(read.levels["service"].removeprefix("camera-"), None, read.payload == "online", now)

    def _camera(self, name: str, usable: bool | None, serves: bool | None, now: float) -> Iterator[Message]:
        """A camera reboots and goes on with its scan; one whose service is gone does not."""
        for desk in self.desks.values():
            if name not in desk.cameras:
                continue
            if usable is not None:
                desk.cameras[name] = usable
            if serves is False:
                yield from desk.camera_gone(name, now)
