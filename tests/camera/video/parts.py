"""What the tests of the video share: the RTSP camera as a process, and reading the time out of its pictures."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import SecretStr

from services.camera.address import Address

USER, PASSWORD = "ros", "p@ss/w:rd#1+"
BLOCK, ROWS = 22, 64


@dataclass
class RtspCamera:
    """A running one."""

    process: subprocess.Popen[str]
    port: int

    @property
    def url(self) -> str:
        return f"rtsp://127.0.0.1:{self.port}/cam/realmonitor?channel=1&subtype=1"

    def tell(self, command: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(command + "\n")
        self.process.stdin.flush()

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()


@contextmanager
def rtsp_camera(port: int = 0, password: str = PASSWORD) -> Iterator[RtspCamera]:
    """Skips where GStreamer's RTSP server is missing."""
    if find_spec("gi") is None:
        pytest.skip("apt-get install python3-gi gir1.2-gst-rtsp-server-1.0 gstreamer1.0-plugins-ugly")
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.camera.video.rtsp_camera", str(port), USER, password],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line.strip():
        process.communicate()
        pytest.skip("apt-get install python3-gi gir1.2-gst-rtsp-server-1.0 gstreamer1.0-plugins-ugly")
    camera = RtspCamera(process, int(line))
    try:
        yield camera
    finally:
        camera.kill()


def address(*, url: str = "http://127.0.0.1:9", password: str = PASSWORD) -> Address:
    return Address(url, USER, SecretStr(password))


def time_in(image: NDArray[np.uint8], near: float) -> float:
    """The time at which a picture of the RTSP camera was exposed; `near`: about now, seconds since 1970."""
    grey = image[ROWS // 4 : ROWS // 2].mean(axis=(0, 2))
    bits = [int(grey[index * BLOCK + 6 : (index + 1) * BLOCK - 6].mean() > 125) for index in range(32)]
    coded = int("".join(map(str, bits)), 2)
    turns = round((near * 1000 - coded) / 2**32)
    return (coded + turns * 2**32) / 1000
