"""The real RViz on a screen that nobody sees, with the shipped view: floor plan, camera and marker are on it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.client import Client, connected
from services.config import BusSettings
from services.payloads import stamp
from services.peers import end, mosquitto, ros, wait_until
from tests.bridge import patterns
from tests.bridge.test_package import launched
from tests.bridge.test_ros import publishers
from tests.bridge.test_service import RESULT

pytestmark = [pytest.mark.ros, pytest.mark.mosquitto]
SCREEN = (1400, 900)
SLOW_S = 120.0  # OpenGL in software, on a busy machine
MAGENTA = (255, 0, 255)
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


def test_rviz_shows_the_floor_plan_the_cameras_picture_and_the_marker(
    master: ros.Master, mosquitto_broker: mosquitto.Broker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (
        screen(tmp_path, monkeypatch) as framebuffer,
        patterns.stream(5.0, MAGENTA) as stream,
        launched(master, tmp_path, mosquitto_broker, "rviz:=true", "aggregator:=false") as log,
        connected(BusSettings(port=mosquitto_broker.port), []) as bus,
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
