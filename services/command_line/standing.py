"""How the whole apartment stands, from what it says on the bus: services and their rates, cameras, robots, troubles.

Pure. Not here: listening and showing (`status.py`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from services import topics
from services.bus import Message
from services.errors import BadMessage
from services.payloads import CameraStatus, Diagnostic, OrderResult, Position, ScanState, ServiceInfo, seconds, stamp
from services.payloads.robot import MissionResult, MissionState, RobotPose

HEARD = (
    topics.SERVICE_STATUS, topics.SERVICE_INFO, topics.DIAGNOSTICS, topics.CAMERA_STATUS, topics.CAMERA_POSITION,
    topics.CAMERA_SCAN_STATE, topics.CAMERA_ORDER_RESULT, topics.MISSION_STATE, topics.MISSION_RESULT,
    topics.ROBOT_POSE,
)  # fmt: skip
FILTERS = tuple(row.filter for row in HEARD)
KEPT = 12  # troubles that are shown
LEVELS = ("ok", "warning", "error", "stale")
STALE_S = 5.0  # without a diagnostic, which comes every second; as in diagnostic_aggregator
POSE_S = 10.0  # a robot says where it is at least so often
COUNTED = ("received", "published")


@dataclass
class Service:
    """What is known of one service."""

    status: str = "never seen"
    info: ServiceInfo | None = None
    diagnostic: Diagnostic | None = None
    rates: dict[str, float] | None = None  # per second, between its last two diagnostics
    counted: tuple[float, dict[str, float]] | None = None  # when its last live diagnostic came, and its numbers

    def hear(self, diagnostic: Diagnostic, message: Message) -> None:
        """Its newest diagnostic; a retained one is of nobody knows when and tells no rate."""
        self.diagnostic = diagnostic
        numbers = {name: _number(diagnostic.values.get(name, "")) for name in COUNTED}
        if message.retain:
            return
        if self.counted is not None and message.received > self.counted[0]:
            past, before = self.counted
            passed = message.received - past
            self.rates = {name: max(0.0, round((numbers[name] - before[name]) / passed, 1)) for name in COUNTED}
        self.counted = (message.received, numbers)


@dataclass
class Camera:
    """What is known of one camera."""

    status: CameraStatus | None = None
    position: Position | None = None
    scan: ScanState | None = None


@dataclass
class Robot:
    """What is known of one robot."""

    mission: MissionState | None = None
    pose: RobotPose | None = None
    posed: float = 0.0  # when it was there


@dataclass(frozen=True)
class Trouble:
    """Something that is or was not well. `now`: it still is, as far as its component says."""

    time: str
    who: str
    level: str
    message: str
    now: bool


@dataclass
class Standing:
    """The newest of everything; `hear` is called with each message."""

    services: dict[str, Service] = field(default_factory=dict)
    cameras: dict[str, Camera] = field(default_factory=dict)
    robots: dict[str, Robot] = field(default_factory=dict)
    diagnostics: dict[str, tuple[float, Diagnostic]] = field(default_factory=dict)
    past: deque[Trouble] = field(default_factory=lambda: deque(maxlen=KEPT))
    now: float = 0.0
    listens: float = math.inf  # since when
    gone: float | None = None  # since when there is no broker, while there is none

    def look(self, now: float, *, connected: bool) -> None:
        """What time it is, and whether the broker is there: to be told again and again."""
        back = connected and (self.gone is not None or self.listens == math.inf)
        self.now, self.listens = now, now if back else self.listens
        self.gone = None if connected else self.gone or now

    @classmethod
    def of(cls, services: Iterable[str], cameras: Iterable[str]) -> Standing:
        """With nothing heard yet of those that the configuration has."""
        return cls({name: Service() for name in services}, {name: Camera() for name in cameras})

    @property
    def settled(self) -> bool:
        """Whether every service was heard of, and of those that are online how busy they are."""
        known = self.services.values()
        return all(one.status == "offline" or (one.status == "online" and one.rates is not None) for one in known)

    @property
    def well(self) -> bool:
        """Whether the broker and every service is there."""
        return self.gone is None and all(one.status == "online" for one in self.services.values())

    def is_stale(self, service: Service) -> bool:
        """Whether it is online, and should have said by now how it fares."""
        heard = service.counted[0] if service.counted else 0.0
        return service.status == "online" and self.now - max(heard, self.listens) > STALE_S

    def away(self, name: str) -> str:
        """How a service that is known is when it is not online, empty otherwise: what it said once is no more so."""
        service = self.services.get(name)
        return "" if service is None or service.status == "online" else f"service {service.status}"

    def was_there(self, robot: Robot) -> bool:
        """Whether its pose is an old one."""
        return self.now - robot.posed > POSE_S

    def hear(self, message: Message) -> None:
        """Takes one message; what the table does not understand is none of ours."""
        try:
            read = topics.read(message, message.received)
        except BadMessage:
            return
        said, levels = read.payload, read.levels
        if "service" in levels:
            self._service(self.services.setdefault(levels["service"], Service()), said)
        elif "cam" in levels:
            self._camera(self.cameras.setdefault(levels["cam"], Camera()), levels["cam"], said, message)
        elif "robot" in levels:
            self._robot(self.robots.setdefault(levels["robot"], Robot()), levels["robot"], said, message)
        elif isinstance(said, Diagnostic):
            self._diagnostic(levels["component"], said, message)

    def _service(self, service: Service, said: Any) -> None:
        if isinstance(said, ServiceInfo):
            service.info = said
        elif isinstance(said, str):
            service.status = said

    def _camera(self, camera: Camera, name: str, said: Any, message: Message) -> None:
        if isinstance(said, CameraStatus):
            camera.status = said
        elif isinstance(said, Position):
            camera.position = said
        elif isinstance(said, ScanState):
            camera.scan = said
        elif isinstance(said, OrderResult) and said.state in ("failed", "refused"):
            self._trouble(f"camera/{name}", f"{said.key}: {said.error or said.state}", message)

    def _robot(self, robot: Robot, name: str, said: Any, message: Message) -> None:
        if isinstance(said, MissionState):
            robot.mission = said
        elif isinstance(said, RobotPose):
            robot.pose, robot.posed = said, _time(said.stamp) if message.retain else message.received
        elif isinstance(said, MissionResult) and said.state == "failed":
            self._trouble(f"mission/{name}", said.reason, message)

    def _diagnostic(self, component: str, said: Diagnostic, message: Message) -> None:
        kind, _, name = component.partition("/")
        if kind == "service" and name:
            self.services.setdefault(name, Service()).hear(said, message)
        since, before = self.diagnostics.get(component, (message.received, said))
        if (before.level, before.message) != (said.level, said.message):
            if before.level:
                self.past.append(_trouble_of(component, since, before, now=False))
            since = message.received
        self.diagnostics[component] = (since, said)

    def _trouble(self, who: str, text: str, message: Message) -> None:
        self.past.append(Trouble(stamp(message.received), who, "error", text, now=False))

    def troubles(self) -> list[Trouble]:
        """What is not well now, the worst first, then what was not, the newest first."""
        present = [(name, *one) for name, one in self.diagnostics.items() if one[1].level]
        present.sort(key=lambda one: (-one[2].level, one[0]))
        return [*(_trouble_of(*one, now=True) for one in present), *reversed(self.past)][:KEPT]


def _time(at: str) -> float:
    try:
        return seconds(at)
    except (ValueError, OverflowError):
        return 0.0


def _number(text: str) -> float:
    return float(text) if text.isdecimal() else 0.0


def _trouble_of(who: str, since: float, said: Diagnostic, *, now: bool) -> Trouble:
    return Trouble(stamp(since), who, LEVELS[said.level], said.message, now)
