"""kill -9 of the ROS master, and of a broker that keeps nothing: whoever comes new to ROS afterwards is served at once.

Existing links prove nothing (they flow on without any remedy), so the public tools are started afresh each time.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
import xmlrpc.client
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from services import peers
from services.client import connected
from services.config import BusSettings
from services.peers import end, mosquitto, ros, wait_until
from tests.bridge.conftest import PATIENCE_S, ROOT
from tests.bridge.test_ros import publishers

pytestmark = [pytest.mark.ros, pytest.mark.mosquitto]
BACK_S = 2.0


@dataclass
class Flat:
    """A broker, a master, and the bridge of the shipped configuration; no camera, no home: the test plays those."""

    folder: Path
    port: int
    master: ros.Master
    broker: ExitStack = field(default_factory=ExitStack)
    broker_pid: int = 0

    def start_broker(self) -> None:
        """On the same port, with nothing of what the one before it knew."""
        shutil.rmtree(self.folder / "mosquitto", ignore_errors=True)
        started = mosquitto.private(self.folder / "mosquitto", port=self.port, anonymous=True)
        self.broker_pid = self.broker.enter_context(started).pid

    def kill_broker(self) -> None:
        """No goodbye, and nothing left of it."""
        os.kill(self.broker_pid, signal.SIGKILL)
        self.broker.close()
        self.start_broker()

    def kill_master(self) -> None:
        """No goodbye either."""
        self.master.kill()
        self.master.start()

    def tool(self, *command: str) -> subprocess.Popen[str]:
        """A fresh tool of ROS."""
        return subprocess.Popen(
            command, env={**os.environ, **self.master.env, "PYTHONUNBUFFERED": "1"}, text=True, stdout=subprocess.PIPE
        )


@contextmanager
def running(folder: Path, master: ros.Master) -> Iterator[Flat]:
    """The bridge as an installation runs it."""
    config = Path(shutil.copytree(ROOT / "config", folder / "config")) / "simulated.yaml"
    flat = Flat(folder, peers.free_port(), master)
    environment = {**os.environ, **master.env, "APARTMENT_BROKER_PORT": str(flat.port), "PYTHONPATH": str(ROOT),
                   "APARTMENT_STATE": str(folder / "state")}  # fmt: skip
    with ExitStack() as stack:
        stack.callback(flat.broker.close)
        flat.start_broker()
        log = stack.enter_context((folder / "bridge.log").open("wb"))
        process = subprocess.Popen(
            [sys.executable, "-m", "services", "serve", "bridge", "--config", str(config)],
            stdout=log, stderr=log, env=environment, cwd=ROOT,
        )  # fmt: skip
        stack.callback(end, process)
        wait_until(lambda: publishers(master, "/iot_updates") == ["/iot_bridge"], "the bridge", PATIENCE_S)
        yield flat


def parameter(master: ros.Master, name: str) -> Any:
    """What the master has under that name."""
    with xmlrpc.client.ServerProxy(master.uri) as proxy:
        return proxy.getParam("/test", name)[2]  # type: ignore[index]


def everything_works(flat: Flat, since: float, kept: dict[str, str], news: tuple[str, str]) -> None:
    """A new echo hears what is kept and then the news, a new word arrives, a service answers."""
    filters = ["home/+/command", "camera/+/snapshot/get", "service/bridge/status"]
    with ExitStack() as stack:
        bus = stack.enter_context(connected(BusSettings(port=flat.port), filters))
        bus.payload("service/bridge/status", lambda text: text == "online", PATIENCE_S)
        wait_until(lambda: publishers(flat.master, "/iot_updates") == ["/iot_bridge"], "registered", PATIENCE_S)
        wait_until(lambda: parameter(flat.master, "/iot_bridge/cameras") == ["ip1"], "its parameters", PATIENCE_S)
        assert time.monotonic() - since < BACK_S, "broker and master know the bridge again"
        echo = stack.enter_context(flat.tool("rostopic", "echo", "-n", f"{len(kept) + 1}", "/iot_updates"))
        word = ("rostopic", "pub", "-1", "/iot_command", "diagnostic_msgs/KeyValue", "{key: Hall_Dimmer, value: '30'}")
        pub = stack.enter_context(flat.tool(*word))
        shot = stack.enter_context(flat.tool("rosservice", "call", "/snapshots_ip_camera"))
        bus.until(lambda message: message.topic == "camera/ip1/snapshot/get", PATIENCE_S)
        bus.say("camera/ip1/snapshot", b"a picture", qos=0)
        bus.until(lambda message: message.payload == b"30", PATIENCE_S)
        assert "success: True" in shot.communicate(timeout=PATIENCE_S)[0]
        assert pub.wait(PATIENCE_S) == 0
        assert echo.stdout
        heard = [echo.stdout.readline() for _ in range(3 * len(kept))]
        bus.say(f"home/{news[0]}/state", news[1])
        texts = [line.split('"')[1] for line in (*heard, *echo.stdout) if '"' in line]
        assert dict(zip(texts[::2], texts[1::2], strict=True)) == {**kept, news[0]: news[1]}


def test_who_comes_new_after_an_accident_is_served(tmp_path: Path, master: ros.Master) -> None:
    with running(tmp_path, master) as flat:
        with connected(BusSettings(port=flat.port), []) as bus:
            bus.say("home/Kitchen_Light/state", "ON", retain=True)
        flat.kill_master()
        everything_works(flat, time.monotonic(), {"Kitchen_Light": "ON"}, ("Front_Door", "OPEN"))
        flat.kill_broker()
        kept = {"Kitchen_Light": "ON", "Front_Door": "OPEN"}
        everything_works(flat, time.monotonic(), kept, ("Kitchen_Plug", "OFF"))
