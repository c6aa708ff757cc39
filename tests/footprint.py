"""What the whole apartment takes of a small machine: memory and processor, without broker, database and simulators.

Memory is the proportional set size, which counts what processes share once; processor is the time of all our processes,
in percent of one core. Both as the kernel tells them (proc(5): smaps_rollup, stat).
"""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from services import topics
from services.client import connected
from services.payloads import Order, OrderResult
from services.simulated import Parts, Simulated, parts_of, services_of
from tests.small_flat import family, words_of

IDLE_S = 60.0
SETTLE_S = 20.0  # after the start: first states, first look at everything, the watchdogs of cameras and robots
SCAN_S = 300.0
LOOK_EVERY_S = 0.5
SIMULATORS = ("simulated-camera", "simulated-home", "simulated-robot")
MORE = "metrics: {port: 0}\nhubs: {homie: true}\n"  # services that the simulated apartment does not run by itself
GROUPED = f"grouped: true\n{MORE}"
MB = 1024  # of /proc's kB
TICKS_S = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Row:
    """One figure. `wanted`: the most that issue 11 allows, where it says something."""

    name: str
    value: float
    unit: str
    wanted: float | None = None


@dataclass(frozen=True)
class Taken:
    """What processes took, by what each is: MB, and percent of a core."""

    memory: Counter[str]
    processor: Counter[str]


# What may be left out or set otherwise on the smallest machine: services, and words of the camera's section.
SAVINGS: tuple[tuple[str, tuple[str, ...], str], ...] = (
    ("without the dashboard", ("dashboard",), ""),
    ("without the bridge to ROS", ("bridge",), ""),
    ("without missions, metrics and hubs", ("mission", "metrics", "hubs"), ""),
    ("without the history service", ("history",), ""),
    ("profile: low", (), "profile: low"),
)


def rows() -> Iterator[Row]:
    """The whole as a small machine should run it, each of its processes, and what leaving something out saves."""
    with tempfile.TemporaryDirectory() as name, parts_of(Path(name) / "parts", real=True) as parts:
        folder = Path(name)
        with services_of(folder / "simulators", parts, only=SIMULATORS):
            with _apartment(folder / "whole", parts) as flat:
                whole = _over(flat, IDLE_S)
                most = _most_in_a_scan(flat)
            yield Row("idle, memory", whole.memory.total(), "MB", 350)
            yield Row("idle, processor", whole.processor.total(), "% of a core", 15)
            yield Row("scan, most memory", most, "MB", 900)
            yield from _each("grouped", whole)
            with _apartment(folder / "apart", parts, top=MORE) as flat:
                apart = _over(flat, IDLE_S)
            yield Row("each service in its own process, memory", apart.memory.total(), "MB")
            yield Row("each service in its own process, processor", apart.processor.total(), "% of a core")
            yield from _each("own process", apart)
            for number, (label, without, camera) in enumerate(SAVINGS):
                with _apartment(folder / f"less{number}", parts, without, camera=camera) as flat:
                    less = _over(flat, IDLE_S)
                yield Row(f"{label}, memory saved", whole.memory.total() - less.memory.total(), "MB")
                yield Row(f"{label}, processor saved", whole.processor.total() - less.processor.total(), "% of a core")


def table(found: list[Row]) -> Table:
    """For people."""
    made = Table("one camera; no broker, no database, no simulators", "value", "wanted")
    for row in found:
        made.add_row(row.name, f"{row.value:,.1f} {row.unit}", "" if row.wanted is None else f"<= {row.wanted:g}")
    return made


@contextmanager
def _apartment(
    folder: Path, parts: Parts, without: Collection[str] = (), top: str = GROUPED, camera: str = ""
) -> Iterator[Simulated]:
    def change(file: Path) -> None:
        text = file.read_text()
        if camera:
            text = text.replace("    brand: amcrest\n", f"    brand: amcrest\n    {camera}\n")
        file.write_text(top + text)

    with services_of(folder, parts, (*SIMULATORS, *without), change=change) as flat:
        threading.Event().wait(SETTLE_S)
        yield flat


def _each(label: str, taken: Taken) -> Iterator[Row]:
    for what, memory in taken.memory.most_common():
        yield Row(f"  {label}: {what}, memory", memory, "MB")
        yield Row(f"  {label}: {what}, processor", taken.processor[what], "% of a core")


def _over(flat: Simulated, seconds: float) -> Taken:
    """What all processes took in that time; the memory as it is at its end."""
    before, began = _spent(flat), time.monotonic()
    threading.Event().wait(seconds)
    after, took = _spent(flat), time.monotonic() - began
    return Taken(_memory(flat), Counter({what: 100 * (after[what] - before[what]) / took for what in after}))


def _most_in_a_scan(flat: Simulated) -> float:
    """MB: looked at twice a second while the apartment is scanned for all of its markers."""
    camera, order = flat.apartment.cameras[0], Order(value="ON", id="footprint")
    with connected(flat.apartment.bus, [topics.CAMERA_ORDER_RESULT.filter]) as bus:
        bus.publish(topics.CAMERA_ORDER.message(order, cam=camera, key="Scan"))
        most, end = 0.0, time.monotonic() + SCAN_S
        while time.monotonic() < end:
            most = max(most, _memory(flat).total())
            answers = [topics.read(one, one.received).payload for one in bus.pump(LOOK_EVERY_S)]
            ends = [one for one in answers if isinstance(one, OrderResult) and one.id == order.id and one.final]
            if ends:
                assert ends[0].state == "done", ends[0]
                return most
    raise TimeoutError(f"no end of the scan within {SCAN_S:.0f} s")


def _processes(flat: Simulated) -> Iterator[tuple[int, str]]:
    """Every process of the apartment, and what it is; what is not a service belongs to the one that started it."""
    for child in flat.supervisor.children.values():
        for pid in family(child.process.pid) if child.process else ():
            words = b" ".join(words_of(Path(f"/proc/{pid}")))
            yield pid, child.name if b"services serve" in words else f"{child.name}: helper"


def _memory(flat: Simulated) -> Counter[str]:
    found: Counter[str] = Counter()
    for pid, what in _processes(flat):
        try:
            lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        except OSError:
            continue  # it has just ended
        found[what] += sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / MB
    return found


def _spent(flat: Simulated) -> Counter[str]:
    """Seconds of processor, with those of ended children."""
    found: Counter[str] = Counter()
    for pid, what in _processes(flat):
        try:
            values = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        found[what] += sum(map(int, values[11:15])) / TICKS_S
    return found
