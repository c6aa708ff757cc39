"""Random goals in real time: ordered over a real broker from `apartment run`, met by the simulated camera's HTTP.

What a user would measure with a watch: from the order to `done`, with the service's own looks at the camera between its
requests, and a picture that is watched meanwhile; from a cold start, and after `apartment calibrate ptz`. Without the
service, in virtual time: `goals.py`. Two firmwares are measured at once, for most of the time they wait for motors;
with four, two cores are so busy with pictures that answers come a hundredth of a second later. A camera that turns 27
degrees a second is elsewhere then, and nothing but one more look tells. The seed draws the goals, the pauses between
them and how long the camera takes to answer, so one seed tells of one camera.
"""

from __future__ import annotations

import json
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from random import Random
from statistics import median
from typing import Any

import httpx
from rich.table import Table

from services.client import Client
from services.payloads import Stream
from services.simulators.camera.firmwares import PROFILES
from tests import bounds
from tests.camera.goals import LIMITS, Goal, constants, outcomes, random_goals, wanted
from tests.camera.least_time import least_time
from tests.camera.scan_figures import ENOUGH, watched
from tests.small_flat import Door, small_flat

COLD = ("ip3m-941w-2019", "ip4m-1051b-2019", "ip2m-841b-strict", "ip4m-1041b")  # these not calibrated, too
AT_ONCE = 2
PAUSE_S = (0.3, 4.0)  # between two orders: people do not wait for the service's rhythm
LIMIT_S = 90.0
CALIBRATES_S = 500.0  # at most
SUBSTREAM = "ExtraFormat"  # the one that the service hands on


@dataclass
class LiveRow:
    """Goals on one firmware; `virtual`: the same ratio without the service, in virtual time.

    `commands`: the most that the camera took during one, the service's other questions too. `kept`: the share of its
    frame rate that the simulator kept meanwhile. `beyond`: the goals that were beyond a bound, with all that was asked.
    """

    firmware: str
    calibrated: bool
    goals: int
    seconds: float
    ratio: float
    virtual: float
    bound: float
    commands: int
    off: float
    pushed: float
    failed: int
    kept: float
    beyond: list[Met]


@dataclass
class Met:
    """One goal, and what became of it; `asked`: by the service meanwhile, with the seconds since it was ordered."""

    number: int
    start: Goal
    goal: Goal
    state: str
    seconds: float
    least: float
    off: float
    pushed: float
    commands: int
    asked: list[str]

    @property
    def beyond(self) -> bool:
        """Whether it broke a bound."""
        many, far = self.commands > bounds.COMMANDS, self.off > bounds.OFF_DEG
        return many or far or self.pushed > 0 or self.state != "done"


def rows(goals: int = bounds.GOALS, seed: int = 1) -> Iterator[LiveRow]:
    """Every firmware, calibrated, and some from a cold start; takes an hour and a half."""
    cases = [*((firmware, True) for firmware in PROFILES), *((firmware, False) for firmware in COLD)]
    asked = random_goals(goals, seed)
    with ProcessPoolExecutor(AT_ONCE) as pool:
        found = list(pool.map(partial(_row, goals=asked, seed=seed), cases))
    for row in found:  # not before all are measured, which this would disturb
        virtual = outcomes(PROFILES[row.firmware], asked, seed, calibrated=row.calibrated)
        yield replace(row, virtual=median(one.ratio for one in virtual))


def _row(case: tuple[str, bool], goals: list[Goal], seed: int) -> LiveRow:
    with tempfile.TemporaryDirectory() as folder:
        return _measured(*case, Path(folder), goals, seed)


