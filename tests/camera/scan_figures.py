"""The rows of `make bench` about scans: ours and the report's on one simulated camera with its real stream, real time.

The least time is reckoned from the camera's true speeds (`least_time.py`); how much of its frame rate the simulator
kept is told beside each figure, since a machine that cannot draw the pictures in time measures itself.
"""

from __future__ import annotations

import json
import random
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import mean, median
from typing import Any

import yaml
from rich.table import Table

from services.bus import Message
from services.client import Client
from services.payloads import ScanState
from services.simulators.camera.firmwares import PROFILES
from services.topics import read
from tests import bounds
from tests.camera.goals import constants
from tests.camera.least_time import least_scan
from tests.camera.report_scan import FRAMES, ReportScan
from tests.camera.stands import looked_at
from tests.small_flat import CONFIG, PASSWORD, SmallFlat, small_flat

SWITCH_S = 1.5  # the simulator exposes anew for so long
FPS = 10.0
FEW = 4  # frames at each place of a search, as is the default
ENOUGH = 0.8  # of its frame rate, or the figure does not count
FIRST = 601  # id of the first of the markers at random places
SIZE_M = 0.18
SEED = 1
AGAIN = 4  # scans after the cold one; the middle one of all is told too
SIGHTINGS = 3  # searches for the markers, each from where the report's scan began
LIMIT_S = 400.0
OPENING_S = 1.5  # until the stream is there, no frame is drawn


@dataclass
class ScanRow:
    """One scan, ours or the report's; `kept`: the share of its frame rate that the simulator kept."""

    name: str
    seconds: float
    frames: int
    kept: float | None
    least: float | None = None
    report: float | None = None
    where: str = ""

    @property
    def over_least(self) -> float | None:
        """Its time over the least."""
        return None if self.least is None else self.seconds / self.least

    @property
    def counts(self) -> bool:
        """Whether the simulator was quick enough."""
        return self.kept is None or self.kept >= ENOUGH


@dataclass
class Sighted:
    """When each marker was first seen, seconds after the start: ours (the mean over searches), and the report's."""

    ours: dict[int, float]
    report: dict[int, float]
    kept: float

    @property
    def share(self) -> float:
        """Ours of the report's, over the markers that both saw in their first turn."""
        both = self.ours.keys() & self.report.keys()
        if not both:
            return float("nan")
        return mean(self.ours[one] for one in both) / mean(self.report[one] for one in both)


@dataclass
class Compared:
    """All figures of one run."""

    rows: list[ScanRow] = field(default_factory=list)
    sighted: Sighted | None = None


def rows(seed: int = SEED) -> Compared:
    """The report's scan, then ours from a cold start and again, then ours until each of many markers was seen."""
    found = Compared()
    with tempfile.TemporaryDirectory() as name, flat_with_markers(Path(name), seed) as flat:
        begins = flat.doors["ip1"].state()["pose"]
        report = report_scan(flat)
        found.rows.append(ScanRow("the report's", report.seconds, report.frames, None))
        for which in ["ours, cold", *["ours, again"] * AGAIN]:
            least = least_seconds(flat)
            with watched(flat) as share, looked_at(flat.doors["ip1"]) as stands:
                state, seconds = scanned(flat, {"full": True})
            row = ScanRow(which, seconds, state.frames_analysed, share[0], least, report.seconds, str(stands))
            found.rows.append(row)
        searches, kept = [], []
        for _ in range(SIGHTINGS):
            put(flat, begins)
            with watched(flat) as share:
                searches.append(first_sightings(flat))
            kept.append(share[0])
        ours = {one: mean(seen[one] for seen in searches if one in seen) for one in set().union(*searches)}
        first_turn = {marker: at for marker, at in report.sightings.items() if at < report.seconds / 2}
        found.sighted = Sighted(ours, first_turn, min(kept))
    return found


@contextmanager
def flat_with_markers(folder: Path, seed: int) -> Iterator[SmallFlat]:
    """The apartment with a marker more near each of the camera's places."""
    world = yaml.safe_load((CONFIG / "world.yaml").read_text())
    rng = random.Random(seed)
    for number, (place, about) in enumerate(world["cameras"]["ip1"]["places"].items()):
        x, y, z = about["looks_at"]
        world["markers"].append(
            {
                "id": FIRST + number,
                "size": SIZE_M,
                "position": [x + rng.uniform(-0.25, 0.25), y + rng.uniform(-0.25, 0.25), z + 0.2],
                "facing": "up",
                "spin_deg": round(rng.uniform(0, 360)),
                "where": world["furniture"][0]["label"],
                "room": world["furniture"][0]["room"],
                "place": place,
            }
        )
    file = folder / "world.yaml"
    file.write_text(yaml.safe_dump(world))
    camera = {"frames": FRAMES, "markers": {"size": SIZE_M, "sizes": {582: 0.14}}}
    with small_flat(folder, simulator={"world": str(file)}, camera=camera) as flat:
        yield flat


def report_scan(flat: SmallFlat) -> ReportScan:
    """The report's scan, made."""
    settings = yaml.safe_load(flat.config.read_text())["simulators"]["cameras"]["ip1"]
    presets = list(yaml.safe_load((CONFIG / "ip1" / "preset_coords.yaml").read_text()).values())
    scan = ReportScan(flat.urls["ip1"], settings["rtsp_port"], "ros", PASSWORD, presets)
    scan.run()
    return scan


