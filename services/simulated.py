"""The simulated apartment as it runs: private peers, the services of `config/simulated.yaml`, one process each.

The demo tells its story, the pytest plugin gives it to tests, the soak kills parts of it. With `real` it uses
mosquitto, MariaDB and ROS where they are installed, else an embedded broker and SQLite.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from services.client import connected
from services.config import Apartment, load
from services.peers import Missing, answers, embedded, free_port, mariadb, mosquitto, ros
from services.supervisor import READY_S, Supervisor, commands, in_background, processes, simulated
from services.topics import CAMERA_STATUS

CONFIG = Path(__file__).parents[1] / "config"
USUAL_BROKER_PORT = 1883
ROBOT = ("rospy", "actionlib", "move_base_msgs")  # what bridge and simulated robot need besides a master
ROBOT_PACKAGES = "python3-rospy python3-actionlib python3-move-base-msgs"
USUAL_DASHBOARD_PORT = 8088


@dataclass
class Parts:
    """What the demo meets: `used` by part, and how to get what is missing."""

    folder: Path
    environment: dict[str, str] = field(default_factory=dict)
    used: list[tuple[str, str, str]] = field(default_factory=list)
    database: mariadb.Server | None = None
    ros: ros.Master | None = None
    broker: ExitStack = field(default_factory=ExitStack)
    broker_pid: int = 0

    @property
    def broker_port(self) -> int:
        """Where the broker listens."""
        return int(self.environment["APARTMENT_BROKER_PORT"])

    def note(self, part: str, what: str, missing: Missing | None = None) -> None:
        """Adds a line to the table that people see first."""
        self.used.append((part, what, f"{missing}" if missing else ""))


@dataclass(frozen=True)
class Simulated:
    """A running apartment. `ready` is what each service said of itself: pid and addresses."""

    folder: Path
    config: Path
    apartment: Apartment
    parts: Parts
    supervisor: Supervisor
    ready: dict[str, Any]

    @property
    def addresses(self) -> dict[str, Any]:
        """What a program that attaches wants to know; the database's address has no password in it."""
        return {
            "broker": {"host": self.apartment.bus.host, "port": self.apartment.bus.port},
            "database": self.parts.environment["APARTMENT_DATABASE"],
            "ros_master_uri": self.parts.ros.uri if self.parts.ros else None,
            "services": self.ready,
        }

    @property
    def log(self) -> Path:
        """What the services log."""
        return self.folder / "services.log"


@contextmanager
def parts_of(folder: Path, *, real: bool, usual_ports: bool = False) -> Iterator[Parts]:
    """Starts the peers; they end with the block. `usual_ports`: broker and page where people look, if they are free."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = Parts(folder)
    parts.environment["APARTMENT_STATE"] = str(folder / "state")
    parts.environment["APARTMENT_CAMERA_PORT"] = str(free_port())
    parts.environment["APARTMENT_CAMERA_RTSP_PORT"] = str(free_port())
    parts.environment["APARTMENT_SIDE_DOOR_PORT"] = str(free_port())
    page = USUAL_DASHBOARD_PORT if usual_ports and not answers(USUAL_DASHBOARD_PORT) else 0
    parts.environment["APARTMENT_DASHBOARD_PORT"] = str(page)
    broker = USUAL_BROKER_PORT if usual_ports and not answers(USUAL_BROKER_PORT) else free_port()
    parts.environment["APARTMENT_BROKER_PORT"] = str(broker)
    with ExitStack() as stack:
        for start in (_start_broker, _start_database, _start_ros):
            start(stack, parts, real)
        yield parts


def _wait_for_cameras(apartment: Apartment, names: Collection[str]) -> None:
    with connected(apartment.bus, [CAMERA_STATUS.filter]) as client:
        for camera in apartment.cameras:
            if f"camera-{camera}" in names:
                client.payload(CAMERA_STATUS.name(cam=camera), lambda status: status.state == "online", READY_S)


@contextmanager
def services_of(
    folder: Path,
    parts: Parts,
    without: Collection[str] = (),
    only: Collection[str] = (),
    change: Callable[[Path], None] = lambda _: None,
) -> Iterator[Simulated]:
    """Starts the services, waits until they and the cameras answer, and ends them with the block.

    `only`: these and no others. `change` is given the copy of the configuration before anything reads it.
    """
    config = folder / "config" / "simulated.yaml"
    shutil.copytree(CONFIG, config.parent)  # saved places and the like are not to change the repository
    change(config)
    apartment = load(config, environment={**os.environ, **parts.environment})
    names = [name for name in apartment.instances if name not in without and (not only or name in only)]
    groups = processes(apartment, names)
    running, last = commands(groups, config), simulated(apartment, groups)
    supervisor = Supervisor(running, parts.environment, folder / "services.log", last)
    with in_background(supervisor) as ready:
        _wait_for_cameras(apartment, names)
        yield Simulated(folder, config, apartment, parts, supervisor, ready)


def _start_broker(stack: ExitStack, parts: Parts, real: bool) -> None:
    port = int(parts.environment["APARTMENT_BROKER_PORT"])
    stack.enter_context(parts.broker)
    try:
        _only_if(real, "mosquitto")
        start_mosquitto(parts)
    except Missing as missing:
        parts.broker.enter_context(embedded.broker(port))
        parts.note("broker", f"embedded, port {port}", missing)
    else:
        parts.note("broker", f"mosquitto, port {port}")


def start_mosquitto(parts: Parts) -> None:
    """Starts it, or starts it again after `parts.broker.close()`: same folder, port, accounts."""
    started = mosquitto.private(parts.folder / "mosquitto", port=parts.broker_port, anonymous=True)
    broker = parts.broker.enter_context(started)
    parts.broker_pid = broker.pid
    for account, password in broker.passwords.items():
        parts.environment[f"BUS_{account.replace('-', '_').upper()}_PASSWORD"] = password


def _start_database(stack: ExitStack, parts: Parts, real: bool) -> None:
    try:
        _only_if(real, "MariaDB")
        server = stack.enter_context(mariadb.private(parts.folder / "mariadb"))
    except Missing as missing:
        parts.environment["APARTMENT_DATABASE"] = f"sqlite:///{parts.folder}/bus.db"
        parts.note("database", "SQLite, embedded", missing)
    else:
        parts.database = server
        parts.environment["APARTMENT_DATABASE"] = server.url
        parts.environment["APARTMENT_DATABASE_PASSWORD"] = server.password
        parts.note("database", f"MariaDB, port {server.port}")


def _start_ros(stack: ExitStack, parts: Parts, real: bool) -> None:
    try:
        _only_if(real, "ROS")
        if lacking := [name for name in ROBOT if importlib.util.find_spec(name) is None]:
            raise Missing(f"Python finds no {', '.join(lacking)}: apt-get install {ROBOT_PACKAGES}")
        parts.ros = stack.enter_context(ros.private(parts.folder / "ros"))
    except Missing as missing:
        parts.environment["APARTMENT_WITHOUT_ROS"] = "true"
        parts.note("robot", "on the bus, no ROS", missing)
    else:
        parts.environment.update(parts.ros.env)
        parts.note("robot", f"ROS 1, ROS_MASTER_URI={parts.ros.uri}")


def _only_if(real: bool, part: str) -> None:
    if not real:
        raise Missing(f"{part} is not wanted here")
