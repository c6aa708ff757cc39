"""`make soak`: the trials of the tests with more turns. `PART`, `N` (0: as many as is usual for the part), `SEED`.

Prints its figures, and the seed that repeats them.
"""

from __future__ import annotations

import argparse
import logging
import random
import signal
import statistics
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from itertools import cycle
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from services.simulated import Simulated, parts_of, services_of
from services.virtual import VirtualApartment
from tests import trials
from tests.attacks import flooding
from tests.bridge import trials as bridge_trials
from tests.camera import sound_trials
from tests.camera import trials as camera_trials
from tests.camera.scan.scenes import scan_a_scene, whole_scans
from tests.chaos import trials as chaos_trials
from tests.fuzz import trials as fuzz_trials
from tests.installation import fresh_debian
from tests.mission import flat_trials
from tests.mission import trials as mission_trials
from tests.persistence import trials as writer_trials
from tests.small_flat import SmallFlat, small_flat
from tests.vision import mount_trials, positions
from tests.vision import trials as detector_trials

CHAOS_S = 600.0
HANGING = ("a", "b", "c", "d")
Turn = Callable[[random.Random], float]


@contextmanager
def real(trial: Callable[[Simulated, random.Random], float]) -> Iterator[Turn]:
    """Turns on real parts, one apartment for all."""
    with (
        tempfile.TemporaryDirectory() as name,
        parts_of(Path(name) / "parts", real=True) as parts,
        services_of(Path(name) / "services", parts) as flat,
    ):
        yield lambda rng: trial(flat, rng)


@contextmanager
def cameras(
    trial: Callable[[SmallFlat, random.Random], float], cameras: tuple[str, ...] = ("ip1",), **options: Any
) -> Iterator[Turn]:
    """Turns with simulated cameras and a broker alone, one apartment for all."""
    with tempfile.TemporaryDirectory() as name, small_flat(Path(name), cameras, **options) as flat:
        yield lambda rng: trial(flat, rng)


@contextmanager
def virtual(trial: Callable[[VirtualApartment, random.Random], float]) -> Iterator[Turn]:
    """Turns in virtual time, one apartment for all."""
    with tempfile.TemporaryDirectory() as name, trials.virtual_flat(Path(name)) as flat:
        yield lambda rng: trial(flat, rng)


def move(flat: VirtualApartment, rng: random.Random) -> float:
    """A goal anywhere in reach; the seconds it took, in virtual time."""
    pan, tilt = rng.choice([rng.uniform(0, 178), rng.uniform(187, 359.9)]), rng.uniform(0, 90)
    began = flat.now
    result = flat.look("ip1", pan=round(pan, 1), tilt=round(tilt, 1))
    assert result is not None
    assert result.state == "done", result
    return flat.now - began


def scan(flat: VirtualApartment, rng: random.Random) -> float:
    """A scan from wherever the camera looks; the seconds it took, in virtual time."""
    move(flat, rng)
    began = flat.now
    result = flat.order("ip1", "Scan", "ON")
    assert result is not None
    assert result.state == "done", result
    assert any(message.topic == "camera/ip1/scan/result" for message in flat.client.seen)
    return flat.now - began


@contextmanager
def bridge() -> Iterator[Turn]:
    """Turns of a bridge under traffic both ways, one for all."""
    with bridge_trials.under_traffic() as traffic:
        yield traffic.turn


@contextmanager
def writer(trial: Callable[[writer_trials.Site, random.Random], float]) -> Iterator[Turn]:
    """Turns with the writer, its broker and its database alone."""
    with tempfile.TemporaryDirectory() as name, writer_trials.site(Path(name)) as one:
        yield lambda rng: trial(one, rng)


def lost_by_the_broker(one: writer_trials.Site, rng: random.Random, *, backlog: bool) -> float:
    """kill -9 of mosquitto: percent of the acknowledged messages that it lost. How many it doubled is printed."""
    acknowledged, lost, doubled = writer_trials.kill_broker(one, rng, backlog=backlog)
    Console().print(f"mosquitto killed: {acknowledged} acknowledged, {lost} lost, {doubled} doubled")
    return 100.0 * lost / acknowledged


@contextmanager
def chaos() -> Iterator[Turn]:
    """Ten minutes of faults in a new apartment each turn; its log tells what happened when."""

    def turn(rng: random.Random) -> float:
        logging.basicConfig(format="%(asctime)s %(message)s")
        with tempfile.TemporaryDirectory() as name, chaos_trials.apartment(Path(name) / "apartment") as running:
            return chaos_trials.chaos(running, rng.randrange(10**6), CHAOS_S)

    yield turn


@contextmanager
def rubbish_everywhere() -> Iterator[Turn]:
    """A hundred thousand messages and ten thousand requests at a new apartment each turn; messages a second."""

    def turn(rng: random.Random) -> float:
        seed = rng.randrange(10**6)
        with tempfile.TemporaryDirectory() as name, fuzz_trials.apartment(Path(name) / "apartment") as running:
            fuzz_trials.warm(running)
            found = fuzz_trials.fuzz(running, seed, 100_000)
        Console().print(f"seed {seed}: bad {found.bad}, answers {dict(found.answers)}")
        assert not found.faults, found.faults
        return found.messages / found.seconds

    yield turn


