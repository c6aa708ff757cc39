"""Scans of the simulated camera in virtual time, with its moving picture, and the report's scan reckoned beside them.

Virtual time keeps every frame rate, so what is compared here holds on any machine. The same with a real stream, real
threads and the report's scan itself is in `scan_figures.py`.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from services.bus import Message
from services.camera.scan.analysis import Analysed, Task
from services.camera.scan.search import Scan
from services.camera.service import CameraService
from services.payloads import OrderResult, ScanResult, ScanState
from services.simulators.camera.config_tables import Tables
from services.simulators.camera.motors import Pose
from services.simulators.camera.program import Inside
from services.topics import read
from services.virtual import VirtualApartment
from services.vision.detect import Detection
from tests.camera.goals import constants
from tests.camera.least_time import ScanBound, least_scan, least_time

CONFIG = Path(__file__).parents[3] / "config"
FRAMES, FPS, SWITCH_S = 8, 10.0, 1.5
REPORT_WAIT_S, REPORT_POLL_S = 4.0, 0.3
STREAM_OPENS_S, CONTROL_S = 1.0, 0.3  # as the simulator has them, in the middle; without the picture's own delay
LOOKS = ("VideoInOptions", "VideoInDayNight", "VideoColor")
HIGH = {"DayNightColor": "2", "].Mode": "BlackWhite", "Contrast": "80"}  # as a scan's second turn leaves the picture
SEES_DEG = 25.0
SMALL = (1152, 648)  # of the camera's large stream: a quarter of the work to draw it


@dataclass
class VirtualScan:
    """A virtual apartment, its camera's inside, and the scans that it has made."""

    flat: VirtualApartment
    service: CameraService
    inside: Inside

    @property
    def places(self) -> dict[str, Pose]:
        """Where the places look."""
        return {name: Pose(one.pan, one.tilt, 0.0) for name, one in self.service.places.named.items()}

    def least(self, *, turns: int) -> ScanBound:
        """What a scan needs at least from where the camera stands."""
        here = tuple(self.inside.device.motion(self.flat.now)[0])[:2]
        goals = [tuple(place) for place in self.places.values()]
        limits = constants(self.inside.device.profile)
        return least_scan((*here, 0.0), goals, limits, turns=turns, frames=FRAMES, fps=FPS, switch_s=SWITCH_S)

    def sees(self, markers: dict[int, tuple[float, float]]) -> None:
        """From now on nothing is drawn: a frame shows the markers whose pan and tilt are near to where it looks."""
        self.inside.pictures.frame = lambda stream, at: np.zeros((72, 128, 3), np.uint8)  # type: ignore[method-assign]
        self.service.scanner.analyst = lambda: Seer(self, markers)

    def begin(self, value: str) -> Scan:
        """Orders a scan and lets it begin."""
        self.flat.client.forget()
        self.flat.client.say("camera/ip1/order/Scan", value)
        assert self.flat.until(lambda: self.service.scanner.scan is not None, 5.0)
        scan = self.service.scanner.scan
        assert scan is not None
        return scan

    def run(self, value: str, each: Callable[[Scan], None] = lambda scan: None) -> tuple[Scan, float, ScanState]:
        """A scan to its end: itself, how long it took, and its last state; `each` is called again and again."""
        began = self.flat.now
        scan = self.begin(value)

        def over() -> bool:
            each(scan)
            return self.service.scanner.scan is not scan

        assert self.flat.until(over, 600.0)
        seconds = self.flat.now - began
        self.flat.until(lambda: False, 3.0)
        return scan, seconds, self.states()[-1]

    def states(self) -> list[ScanState]:
        """The states of scans that were said since the last order."""
        said = [one for one in self._said() if one.topic == "camera/ip1/scan/state"]
        return [read(one, self.flat.now).payload for one in said]

    def answers(self) -> list[OrderResult]:
        """What was said of orders since then."""
        said = [one for one in self._said() if one.topic == "camera/ip1/order_result"]
        return [read(one, self.flat.now).payload for one in said]

    def _said(self) -> list[Message]:
        while self.flat.client.pump():
            pass
        return self.flat.client.seen

    def results(self) -> list[ScanResult]:
        """The results that were said since the last order."""
        said = [one for one in self._said() if one.topic == "camera/ip1/scan/result"]
        return [read(one, self.flat.now).payload for one in said]

    def report(self) -> tuple[float, dict[str, float]]:
        """The report's scan from here, reckoned: all of it, and by place when its first frames are there, seconds."""
        limits, here = constants(self.inside.device.profile), tuple(self.inside.device.motion(self.flat.now)[0])
        now, seen = 0.0, {}
        for _ in range(2):
            now += 2 * CONTROL_S  # the picture's mode and its contrast
            for name, place in self.places.items():
                drive = least_time((here[0], here[1], 0.0), tuple(place), limits)
                looks = max(2, int((drive - CONTROL_S) / (CONTROL_S + REPORT_POLL_S)) + 3)
                now += CONTROL_S + looks * CONTROL_S + (looks - 1) * REPORT_POLL_S  # until two readings are the same
                now += REPORT_WAIT_S + STREAM_OPENS_S
                seen.setdefault(name, now)
                now += FRAMES / FPS
                here = tuple(place)
        return now, seen


