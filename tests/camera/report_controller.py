"""The controller of the original report, with its printed faults repaired, as a little program over HTTP.

One regulator after the other: pan, tilt, zoom. Each reads, turns with a speed by the error, and below 7 degrees steps:
start, a short wait, stop, read. Repaired: the way round the dead arc is taken, and a speed is never 0. It shares
nothing with the product. What it is measured against is the bench's business.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import httpx

GAIN = 8 / 45  # of speed by degrees of error: the top speed at 45
NEAR_DEG, STEP_DEG = 0.5, 7.0
SHORT_WAIT_S, WAIT_S = 0.5, 0.2
DEAD_ARC = (179.0, 186.0)
PAN, TILT, ZOOM = range(3)
CODES = {PAN: ("Left", "Right"), TILT: ("Up", "Down"), ZOOM: ("ZoomWide", "ZoomTele")}  # to lower, to higher readings
MOST_STEPS = 200


@dataclass
class ReportController:
    """`wait` passes the time."""

    http: httpx.Client
    wait: Callable[[float], None]
    channel: int = 1
    requests: int = 0

    def go(self, pan: float, tilt: float, zoom: float) -> None:
        """To the goal, one axis after the other."""
        for axis, wanted in ((PAN, pan), (TILT, tilt), (ZOOM, zoom)):
            self._regulate(axis, wanted)

    def _regulate(self, axis: int, wanted: float) -> None:
        running = ""
        for _ in range(MOST_STEPS):
            error = self._error(axis, self._read()[axis], wanted)
            if abs(error) <= (1.0 if axis == ZOOM else NEAR_DEG):
                break
            code = CODES[axis][error > 0]
            if running and (running != code or abs(error) < STEP_DEG):
                self._send("stop", running)
                running = ""
                continue
            self._send("start", code, min(8, max(1, math.floor(GAIN * abs(error)))))
            if abs(error) < STEP_DEG:
                self.wait(SHORT_WAIT_S)
                self._send("stop", code)
            else:
                running = code
                self.wait(WAIT_S)
        if running:
            self._send("stop", running)

    def _error(self, axis: int, here: float, wanted: float) -> float:
        """The shortest signed error; in pan, the other way round where the short one crosses the dead arc."""
        if axis != PAN:
            return wanted - here
        middle = sum(DEAD_ARC) / 2
        return (wanted if wanted <= middle else wanted - 360) - (here if here <= middle else here - 360)

    def _read(self) -> list[float]:
        text = self._get(f"/cgi-bin/ptz.cgi?action=getStatus&channel={self.channel}")
        return [float(value) for value in re.findall(r"status\.Pos(?:t|it)ion\[\d\]=([-\d.]+)", text)]

    def _send(self, action: str, code: str, speed: int = 0) -> None:
        self._get(f"/cgi-bin/ptz.cgi?action={action}&channel={self.channel}&code={code}&arg1=0&arg2={speed}&arg3=0")

    def _get(self, target: str) -> str:
        self.requests += 1
        return self.http.get(target).raise_for_status().text