def least_seconds(flat: SmallFlat) -> float:
    """What a full scan needs at least from where the camera truly looks."""
    pose = flat.doors["ip1"].state()["pose"]
    positions = yaml.safe_load((CONFIG / "ip1" / "preset_position.yaml").read_text()).values()
    places = [(float(pan), float(tilt), 0.0) for pan, tilt, _ in positions]
    here = (pose["pan"], pose["tilt"], 0.0)
    limits = constants(PROFILES["ip3m-941w-2019"])
    return least_scan(here, places, limits, turns=2, frames=FRAMES, fps=FPS, switch_s=SWITCH_S).seconds


@contextmanager
def watched(flat: SmallFlat, stream: str = "MainFormat") -> Iterator[list[float]]:
    """At its end, the share of its frame rate that the simulator kept while the stream was open."""
    share, before, began = [0.0], _frames(flat, stream), time.monotonic()
    yield share
    share[0] = (_frames(flat, stream) - before) / (FPS * max(0.1, time.monotonic() - began - OPENING_S))


def _frames(flat: SmallFlat, stream: str) -> int:
    return int(flat.doors["ip1"].state()["frames_rendered"][stream])


def scanned(flat: SmallFlat, value: dict[str, Any]) -> tuple[ScanState, float]:
    """A scan by order; its last state, and how long it took from the order to its end."""
    with flat.client("camera/ip1/#") as bus:
        began = time.monotonic()
        result = bus.order("ip1", "Scan", value, timeout_s=LIMIT_S)
        seconds = time.monotonic() - began
        assert result.state == "done", result
        return states(bus)[-1][1], seconds


def states(bus: Client) -> list[tuple[float, ScanState]]:
    """The states of scans that were heard, and when."""
    heard = [message for message in bus.seen if message.topic == "camera/ip1/scan/state"]
    return [(message.received, read(message, message.received).payload) for message in heard]


def put(flat: SmallFlat, pose: dict[str, float]) -> None:
    """Turns the camera there by hand, and waits until its service has noticed."""
    flat.doors["ip1"].tell("pose", **pose)
    with flat.client("camera/ip1/position") as bus:
        bus.payload("camera/ip1/position", lambda at: abs(at.pan - pose["pan"]) + abs(at.tilt - pose["tilt"]) < 1.0)


def _second_turn(message: Message) -> bool:
    if message.topic != "camera/ip1/scan/state" or message.retain:
        return False
    state = read(message, message.received).payload
    return FIRST in state.targets and bool(state.turn == 2 or state.state in ("done", "failed"))


def first_sightings(flat: SmallFlat) -> dict[int, float]:
    """By marker, when a scan for all of them first told that it was seen; the first turn counts."""
    markers = list(range(FIRST, FIRST + 9))
    with flat.client("camera/ip1/#") as bus:
        bus.forget()
        began = time.time()
        wish = {"targets": [*markers, FIRST + len(markers)], "frames": FEW}  # one is nowhere: no place is left out
        bus.say("camera/ip1/order/Scan", json.dumps(wish))
        bus.until(lambda message: message.received > began and _second_turn(message), LIMIT_S)
        bus.order("ip1", "Scan", "False")
        seen: dict[int, float] = {}
        for at, state in states(bus):
            for marker in state.found if at > began and state.state == "running" else ():
                seen.setdefault(marker, at - began)
    return seen


def table(found: Compared) -> Table:
    """All of it, for people; what the simulator was too slow for is said to count for nothing."""
    title = f"nine places, two picture modes, K = {FRAMES}; counts where {ENOUGH:.0%} of the frame rate was kept"
    table = Table(
        "scan", "seconds", "frames", "over the least time", "quicker than the report's", "kept", "where, s", title=title
    )
    for row in found.rows:
        table.add_row(
            row.name,
            f"{row.seconds:.1f}",
            str(row.frames),
            "" if row.over_least is None else f"{row.over_least:.2f} (<= {bounds.SCAN_OVER_LEAST})",
            "" if row.report is None else f"{row.report / row.seconds:.2f} (>= {bounds.SCAN_QUICKER})",
            "" if row.kept is None else f"{row.kept:.0%}",
            row.where if row.counts else "does not count",
        )
    counted = [row.over_least for row in found.rows if row.counts and row.over_least is not None]
    if counted:
        table.add_row("the middle one", "", "", f"{median(counted):.2f} (<= {bounds.SCAN_OVER_LEAST})", "", "", "")
    if found.sighted is not None:
        share = f"{found.sighted.share:.1%} of the report's (<= {bounds.SIGHTING_SHARE:.0%})"
        seen = f"{len(found.sighted.ours)} of 9 seen, the report's {len(found.sighted.report)}"
        late = "" if found.sighted.kept >= ENOUGH else "does not count"
        table.add_row("first sighting, mean", "", seen, share, "", f"{found.sighted.kept:.0%}", late)
    return table


def plain(found: Compared) -> list[dict[str, Any]]:
    """The same for the JSON file."""
    rows = [{**asdict(row), "counts": row.counts} for row in found.rows]
    return [*rows, {"name": "first sighting", **asdict(found.sighted)}] if found.sighted else rows
