"""The ROS package as people of ROS use it: found by ROS_PACKAGE_PATH, started by roslaunch, read by the real tools.

RViz has a screen that nobody sees; what is on it is in a file.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from services.apartment.home import Home
from services.client import Client, connected
from services.config import BusSettings
from services.payloads import stamp
from services.peers import end, mosquitto, ros, wait_until
from tests.bridge import patterns
from tests.bridge.conftest import ROOT
from tests.bridge.test_pictures import Ear, listening
from tests.bridge.test_ros import publishers
from tests.bridge.test_service import RESULT

pytestmark = [pytest.mark.ros, pytest.mark.mosquitto]
SCREEN = (1400, 900)
SLOW_S = 120.0  # OpenGL in software, on a busy machine
MAGENTA = (255, 0, 255)
PACKAGE = ROOT / "ros" / "smart_apartment"
AGGREGATED = "/diagnostics_agg=diagnostic_msgs/DiagnosticArray"
OK, STALE = 0, 3
Pixels = NDArray[np.uint8]


@contextmanager
def screen(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An X server without a monitor; yields the file in which its picture is."""
    if not shutil.which("Xvfb") or not shutil.which("rviz"):
        pytest.skip("apt-get install rviz xvfb")
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", f"{SCREEN[0]}x{SCREEN[1]}x24", "-nolisten", "tcp",
               "-fbdir", str(folder)]  # fmt: skip
    process = subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL)
    os.close(writing)
    with os.fdopen(reading) as told:
        monkeypatch.setenv("DISPLAY", f":{told.readline().strip()}")
    try:
        yield folder / "Xvfb_screen0"
    finally:
        end(process)


def seen(framebuffer: Path) -> Pixels:
    """The screen as BGR; the file is in the format of xwd: a head whose length is its first word, then the pixels."""
    data = framebuffer.read_bytes()
    head, colours = int.from_bytes(data[:4], "big"), int.from_bytes(data[76:80], "big")
    pixels = np.frombuffer(data, np.uint8, SCREEN[0] * SCREEN[1] * 4, head + 12 * colours)
    return pixels.reshape(SCREEN[1], SCREEN[0], 4)[:, :, :3].copy()


def near(picture: Pixels, colour: tuple[int, int, int], by: int = 30) -> int:
    """How many pixels have about that colour."""
    return int(np.sum(np.all(abs(picture.astype(int) - colour) <= by, axis=2)))


def furnish(bus: Client, stream: patterns.Stream) -> None:
    """A camera that looks somewhere, shows magenta, and has found a marker."""
    for topic, said in (
        ("stream", {"rtsp": True, "mjpeg": False, "url": stream.url}),
        ("position", {"pan": 20.0, "tilt": 50.0, "zoom": 0.0}),
        ("marker/582", {**RESULT, "position": {"x": 3.9, "y": 4.52, "z": 0.46}}),
        ("scan/result", {**RESULT, "position": {"x": 3.9, "y": 4.52, "z": 0.46}, "stamp": stamp(time.time())}),
    ):
        bus.say(f"camera/ip1/{topic}", json.dumps(said))


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


class Tree:
    """The tree of the real aggregator, while some components say that they are well."""

    def __init__(self, ear: Ear, bus: Client) -> None:
        self.ear, self.bus = ear, bus

    def level(self, path: str) -> int | None:
        """The newest of a branch or leaf."""
        newest = self.ear.of(AGGREGATED)[-1:]
        return newest[0]["levels"].get(path) if newest else None

    def until(self, path: str, level: int, *alive: str) -> None:
        """Waits until a path has a level."""

        def shown() -> bool:
            for component in alive:
                self.bus.say(f"diagnostics/{component}", json.dumps({"level": OK, "message": "as told"}))
            return self.level(path) == level

        wait_until(shown, f"{path} at {level}", SLOW_S)


def a_tree_is_shown(tree: Tree) -> None:
    """The home by room, cameras, bus, database; and who says nothing any more turns stale, and its branch with it."""
    tree.until("/Apartment/Cameras/camera: ip1", OK, "camera/ip1", "persistence")
    tree.bus.say("home/Kitchen_Light/state", "ON")
    tree.until("/Apartment/Home/Kitchen/Kitchen_Light", OK, "camera/ip1", "persistence")
    tree.until("/Apartment/Bus/bridge: health", OK, "camera/ip1", "persistence")
    tree.until("/Apartment/Cameras/camera: ip1", STALE, "persistence")
    assert tree.level("/Apartment/Cameras") == STALE
    assert tree.level("/Apartment/Persistence/persistence: health") == OK


def test_the_launch_file_brings_the_tree_of_health_and_a_view_of_plan_picture_and_marker(
    master: ros.Master, mosquitto_broker: mosquitto.Broker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """RViz stays: without a graphics card about one start in 25 on a busy machine ends in Mesa's software renderer
    (`free(): invalid next size` in swrast_dri.so, below rviz::ImageDisplay::update)."""
    with (
        screen(tmp_path, monkeypatch) as framebuffer,
        patterns.stream(5.0, MAGENTA) as stream,
        launched(master, tmp_path, mosquitto_broker, "rviz:=true", "rviz_stays:=true") as log,
        connected(BusSettings(port=mosquitto_broker.port), []) as bus,
        listening(master, AGGREGATED) as ear,
    ):
        wait_until(lambda: publishers(master, "/map") == ["/iot_bridge_pictures"], "the bridge", SLOW_S)

        def complete() -> bool:
            furnish(bus, stream)
            picture = seen(framebuffer)
            cv2.imwrite(str(tmp_path / "rviz.png"), picture)
            return near(picture, MAGENTA) > 3000 and near(picture, (205, 205, 205), 60) > 30_000

        try:
            wait_until(complete, "floor plan and picture on the screen", SLOW_S)
        except TimeoutError as error:
            raise AssertionError(log.read_text()[-3000:]) from error
        a_tree_is_shown(Tree(ear, bus))


def test_every_room_of_the_home_has_its_branch_in_the_tree() -> None:
    analyzers: Any = yaml.safe_load((PACKAGE / "config" / "analyzers.yaml").read_text())["analyzers"]
    home = Home.model_validate(yaml.safe_load((ROOT / "config" / "home.yaml").read_text()))
    prefixes = {one["startswith"] for one in analyzers["home"]["analyzers"].values()}
    assert {f"home {room}: " for room in (*home.rooms, "outside")} <= prefixes