def _measured(firmware: str, calibrated: bool, folder: Path, goals: list[Goal], seed: int) -> LiveRow:
    found: list[Met] = []
    rng = Random(seed)
    with small_flat(folder, simulator={"profile": firmware, "seed": seed}) as flat, flat.client("camera/ip1/#") as bus:
        door = flat.doors["ip1"]
        if calibrated:
            learnt = bus.order("ip1", "CalibratePtz", "True", timeout_s=CALIBRATES_S)
            assert learnt.state == "done", learnt
        with shown(bus), watched(flat, SUBSTREAM) as kept:
            for number, goal in enumerate(goals):
                bus.collect(rng.uniform(*PAUSE_S))
                found.append(_met(bus, door, number, goal, firmware))
    return LiveRow(
        firmware=firmware,
        calibrated=calibrated,
        goals=len(goals),
        seconds=median(one.seconds for one in found),
        ratio=median(one.seconds / one.least for one in found),
        virtual=0.0,
        bound=wanted(PROFILES[firmware]),
        commands=max(one.commands for one in found),
        off=max(one.off for one in found),
        pushed=sum(one.pushed for one in found),
        failed=sum(one.state != "done" for one in found),
        kept=kept[0],
        beyond=[one for one in found if one.beyond],
    )


@contextmanager
def shown(bus: Client) -> Iterator[None]:
    """The camera's picture is looked at meanwhile."""
    bus.order("ip1", "MJPEG", "ON")
    stream: Stream = bus.payload("camera/ip1/stream", lambda stream: stream.mjpeg)
    over = threading.Event()

    def look() -> None:
        with httpx.stream("GET", stream.url, timeout=30) as picture:
            any(over.is_set() for _ in picture.iter_raw())

    viewer = threading.Thread(target=look, name="viewer")
    viewer.start()
    try:
        yield
    finally:
        over.set()
        viewer.join()


def pushed(door: Door) -> float:
    """For how long pan and tilt were pushed against their ends by now, seconds."""
    told = httpx.get(f"{door.url}/motors", timeout=30).json()["pushed_s"]
    return float(told["pan"] + told["tilt"])


def _met(bus: Client, door: Door, number: int, goal: Goal, firmware: str) -> Met:
    """Orders it, and looks at the truth when its end is told."""
    before, pushed_before = door.state(), pushed(door)
    start: Goal = (before["pose"]["pan"], before["pose"]["tilt"], before["pose"]["zoom"])
    bus.forget()
    ordered, began = time.time(), time.monotonic()
    bus.say("camera/ip1/position/set", json.dumps(dict(zip(("pan", "tilt", "zoom"), goal, strict=True))))
    ended = bus.payload("camera/ip1/order_result", lambda result: result.final, LIMIT_S)
    seconds = time.monotonic() - began
    truth = door.state()
    there = truth["pose"]
    return Met(
        number=number,
        start=start,
        goal=goal,
        state="moving" if truth["moving"] else ended.state,
        seconds=seconds,
        least=least_time(start, goal, constants(PROFILES[firmware])),
        off=max(abs(LIMITS.unwrap(there["pan"]) - LIMITS.unwrap(goal[0])), abs(there["tilt"] - goal[1])),
        pushed=pushed(door) - pushed_before,
        commands=truth["door"]["passed"] - before["door"]["passed"],
        asked=[_line(one, ordered) for one in door.log() if one["time"] >= ordered],
    )


def _line(asked: dict[str, Any], ordered: float) -> str:
    return f"{asked['time'] - ordered:.2f} {asked['status']} {asked['target']}"


def table(found: list[LiveRow]) -> Table:
    """For people."""
    title = f"random goals in real time, from order to answer; counts where {ENOUGH:.0%} of the frame rate was kept"
    columns = ("firmware", "goals", "median s", "over the least time", "virtual", "wanted", "most commands",
               "worst off", "pushed", "failed", "kept")  # fmt: skip
    shown = Table(*columns, title=title, caption="what was asked in goals beyond a bound: `beyond` in bench.json")
    for row in found:
        ratios = f"{row.ratio:.2f}", f"{row.virtual:.2f}", f"<= {row.bound}"
        rest = str(row.commands), f"{row.off:.2f} deg", f"{row.pushed:.1f} s", str(row.failed), f"{row.kept:.0%}"
        name = f"{row.firmware}, calibrated" if row.calibrated else row.firmware
        shown.add_row(name, str(row.goals), f"{row.seconds:.1f}", *ratios, *rest)
    return shown
