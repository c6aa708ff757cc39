"""The whole apartment for chaos and rubbish: every service of it on real parts, and a hand on all that can go wrong.

Each service reaches the broker by a relay of its own and has a clock of its own (libfaketime, where it is installed);
database and camera are behind relays too. All files lie on one small disk of its own where root may mount it.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from services.client import connected
from services.config import BusSettings, load
from services.peers import Missing, mariadb
from services.simulated import CONFIG, Parts, Simulated, parts_of, start_mosquitto
from services.supervisor import READY_S, Supervisor, commands, in_background, processes
from tests.network import Network, network
from tests.small_flat import Door

FAKETIME = next(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"), None)
CLOCKED = Path(__file__).parent / "clocked"  # what Python wants for that
DISK_MB = 700
NUMBERED = [f"Chaos{number}" for number in range(20)]  # items that carry consecutive numbers
PIECE = b"x" * (1 << 20)


@dataclass
class Whole:
    """The running apartment and its weak points."""

    flat: Simulated
    door: Door
    broker: dict[str, Network]  # the way to the broker, by service
    database: Network
    camera: Network
    disk: Path | None  # where the ballast goes; None: no small disk here
    clocks: Path | None
    _server: ExitStack = field(default_factory=ExitStack)

    @property
    def parts(self) -> Parts:
        """Its peers."""
        return self.flat.parts

    @property
    def bus(self) -> BusSettings:
        """Where the broker is, for a client without a name, who may say and hear everything."""
        return BusSettings(port=self.parts.broker_port)

    @property
    def services(self) -> list[str]:
        """Their names."""
        return list(self.flat.supervisor.children)

    def pid(self, name: str) -> int | None:
        """The process of a service; None while there is none."""
        process = self.flat.supervisor.children[name].process
        return process.pid if process else None

    def kill(self, name: str) -> None:
        """kill -9, if it runs."""
        if (pid := self.pid(name)) is not None:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def stop_broker(self) -> None:
        """As the system does it: it saves what it holds."""
        self.parts.broker.close()

    def start_broker(self) -> None:
        """With its sessions and retained messages, on the same port."""
        start_mosquitto(self.parts)

    def stop_database(self, how: signal.Signals) -> None:
        """By SIGTERM or SIGKILL."""
        assert self.parts.database is not None
        os.kill(self.parts.database.pid, how)
        self._server.close()
        wait_for_end(self.parts.database.pid)

    def start_database(self) -> None:
        """On the same files, and with the same port and accounts."""
        self.parts.database = self._server.enter_context(mariadb.private(self.parts.folder / "mariadb"))

    def set_clock(self, name: str, seconds: float) -> None:
        """One process believes that it is so much later from the next look on, within a second."""
        assert self.clocks is not None
        beside = self.clocks / f".{name}"
        beside.write_text(f"{seconds:+.0f}\n")
        beside.replace(self.clocks / name)

    def fill_disk(self) -> None:
        """Until nothing more fits."""
        assert self.disk is not None
        with suppress(OSError), (self.disk / "ballast").open("wb", buffering=0) as ballast:
            for piece in (PIECE, b"x" * 4096, b"x"):
                with suppress(OSError):
                    while ballast.write(piece) == len(piece):
                        pass

    def free_disk(self) -> None:
        """As before."""
        assert self.disk is not None
        (self.disk / "ballast").unlink(missing_ok=True)

    def close(self) -> None:
        """Ends what this class has started itself."""
        self._server.close()


def wait_for_end(pid: int) -> None:
    """Until a child of ours is gone; `peers.running` collects it later."""
    with suppress(ChildProcessError):
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)


@contextmanager
def small_disk(folder: Path) -> Iterator[Path | None]:
    """A disk of `DISK_MB` mounted there; None where we may not."""
    folder.mkdir(parents=True)
    mounted = (
        os.geteuid() == 0
        and not subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m", "chaos", str(folder)], capture_output=True, check=False
        ).returncode
    )
    try:
        yield folder if mounted else None
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(folder)], check=True)


@contextmanager
def whole(folder: Path, *, clocks: bool = False) -> Iterator[Whole]:
    """All of it running; Missing where a part is not installed. `clocks`: each service has one that can be set."""
    with ExitStack() as stack:
        disk = stack.enter_context(small_disk(folder / "disk"))
        parts = stack.enter_context(parts_of(folder / "disk" / "parts", real=True))
        if missing := [text for _, _, text in parts.used if text]:
            raise Missing("; ".join(missing))
        assert parts.database is not None
        server = parts.database
        database = stack.enter_context(network(server.port))
        camera = stack.enter_context(network(int(parts.environment["APARTMENT_CAMERA_PORT"])))
        parts.environment["APARTMENT_DATABASE"] = server.tcp_url.replace(f":{server.port}/", f":{database.port}/")
        config = _configured(folder / "disk" / "config", camera.port)
        apartment = load(config, environment={**os.environ, **parts.environment})
        set_by = folder / "clocks" if clocks and FAKETIME else None
        relays, lines = {}, {}
        for name, line in commands(processes(apartment, list(apartment.instances)), config).items():
            relays[name] = stack.enter_context(network(parts.broker_port))
            lines[name] = ["env", f"APARTMENT_BROKER_PORT={relays[name].port}", *_clock(set_by, name), *line]
        supervisor = Supervisor(lines, parts.environment, folder / "services.log")
        ready = stack.enter_context(in_background(supervisor))
        flat = Simulated(folder, config, apartment, parts, supervisor, ready)
        door = Door(f"http://127.0.0.1:{parts.environment['APARTMENT_SIDE_DOOR_PORT']}")
        made = Whole(flat, door, relays, database, camera, disk, set_by)
        stack.callback(made.close)
        with connected(BusSettings(port=parts.broker_port), ["camera/ip1/status"]) as client:
            client.payload("camera/ip1/status", lambda status: status.state == "online", READY_S)
        yield made


def _clock(folder: Path | None, name: str) -> list[str]:
    """What gives a process a wall clock that a file sets; timers and waits keep the machine's."""
    if folder is None:
        return []
    folder.mkdir(exist_ok=True)
    (folder / name).write_text("+0\n")
    return [
        f"LD_PRELOAD={FAKETIME}",
        f"FAKETIME_TIMESTAMP_FILE={folder / name}",
        "FAKETIME_DONT_FAKE_MONOTONIC=1",
        "FAKETIME_CACHE_DURATION=1",
        f"PYTHONPATH={CLOCKED}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
    ]


def _configured(folder: Path, camera_port: int) -> Path:
    """The simulated apartment, the camera behind its relay, with hubs, metrics, and the items that are counted."""
    shutil.copytree(CONFIG, folder)
    file = folder / "simulated.yaml"
    text = file.read_text(encoding="utf-8").replace(
        "url: http://127.0.0.1:${APARTMENT_CAMERA_PORT:-8941}", f"url: http://127.0.0.1:{camera_port}"
    )
    content = yaml.safe_load(text)
    for account in ("hubs", "metrics"):
        content["bus"]["accounts"][account] = f"${{BUS_{account.upper()}_PASSWORD:-}}"
    content["bus"]["keepalive_s"] = 5
    content["cameras"]["ip1"]["login_retry_s"] = 5
    content["simulators"]["camera"]["switches"] = {"boot_s": 4.0}
    content["hubs"] = {"homie": True, "home_service": "simulated-home"}
    content["metrics"] = {"port": 0}
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    home = folder / "home.yaml"
    items = "".join(f"  {name}: {{type: Number, label: {name}, persist: [everyUpdate]}}\n" for name in NUMBERED)
    home.write_text(home.read_text(encoding="utf-8").rstrip() + "\n" + items, encoding="utf-8")
    return file
