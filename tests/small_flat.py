"""A small apartment on real parts: mosquitto, cameras that are simulated, and `apartment run`, met only from outside.

Not here: the whole apartment with its database, robot and home, that is `services/simulated.py`.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
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

READY_S = 60.0
PASSWORD = "only-simulated"


@dataclass
class Door:
    """The side door of a simulated camera: what is true, and what goes wrong."""

    url: str

    def state(self) -> dict[str, Any]:
        """The true pose, and whether it moves."""
        answer: dict[str, Any] = httpx.get(f"{self.url}/state").json()
        return answer

    def log(self) -> list[dict[str, Any]]:
        """Every request that the camera met."""
        answer: list[dict[str, Any]] = httpx.get(f"{self.url}/log").json()
        return answer

    def tell(self, path: str, **content: object) -> None:
        """An order of the side door."""
        httpx.post(f"{self.url}/{path}", json=content).raise_for_status()

    @property
    def moving(self) -> bool:
        """Whether a motor turns now."""
        return bool(self.state()["moving"])


@dataclass
class SmallFlat:
    """A running one. `doors` by camera; `process` is the supervisor's."""

    folder: Path
    config: Path
    broker: mosquitto.Broker
    process: subprocess.Popen[bytes]
    doors: dict[str, Door]
    ros: ros.Master | None = None
    parts: ExitStack = field(default_factory=ExitStack)

    @property
    def bus(self) -> BusSettings:
        """Where the broker is, for a client without a name."""
        return BusSettings(port=self.broker.port)

    def pid(self, service: str) -> int:
        """The process of a service, a child of the supervisor."""
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                words = (entry / "cmdline").read_bytes().split(b"\\0")
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, ValueError):
                continue  # it ended meanwhile
            if parent == self.process.pid and service.encode() in words:
                return int(entry.name)
        raise LookupError(f"no process of {service}")

    @contextmanager
    def client(self, *filters: str) -> Iterator[Client]:
        """A client that hears these topics."""
        with connected(self.bus, filters) as client:
            yield client


@contextmanager
def broker_of(folder: Path, cameras: Iterable[str]) -> Iterator[mosquitto.Broker]:
    """A private mosquitto; who gives no name may do everything."""
    with mosquitto.private(folder / "mosquitto", cameras, anonymous=True) as broker:
        yield broker


@contextmanager
def small_flat(
    folder: Path,
    cameras: Iterable[str] = ("ip1",),
    *,
    simulator: Mapping[str, Any] | None = None,
    camera: Mapping[str, Any] | None = None,
    port: int = 0,
    with_ros: bool = False,
) -> Iterator[SmallFlat]:
    """Runs until the end of the block, everybody online. `simulator`, `camera`: settings of all cameras.

    `port`: where the services look for the (only) camera, when that is not where it is. Missing: no mosquitto or ROS.
    """
    cameras = list(cameras)
    with ExitStack() as stack:
        broker_stack = stack.enter_context(ExitStack())
        broker = broker_stack.enter_context(broker_of(folder, cameras))
        master = stack.enter_context(ros.private(folder / "ros")) if with_ros else None
        config = Path(shutil.copytree(CONFIG, folder / "config")) / "small.yaml"
        ports = {name: free_port() for name in cameras}
        doors = {name: free_port() for name in cameras}
        sections = {
            "bus": {"port": broker.port},
            "state": str(folder / "state"),
            "home": "home.yaml",
            "cameras": {name: {**_camera(name, port or ports[name], folder), **(camera or {})} for name in cameras},
            "simulators": {"cameras": {
                name: {"port": ports[name], "side_door_port": doors[name], "user": "ros", "password": PASSWORD,
                       **(simulator or {})} for name in cameras}},
            **({"bridge": {"rules": "bridge.yaml"}} if with_ros else {}),
        }  # fmt: skip
        config.write_text(yaml.safe_dump(sections))
        process = stack.enter_context(_running(config, folder, master.env if master else {}))
        found = {name: Door(f"http://127.0.0.1:{doors[name]}") for name in cameras}
        flat = SmallFlat(folder, config, broker, process, found, master, broker_stack)
        with flat.client("camera/+/status") as client:
            for name in cameras:
                client.payload(f"camera/{name}/status", lambda status: status.state == "online", READY_S)
        yield flat


def _camera(name: str, port: int, folder: Path) -> dict[str, Any]:
    """A camera's section: the simulated apartment's own, at this port, with places of its own."""
    shipped: dict[str, Any] = yaml.safe_load((CONFIG / "simulated.yaml").read_text())["cameras"]["ip1"]
    if name != "ip1":
        shutil.copytree(CONFIG / "ip1", folder / "config" / name)
    return {**shipped, "url": f"http://127.0.0.1:{port}", "password": PASSWORD, "places": name}


@contextmanager
def _running(config: Path, folder: Path, environment: Mapping[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "services", "run", "--config", str(config)]
    log = folder / "run.log"
    path = {"PYTHONPATH": str(CONFIG.parent)}
    with running(command, log, lambda: b"READY {" in log.read_bytes(), {**path, **environment}) as process:
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


def log_of(flat: SmallFlat) -> str:
    """What the services logged."""
    return (flat.folder / "run.log").read_text(errors="replace")