def how_it_looks(tables: Tables) -> dict[str, str]:
    """All that the camera keeps of how its picture looks, by key."""
    lines = [line for name in LOOKS for line in tables.read(name) or ()]
    return dict(line.removeprefix("table.").split("=", 1) for line in lines)


@dataclass
class Seer:
    """An Analyst that knows where the markers are, and looks at no pixel; each frame counts once."""

    trial: VirtualScan
    markers: dict[int, tuple[float, float]]
    numbers: list[int] = field(default_factory=list)
    fails: Callable[[int], str] = lambda number: ""

    def submit(self, task: Task) -> None:
        scan = self.trial.service.scanner.scan
        assert scan is not None
        self.numbers.append(task.number)
        here = scan.findings.taken[task.number].reading
        found = [
            Detection(marker, np.array([[60, 30], [70, 30], [70, 40], [60, 40]], float), 0.9)
            for marker, (pan, tilt) in self.markers.items()
            if abs((here.pan - pan + 180) % 360 - 180) < SEES_DEG and abs(here.tilt - tilt) < SEES_DEG
        ]
        error = self.fails(task.number)
        answer = Analysed(task.scan, task.number, (128, 72), () if error else tuple(found), error=error)
        self.trial.service.scanner.take(answer)

    def close(self) -> None:
        """Nothing waits."""


@contextmanager
def virtual_scan(
    folder: Path,
    *,
    world: Callable[[dict[str, Any]], None] = lambda world: None,
    note: str = "",
    firmware: str = "ip3m-941w-2019",
    **camera: Any,
) -> Iterator[VirtualScan]:
    """The simulated apartment with K = 8; `world` may change what stands in it, `camera` the camera's section.

    `note`: what a service left behind that was killed while the picture was changed; the camera is as it left it.
    """
    config = Path(shutil.copytree(CONFIG, folder / "config"))
    apartment = yaml.safe_load((config / "simulated.yaml").read_text())
    apartment["cameras"]["ip1"] |= {"frames": FRAMES, **camera}
    apartment["simulators"]["camera"]["profile"] = firmware
    apartment.pop("persistence"), apartment.pop("bridge")
    (config / "simulated.yaml").write_text(yaml.safe_dump(apartment))
    changed = yaml.safe_load((config / "world.yaml").read_text())
    world(changed)
    (config / "world.yaml").write_text(yaml.safe_dump(changed))
    if note:
        (folder / "state" / "cameras").mkdir(parents=True)
        (folder / "state" / "cameras" / "ip1-picture.json").write_text(note, encoding="utf-8")
    apart = VirtualApartment(config / "simulated.yaml", {"APARTMENT_STATE": str(folder / "state")})
    if note:
        tables = apart.insides["ip1"].device.tables
        written = {key: high for key in how_it_looks(tables) for end, high in HIGH.items() if key.endswith(end)}
        tables.write(written.items())
    with apart as flat:
        service = next(one.service for one in flat.runners if isinstance(one.service, CameraService))
        inside = flat.insides["ip1"]
        video = "Encode[0].MainFormat[0].Video."
        inside.device.tables.write([(f"{video}Width", str(SMALL[0])), (f"{video}Height", str(SMALL[1]))])
        flat.until(lambda: False, 3.0)
        yield VirtualScan(flat, service, inside)
