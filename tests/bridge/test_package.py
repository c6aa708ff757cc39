"""The ROS package as people of ROS use it: found by ROS_PACKAGE_PATH, started by roslaunch, read by the real tools."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml

from services.client import connected
from services.config import BusSettings
from services.home import Home
from services.peers import end, mosquitto, ros, wait_until
from tests.bridge.conftest import PATIENCE_S, ROOT
from tests.bridge.test_pictures import Ear, listening

pytestmark = [pytest.mark.ros, pytest.mark.mosquitto]
PACKAGE = ROOT / "ros" / "smart_apartment"
AGGREGATED = "/diagnostics_agg=diagnostic_msgs/DiagnosticArray"
OK, STALE = 0, 3


@contextmanager
def launched(master: ros.Master, folder: Path, broker: mosquitto.Broker, *arguments: str) -> Iterator[Path]:
    """`roslaunch smart_apartment apartment.launch` on a copy of the shipped configuration; yields its log."""
    if not shutil.which("roslaunch") or not Path("/usr/share/diagnostic_aggregator/package.xml").exists():
        pytest.skip("apt-get install python3-roslaunch libdiagnostic-aggregator-tools libdiagnostic-aggregator-dev")
    config = Path(shutil.copytree(ROOT / "config", folder / "config")) / "simulated.yaml"
    program = folder / "apartment"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m services "$@"\n')
    program.chmod(0o755)
    environment = {
        **os.environ, **master.env, "APARTMENT": str(program), "PYTHONPATH": str(ROOT),
        "ROS_PACKAGE_PATH": f"{ROOT / 'ros'}:/usr/share", "APARTMENT_BROKER_PORT": str(broker.port),
        "APARTMENT_STATE": str(folder / "state"),
    }  # fmt: skip
    log = folder / "launch.log"
    with log.open("wb") as output:
        process = subprocess.Popen(
            ["roslaunch", "smart_apartment", "apartment.launch", f"config:={config}", *arguments],
            env=environment, stdout=output, stderr=output,
        )  # fmt: skip
    try:
        yield log
    finally:
        end(process, grace_s=20.0)


def levels(ear: Ear) -> dict[str, int]:
    """The newest tree, by path."""
    newest = ear.of(AGGREGATED)[-1:]
    return dict(newest[0]["levels"]) if newest else {}


def test_the_launch_file_starts_the_bridge_and_the_real_aggregator_shows_the_tree(
    master: ros.Master, mosquitto_broker: mosquitto.Broker, tmp_path: Path
) -> None:
    with (
        launched(master, tmp_path, mosquitto_broker) as log,
        connected(BusSettings(port=mosquitto_broker.port), ["diagnostics/bridge"]) as bus,
        listening(master, AGGREGATED) as ear,
    ):

        def says(component: str, level: int) -> None:
            bus.say(f"diagnostics/{component}", json.dumps({"level": level, "message": "as told"}))

        def until(path: str, level: int, *alive: str) -> None:
            def shown() -> bool:
                for component in alive:
                    says(component, OK)
                return levels(ear).get(path) == level

            try:
                wait_until(shown, f"{path} at {level}", 2 * PATIENCE_S)
            except TimeoutError as error:
                raise AssertionError(f"{levels(ear)}\n{log.read_text()[-3000:]}") from error

        until("/Apartment/Cameras/camera: ip1", OK, "camera/ip1", "persistence")
        bus.say("home/Kitchen_Light/state", "ON")
        until("/Apartment/Home/Kitchen/Kitchen_Light", OK)
        assert levels(ear)["/Apartment/Bus/bridge: health"] == OK
        until("/Apartment/Cameras/camera: ip1", STALE, "persistence")  # it says nothing any more
        assert levels(ear)["/Apartment/Cameras"] == STALE
        assert levels(ear)["/Apartment/Persistence/persistence: health"] == OK


def test_every_room_of_the_home_has_its_branch_in_the_tree() -> None:
    analyzers: Any = yaml.safe_load((PACKAGE / "config" / "analyzers.yaml").read_text())["analyzers"]
    home = Home.model_validate(yaml.safe_load((ROOT / "config" / "home.yaml").read_text()))
    prefixes = {one["startswith"] for one in analyzers["home"]["analyzers"].values()}
    assert {f"home {room}: " for room in (*home.rooms, "outside")} <= prefixes
