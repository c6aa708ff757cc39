"""A small apartment on real parts: mosquitto, cameras that are simulated, and `apartment run`, met only from outside.

Not here: the whole apartment with its database, robot and home, that is `services/simulated.py`.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import yaml

from services import peers
from services.client import Client, connected
from services.config import BusSettings
from services.peers import free_port, mosquitto, ros, running
from services.simulated import CONFIG
from tests.network import Link, network

READY_S = 60.0
PASSWORD = "only-simulated"


@dataclass
class Door:
    """The side door of a simulated camera: what is true, and what goes wrong."""

    url: str

    def state(self) -> dict[str, Any]:
        """The true pose, and whether it moves."""
        answer: dict[str, Any] = httpx.get(f"{self.url}/state", timeout=30).json()
        return answer

    def log(self) -> list[dict[str, Any]]:
        """Every request that the camera met."""
        answer: list[dict[str, Any]] = httpx.get(f"{self.url}/log", timeout=30).json()
        return answer

    def tell(self, path: str, **content: object) -> None:
        """An order of the side door."""
        httpx.post(f"{self.url}/{path}", json=content, timeout=30).raise_for_status()

    @property
    def moving(self) -> bool:
        """Whether a motor turns now."""
        return bool(self.state()["moving"])


@dataclass
class SmallFlat:
    """A running one. `doors` by camera; `process` is the supervisor of our services, the cameras have their own."""

    folder: Path
    config: Path
    broker: mosquitto.Broker
    process: subprocess.Popen[bytes]
    doors: dict[str, Door]
    urls: dict[str, str]
    ros: ros.Master | None = None
    networks: dict[str, Link] = field(default_factory=dict)
    _broker: ExitStack = field(default_factory=ExitStack)
    _services: ExitStack = field(default_factory=ExitStack)

    @property
    def bus(self) -> BusSettings:
        """Where the broker is, for a client without a name."""
        return BusSettings(port=self.broker.port)

    def pid(self, service: str) -> int:
        """The process of a service, a child of the supervisor."""
        for entry in Path("/proc").glob("[0-9]*"):
            if parent_of(entry) == self.process.pid and service.encode() in words_of(entry):
                return int(entry.name)
        raise LookupError(f"no process of {service}")

    @property
    def processes(self) -> list[int]:
        """The supervisor, its services, and their watchdogs."""
        return family(self.process.pid)

    @contextmanager
    def without_broker(self, how: signal.Signals) -> Iterator[None]:
        """Ends the broker; at the end of the block it is started again, on the same port."""
        os.kill(self.broker.pid, how)
        try:
            yield
        finally:
            self._broker.close()
            self.broker = self._broker.enter_context(broker_of(self.folder, self.doors, self.broker.port))

    def start_services(self) -> None:
        """Starts them, also after they were killed, and waits until every camera is online."""
        self._services.close()
        names = [f"camera-{name}" for name in self.doors] + (["bridge"] if self.ros else [])
        environment = self.ros.env if self.ros else {}
        self.process = self._services.enter_context(_running(self.config, self.folder / "run.log", names, environment))
        with self.client("camera/+/status") as client:
            for name in self.doors:
                client.payload(f"camera/{name}/status", lambda status: status.state == "online", READY_S)

    def table(self, camera: str, name: str) -> dict[str, str]:
        """A table of the camera's configuration, asked for as any client would."""
        auth = httpx.DigestAuth("ros", PASSWORD)
        target = f"{self.urls[camera]}/cgi-bin/configManager.cgi?action=getConfig&name={name}"
        lines = httpx.get(target, auth=auth, timeout=30).raise_for_status().text.splitlines()
        return dict(line.removeprefix("table.").split("=", 1) for line in lines if "=" in line)

    @contextmanager
    def client(self, *filters: str) -> Iterator[Client]:
        """A client that hears these topics."""
        with connected(self.bus, filters) as client:
            yield client


def family(pid: int) -> list[int]:
    """A process and all that it and its children started, itself first."""
    parents = {int(entry.name): parent_of(entry) for entry in Path("/proc").glob("[0-9]*")}
    found = [pid]
    for one in found:  # it grows while we walk through it
        found += [child for child, parent in parents.items() if parent == one]
    return found


def parent_of(entry: Path) -> int:
    """The parent of a process in /proc; 0 when it has ended."""
    try:
        return int((entry / "stat").read_text().rpartition(")")[2].split()[1])
    except (OSError, IndexError):
        return 0


