"""A random flat on real parts: mosquitto, the simulated camera over HTTP and RTSP, the robot on the bus, real time."""

from __future__ import annotations

import os
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

import httpx

from services.client import Client, connected
from services.config import BusSettings
from services.payloads.robot import MissionOrder, MissionResult
from services.peers import free_port, mosquitto, running
from services.topics import CAMERA_STATUS, MISSION_ORDER, MISSION_RESULT, MISSION_STATE, ROBOT_POSE
from tests.mission.flats import CONFIG, SMALL, TARGET, Flat, configured

READY_S = 90.0
LONGEST_S = 600.0
NAMES = ("simulated-camera", "simulated-robot", "camera-ip1", "mission")


@contextmanager
def real(flat: Flat, folder: Path) -> Iterator[Client]:
    """A client of the flat while it runs; peers.Missing where mosquitto is not installed."""
    config, log = configured(flat, folder), folder / "run.log"
    with mosquitto.private(folder / "mosquitto", anonymous=True) as broker:
        ports = {f"APARTMENT_{name}": str(free_port()) for name in ("CAMERA_PORT", "CAMERA_RTSP_PORT")}
        environment = {
            **os.environ, **ports, "APARTMENT_BROKER_PORT": str(broker.port), "PYTHONPATH": str(CONFIG.parent),
            "APARTMENT_STATE": str(folder / "state"),
            **{f"BUS_{name.upper().replace('-', '_')}_PASSWORD": word for name, word in broker.passwords.items()},
        }  # fmt: skip
        command = [sys.executable, "-m", "services", "run", *NAMES, "--config", str(config)]
        with (
            running(command, log, lambda: b"READY {" in log.read_bytes(), environment),
            connected(BusSettings(port=broker.port), ("camera/+/status", "mission/#", "robot/#")) as bus,
        ):
            _make_pictures_small(int(ports["APARTMENT_CAMERA_PORT"]))
            bus.payload(CAMERA_STATUS.name(cam="ip1"), lambda status: status.state == "online", READY_S)
            bus.payload(ROBOT_POSE.name(robot="tiago"), timeout_s=READY_S)
            bus.payload(MISSION_STATE.name(robot="tiago"), lambda state: state.state == "idle", READY_S)
            yield bus


def _make_pictures_small(port: int) -> None:
    """As anybody may who has the camera's password; drawing the large ones takes more than real time leaves."""
    settings = "&".join(f"{quote(name)}={value}" for name, value in SMALL.items())
    url = f"http://127.0.0.1:{port}/cgi-bin/configManager.cgi?action=setConfig&{settings}"
    answer = httpx.get(url, auth=httpx.DigestAuth("ros", "only-simulated"), timeout=READY_S)
    assert answer.text.strip() == "OK", answer.text


def mission(flat: Flat, folder: Path) -> MissionResult:
    """The mission of the flat in real time, with the house's camera; TimeoutError when it has no end."""
    with real(flat, folder) as bus:
        order = MissionOrder(find=TARGET, id=uuid.uuid4().hex[:12])
        bus.publish(MISSION_ORDER.message(order, robot="tiago"))
        result: MissionResult = bus.payload(
            MISSION_RESULT.name(robot="tiago"), lambda end: end.id == order.id, LONGEST_S
        )
        return result
