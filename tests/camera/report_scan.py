"""The original report's scan on a simulated camera: places as presets, 4 s of waiting, K frames of RTSP, two turns.

First in black and white with high contrast, then in colour, the places in their given order; frames are looked at in a
second thread, with OpenCV's defaults. The stream is opened at each place, so that no old frame is taken.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from threading import Event
from typing import Any
from urllib.parse import quote

import av
import cv2
import httpx

WAIT_S = 4.0
FRAMES = 8
POLL_S = 0.3
STILL = 0.25  # degrees between two readings
LOOKS = {"bw": ("2", "80"), "color": ("0", "50")}


@dataclass
class ReportScan:
    """One camera at `url` with RTSP at `rtsp_port`; `presets` in the order in which they are visited."""

    url: str
    rtsp_port: int
    user: str
    password: str
    presets: list[int]
    seconds: float = 0.0
    frames: int = 0
    sightings: dict[int, float] = field(
        default_factory=dict
    )  # by marker: when it was first seen, after so many seconds
    _began: float = 0.0

    def run(self) -> None:
        """Both turns."""
        self._began = time.monotonic()
        with httpx.Client(base_url=self.url, auth=httpx.DigestAuth(self.user, self.password), timeout=30) as http:
            with ThreadPoolExecutor(1) as detection:
                for look in LOOKS.values():
                    self._mode(http, *look)
                    for preset in self.presets:
                        self._visit(http, preset)
                        for image in self._grab():
                            self.frames += 1
                            detection.submit(self._detect, image)
            self.seconds = time.monotonic() - self._began

    def _mode(self, http: httpx.Client, colour: str, contrast: str) -> None:
        for pair in (f"VideoInOptions[0].DayNightColor={colour}", f"VideoColor[0][0].Contrast={contrast}"):
            self._get(http, f"/cgi-bin/configManager.cgi?action=setConfig&{pair}")

    def _visit(self, http: httpx.Client, preset: int) -> None:
        self._get(http, f"/cgi-bin/ptz.cgi?action=start&channel=1&code=GotoPreset&arg1=0&arg2={preset}&arg3=0")
        before: list[float] = []
        while True:
            text = self._get(http, "/cgi-bin/ptz.cgi?action=getStatus&channel=1")
            here = [float(line.split("=")[1]) for line in text.splitlines() if "Postion[" in line]
            if before and max(abs(a - b) for a, b in zip(here, before, strict=True)) < STILL:
                break
            before = here
            _pause(POLL_S)
        _pause(WAIT_S)

    def _grab(self) -> list[Any]:
        login = f"{quote(self.user)}:{quote(self.password)}"
        url = f"rtsp://{login}@127.0.0.1:{self.rtsp_port}/cam/realmonitor?channel=1&subtype=0"
        images: list[Any] = []
        with av.open(url, options={"rtsp_transport": "tcp"}, timeout=20) as stream:
            for frame in stream.decode(video=0):
                images.append(frame.to_ndarray(format="bgr24"))
                if len(images) == FRAMES:
                    break
        return images

    def _detect(self, image: Any) -> None:
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000)
        _, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(image)
        for marker in [] if ids is None else ids.ravel():
            self.sightings.setdefault(int(marker), time.monotonic() - self._began)

    def _get(self, http: httpx.Client, target: str) -> str:
        return http.get(target).raise_for_status().text


def _pause(seconds: float) -> None:
    """Waits, as the report's scan does."""
    Event().wait(seconds)