@contextmanager
def missions() -> Iterator[Turn]:
    """A mission from the bedroom in a new flat each turn, on real parts, with an accident in the middle."""

    accidents = cycle(mission_trials.ACCIDENTS)

    def turn(_: random.Random) -> float:
        accident = next(accidents)
        with tempfile.TemporaryDirectory() as name, mission_trials.flat(Path(name), mission_trials.BEDROOM) as one:
            end, seconds = mission_trials.find(one, 582, accident)
        Console().print(f"accident {accident}: {end.state} after {seconds:.1f} s: {end.reason}")
        assert end.state == "found", end
        return seconds

    yield turn


PARTS: dict[str, tuple[Callable[[], object], int, str]] = {
    "kills": (lambda: real(lambda flat, rng: trials.kill(flat, rng.choice(trials.BUS_SERVICES))), 40, "s until online"),
    "camera": (lambda: real(lambda flat, rng: trials.kill_camera(flat)), 10, "s until an order is done"),
    "broker": (
        lambda: real(lambda flat, rng: trials.restart_broker(flat, rng.choice([signal.SIGTERM, signal.SIGKILL]))),
        20,
        "s until all are online",
    ),
    "rubbish": (
        lambda: real(lambda flat, rng: sum(trials.rubbish(flat, 10_000, rng.randrange(10**6)).values())),
        5,
        "bad messages counted",
    ),
    "camera-hangs": (
        lambda: cameras(lambda flat, rng: camera_trials.hang(flat, "d").most, HANGING, simulator={"latency_s": 0.1}),
        10,
        "x the time of an order, 95 in 100",
    ),
    "camera-kills": (
        lambda: cameras(
            lambda flat, rng: rng.choice(camera_trials.KILLS)(flat, rng.choice(camera_trials.MOTIONS)),
            **camera_trials.EVERY_MOTION,
        ),
        20,
        "s until the motor stands still",
    ),
    "camera-cuts": (
        lambda: cameras(lambda flat, rng: camera_trials.cut_network(flat, seconds=rng.uniform(0, 5)), networked=True),
        20,
        "s until the stop arrives",
    ),
    "camera-faults": (
        lambda: cameras(
            lambda flat, rng: camera_trials.fault(flat, rng.choice(camera_trials.FAULTS)), **camera_trials.FAULTY
        ),
        25,
        "s until it shows",
    ),
    "camera-logins": (
        lambda: cameras(lambda flat, rng: camera_trials.change_password(flat), **camera_trials.FAULTY),
        5,
        "logins that failed after a change of the password",
    ),
    "camera-idle": (
        lambda: cameras(lambda flat, rng: camera_trials.idle(flat)),
        5,
        "requests a second while nobody wants anything",
    ),
    "camera-hears": (
        lambda: cameras(
            lambda flat, rng: sound_trials.record(flat, rng, rng.choice(tuple(flat.doors))), **sound_trials.SPEAKING
        ),
        15,
        "Hz off, the tone of a recording",
    ),
    "camera-speaks": (
        lambda: cameras(
            lambda flat, rng: sound_trials.play(flat, rng, rng.choice(tuple(flat.doors))), **sound_trials.SPEAKING
        ),
        15,
        "% like what was played",
    ),
    "bridge": (bridge, 30, "s until all flows again"),
    "persistence": (lambda: writer(writer_trials.trouble), 100, "messages, none lost or doubled"),
    "broker-kills": (lambda: writer(lambda one, rng: lost_by_the_broker(one, rng, backlog=False)), 10, "% lost"),
    "broker-kills-backlog": (lambda: writer(lambda one, rng: lost_by_the_broker(one, rng, backlog=True)), 10, "% lost"),
    "moves": (lambda: virtual(move), 200, "s, virtual"),
    "scans": (lambda: virtual(scan), 50, "s, virtual"),
    "calibration": (mount_trials.calibrations, 150, "mm off, of the mount"),
    "mission": (missions, 10, "s until found and confirmed"),
    "scenes": (lambda: nullcontext(lambda rng: scan_a_scene(rng)), 24, "s, virtual"),
    "whole-scans": (whole_scans, 8, "x the least time, virtual"),
    "flats": (lambda: nullcontext(flat_trials.a_flat), 20, "s, virtual"),
    "real-flats": (lambda: nullcontext(flat_trials.on_real_parts), 2, "x the virtual time"),
    "detector": (detector_trials.in_numbers, 100, "false markers in 50 frames"),
    "chaos": (chaos, 1, "s until everybody is well"),
    "fuzz": (rubbish_everywhere, 1, "messages a second"),
    "flood": (flooding.floods, 5, "ms, the others' slowest of a hundred"),
    "positions": (positions.in_flats, 10, "mm off, median of a flat"),
    "install": (lambda: nullcontext(fresh_debian.follow), 1, "min, docs/raspberry-pi.md on a new Debian"),
}


def run(part: str, turns: int, seed: int) -> list[float]:
    """The figures of one part."""
    start, usual, _ = PARTS[part]
    rng = random.Random(seed)
    with start() as turn:  # type: ignore[attr-defined]
        return [turn(rng) for _ in range(turns or usual)]


def main() -> None:
    """Runs the parts that are wanted and prints one table."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--part", default="all", choices=["all", *PARTS])
    arguments.add_argument("--turns", type=int, default=0)
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    table = Table("part", "turns", "min", "median", "max", "", "seed")
    for part in PARTS if given.part == "all" else [given.part]:
        figures = run(part, given.turns, given.seed)
        row = (min(figures), statistics.median(figures), max(figures))
        table.add_row(part, str(len(figures)), *(f"{figure:.2f}" for figure in row), PARTS[part][2], str(given.seed))
    Console().print(table)


if __name__ == "__main__":
    main()
