"""A machine without GStreamer's Python binding: the simulated camera says so, and has its MJPEG stream all the same."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest

from services.simulators.camera import Config

PROGRAM = """
import json, sys
from services.simulators.camera import Config, start
with start(Config.model_validate(json.loads(sys.argv[1]))) as camera:
    print(json.dumps(camera.addresses), flush=True)
    sys.stdin.read()
"""
HIDDEN = """raise ModuleNotFoundError("No module named 'gi'", name="gi")"""
MJPEG = "/cgi-bin/mjpg/video.cgi?channel=1&subtype=1"


@contextmanager
def _camera(config: Config, path: list[Path], said: Path) -> Iterator[dict[str, Any]]:
    """The addresses of a camera in a process of its own, which looks for modules in this path first."""
    settings = {**config.model_dump(mode="json", exclude={"switches"}), "password": "secret123"}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, [*path, *sys.path]))}
    command = [sys.executable, "-c", PROGRAM, json.dumps(settings)]
    with said.open("w") as errors, subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
    ) as process:  # fmt: skip
        assert process.stdin is not None
        assert process.stdout is not None
        line = process.stdout.readline()
        yield json.loads(line or "{}")
        process.stdin.close()
        assert process.wait(20) == 0


def _picture(url: str) -> np.ndarray:
    """The first picture of the MJPEG stream."""
    data = b""
    auth = httpx.DigestAuth("ros", "secret123")
    with httpx.Client(auth=auth, timeout=20) as client, client.stream("GET", url + MJPEG) as stream:
        assert stream.headers["content-type"].startswith("multipart/x-mixed-replace")
        for chunk in stream.iter_raw():
            data += chunk
            if b"\xff\xd9" in data:
                break
    jpeg = data[data.index(b"\xff\xd8") : data.index(b"\xff\xd9") + 2]
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR))


def test_without_gstreamer_it_says_so_and_offers_mjpeg(config: Config, tmp_path: Path) -> None:
    (tmp_path / "gi.py").write_text(HIDDEN)
    with _camera(config, [tmp_path], tmp_path / "said.txt") as addresses:
        assert set(addresses) == {"url", "port", "side_door_port"}
        picture = _picture(addresses["url"])
    assert picture.shape == (396, 704, 3)
    assert picture.std() > 10
    said = (tmp_path / "said.txt").read_text()
    assert "no RTSP, only MJPEG: No module named 'gi'; apt-get install python3-gi" in said


@pytest.mark.rtsp
def test_with_it_the_same_camera_has_rtsp_and_complains_of_nothing(config: Config, tmp_path: Path) -> None:
    pytest.importorskip("gi", reason="apt-get install python3-gi gir1.2-gst-rtsp-server-1.0")
    with _camera(config, [], tmp_path / "said.txt") as addresses:
        assert addresses["rtsp_port"]
    assert "no RTSP" not in (tmp_path / "said.txt").read_text()