def words_of(entry: Path) -> list[bytes]:
    """The command line of a process in /proc."""
    try:
        return (entry / "cmdline").read_bytes().split(b"\0")
    except OSError:
        return []


@contextmanager
def broker_of(folder: Path, cameras: Iterable[str], port: int = 0) -> Iterator[mosquitto.Broker]:
    """A private mosquitto; who gives no name may do everything."""
    with mosquitto.private(folder / "mosquitto", cameras, port, anonymous=True) as broker:
        yield broker


@contextmanager
def small_flat(
    folder: Path,
    cameras: Iterable[str] = ("ip1",),
    *,
    simulator: Mapping[str, Any] | None = None,
    camera: Mapping[str, Any] | None = None,
    firmware: Mapping[str, str] | None = None,
    networked: bool = False,
    with_ros: bool = False,
) -> Iterator[SmallFlat]:
    """Runs until the end of the block, everybody online. `simulator`, `camera`: settings of all cameras.

    `firmware`: of a camera where it is not the usual one.
    `networked`: with a network between each camera and its service, to be cut. Missing: no mosquitto or ROS.
    """
    doors = {name: Door(f"http://127.0.0.1:{free_port()}") for name in cameras}
    with ExitStack() as stack:
        broker_stack, services = stack.enter_context(ExitStack()), ExitStack()
        broker = broker_stack.enter_context(broker_of(folder, doors))
        master = stack.enter_context(ros.private(folder / "ros")) if with_ros else None
        config = Path(shutil.copytree(CONFIG, folder / "config")) / "small.yaml"
        ports, streams = ({name: free_port() for name in doors} for _ in range(2))
        networks = {
            name: Link(stack.enter_context(network(ports[name])), stack.enter_context(network(streams[name])))
            for name in doors if networked
        }  # fmt: skip
        near = {name: networks[name].web.port if networked else ports[name] for name in doors}
        videos = {name: networks[name].video.port if networked else streams[name] for name in doors}
        sections = {
            "bus": {"port": broker.port},
            "state": str(folder / "state"),
            "home": "home.yaml",
            "cameras": {
                name: {**_camera(name, near[name], folder), "rtsp_port": videos[name], **(camera or {})}
                for name in doors},
            "simulators": {"cameras": {
                name: {**_simulator(ports[name], door), "rtsp_port": streams[name], **(simulator or {}),
                       **({"profile": firmware[name]} if name in (firmware or {}) else {})}
                for name, door in doors.items()}},
            **({"bridge": {"rules": "bridge.yaml"}} if with_ros else {}),
        }  # fmt: skip
        config.write_text(yaml.safe_dump(sections))
        names = [f"simulated-camera-{name}" for name in doors]
        simulators = stack.enter_context(_running(config, folder / "simulators.log", names))
        stack.enter_context(services)
        urls = {name: f"http://127.0.0.1:{port}" for name, port in ports.items()}
        flat = SmallFlat(folder, config, broker, simulators, doors, urls, master, networks, broker_stack, services)
        flat.start_services()
        yield flat


def _simulator(port: int, door: Door) -> dict[str, Any]:
    side = int(door.url.rpartition(":")[2])
    return {"port": port, "side_door_port": side, "user": "ros", "password": PASSWORD}


def _camera(name: str, port: int, folder: Path) -> dict[str, Any]:
    """A camera's section: the simulated apartment's own, at this port, with places of its own."""
    shipped: dict[str, Any] = yaml.safe_load((CONFIG / "simulated.yaml").read_text())["cameras"]["ip1"]
    if name != "ip1":
        shutil.copytree(CONFIG / "ip1", folder / "config" / name)
    return {**shipped, "url": f"http://127.0.0.1:{port}", "password": PASSWORD, "places": name}


@contextmanager
def _running(
    config: Path, log: Path, names: Sequence[str], environment: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "services", "run", *names, "--config", str(config)]
    environment = {"PYTHONPATH": str(CONFIG.parent), **(environment or {})}
    old = log.stat().st_size if log.exists() else 0
    with running(command, log, lambda: b"READY {" in log.read_bytes()[old:], environment) as process:
        yield process


def alive(pid: int) -> bool:
    """Whether a process of that number runs (and is not only waiting to be reaped)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def end_orphans(pids: Iterable[int]) -> None:
    """Waits until processes whose parent was killed have ended by themselves."""
    for pid in pids:
        peers.wait_until(lambda pid=pid: not alive(pid), f"the end of {pid}", 15.0)  # type: ignore[misc]
