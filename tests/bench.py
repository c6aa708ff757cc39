"""`make bench`: figures as ratios against a floor measured in the same run, as a table and as `bench.json`.

Nothing here passes or fails by a time; a figure is read by people, beside its floor.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import socket
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
from rich.console import Console
from rich.table import Table

from services.aside import Aside
from services.bus import Message
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.peers import mosquitto
from services.runner import Runner
from tests import footprint
from tests.bridge import bench as bridge_bench
from tests.camera import goal_figures, live_goals, scan_figures
from tests.dashboard import bench as dashboard_bench
from tests.mission import bench as mission_bench
from tests.persistence import bench as writer_bench
from tests.persistence import figures as writer_figures
from tests.persistence import year_bench
from tests.vision import bench as vision_bench

MESSAGES = 20_000
STORED = 200_000  # messages of a backlog, and live, for the writer
WINDOW = 500  # of the publisher
RUNS = 5
TOPIC = "home/Kitchen_Light/state"


@dataclass
class Figure:
    """One row: `ratio` is `value` over `floor`."""

    name: str
    unit: str
    value: float
    floor: float
    floor_is: str
    wanted: float

    @property
    def ratio(self) -> float:
        return self.value / self.floor


class Nothing:
    """A service that does nothing, until it has seen enough."""

    subscribes = (TOPIC,)
    due = None

    def __init__(self) -> None:
        self.seen = 0
        self.first = self.last = 0.0

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        self.seen += 1
        return ()

    def tick(self, now: float) -> Iterable[Message]:
        return ()


def blast(port: int, start: Any) -> None:
    """A process of its own: MESSAGES at QoS 1 over a bare socket, WINDOW at a time: the subscriber is what is slow."""
    with socket.create_connection(("127.0.0.1", port)) as link:
        link.sendall(b"\x10\x10\x00\x04MQTT\x04\x02\x00\x3c\x00\x04fast")  # CONNECT, clean, client id "fast"
        assert link.recv(4)[3] == 0, "refused"
        start.wait()
        topic = len(TOPIC).to_bytes(2, "big") + TOPIC.encode()
        for first in range(0, MESSAGES, WINDOW):
            body = [
                topic + (number % 65535 + 1).to_bytes(2, "big") + b"%d" % number
                for number in range(first, first + WINDOW)
            ]
            link.sendall(b"".join(b"\x32" + bytes([len(one)]) + one for one in body))
            acknowledged = 0
            while acknowledged < 4 * WINDOW:  # a PUBACK has 4 bytes
                acknowledged += len(link.recv(65536))
        link.sendall(b"\xe0\x00")  # DISCONNECT


def bare(port: int, protocol: int, go: Callable[[], None]) -> float:
    """The floor: a paho subscriber that only counts and lets paho acknowledge each message. Messages per second."""
    done, times = threading.Event(), [0.0, 0.0]
    count = 0

    def on_message(_client: Any, _data: Any, _message: Any) -> None:
        nonlocal count
        count += 1
        if count == 1:
            times[0] = time.perf_counter()
        if count == MESSAGES:
            times[1] = time.perf_counter()
            done.set()

    client = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id="bare", protocol=protocol)
    client.on_message = on_message
    client.on_subscribe = lambda *_: go()
    client.connect("127.0.0.1", port)
    client.subscribe(TOPIC, qos=1)
    client.loop_start()
    assert done.wait(120), f"only {count} of {MESSAGES} came"
    client.disconnect()
    client.loop_stop()
    return (MESSAGES - 1) / (times[1] - times[0])


def ours(port: int, protocol: int, go: Callable[[], None]) -> float:
    """Bus, runner and a service that does nothing. Messages per second."""
    bus = MqttBus(Address("ours", port=port, protocol=protocol))  # type: ignore[arg-type]
    service = Nothing()
    runner = Runner("ours", service, bus, time.time, Aside())
    while not bus.connected:
        runner.turn(0.05)
    runner.turn(0.2)
    go()
    while service.seen == 0:
        runner.turn(0.05)
    first, already = time.perf_counter(), service.seen
    while service.seen < MESSAGES:
        runner.turn(0.05)
    last = time.perf_counter()
    bus.close()
    return (MESSAGES - already) / (last - first)


def rates(port: int, protocol: int, run: Callable[[int, int, Callable[[], None]], float]) -> float:
    """One run with a fresh publisher."""
    context = multiprocessing.get_context("spawn")
    start = context.Event()
    publisher = context.Process(target=blast, args=(port, start))
    publisher.start()
    rate = run(port, protocol, start.set)
    publisher.join(60)
    return rate


Part = tuple[Table, list[Any]]  # what people see of a part, and the same for programs


@dataclass(frozen=True)
class Size:
    """How much is measured: runs of each, messages of a backlog and live for the writer, items of the year."""

    runs: int = RUNS
    messages: int = STORED
    items: int = year_bench.ITEMS


def bus_and_runner(folder: Path, runs: int) -> list[Figure]:
    """QoS 1 through the bus, the runner and a service that does nothing, over MQTT 3.1.1 and 5."""
    figures = []
    with mosquitto.private(folder, anonymous=True) as broker:
        for protocol, name in ((4, "3.1.1"), (5, "5")):
            pairs = [(rates(broker.port, protocol, bare), rates(broker.port, protocol, ours)) for _ in range(runs)]
            floor, value = (statistics.median(column) for column in zip(*pairs, strict=True))
            figures.append(
                Figure(f"bus and runner, MQTT {name}, QoS 1", "msg/s", value, floor, "a bare paho subscriber", 0.8)
            )
    return figures


def bus_part(folder: Path, size: Size) -> Part:
    """The bus and the runner."""
    figures = bus_and_runner(folder, size.runs)
    table = Table("figure", "value", "floor", "ratio", "wanted", "the floor is")
    for figure in figures:
        table.add_row(figure.name, f"{figure.value:,.0f} {figure.unit}", f"{figure.floor:,.0f} {figure.unit}",
                      f"{figure.ratio:.2f}", f">= {figure.wanted}", figure.floor_is)  # fmt: skip
    return table, [{**asdict(figure), "ratio": figure.ratio} for figure in figures]


def stored_part(folder: Path, size: Size) -> Part:
    """Persistence."""
    rows = writer_bench.rows(folder / "writer", size.runs, size.messages)
    return writer_table("writer, QoS 1, a commit before each acknowledgement", rows), [asdict(row) for row in rows]


def year_part(folder: Path, size: Size) -> Part:
    """A year of history."""
    rows = list(year_bench.rows(folder / "year", size.items))
    return writer_table(f"a year of {size.items} items, a row a minute", rows), [asdict(row) for row in rows]


def moves_part(_: Path, __: Size) -> Part:
    """The camera's goals."""
    rows = goal_figures.rows()
    return goals_table(rows), [asdict(row) for row in rows]


def live_moves_part(_: Path, __: Size) -> Part:
    """The camera's goals in real time."""
    rows = list(live_goals.rows())
    return live_goals.table(rows), [asdict(row) for row in rows]


def bridge_part(_: Path, __: Size) -> Part:
    """The bridge to ROS."""
    rows = list(bridge_bench.rows())
    return bridge_bench.table(rows), [asdict(row) for row in rows]


def scan_part(_: Path, __: Size) -> Part:
    """Scans of the flat."""
    rows = scan_figures.rows()
    return scan_figures.table(rows), list(scan_figures.plain(rows))


def vision_part(_: Path, __: Size) -> Part:
    """Markers in pictures."""
    rows = list(vision_bench.rows())
    return vision_bench.table(rows), [asdict(row) for row in rows]


def mission_part(_: Path, __: Size) -> Part:
    """Missions in random flats."""
    figures = mission_bench.figures()
    return mission_bench.table(figures), list(mission_bench.plain(figures))


def dashboard_part(folder: Path, _: Size) -> Part:
    """The dashboard."""
    rows = list(dashboard_bench.rows(folder))
    return dashboard_bench.table(rows), [asdict(row) for row in rows]


def footprint_part(_: Path, __: Size) -> Part:
    """Memory and processor of the whole apartment."""
    rows = list(footprint.rows())
    return footprint.table(rows), [asdict(row) for row in rows]


PARTS: dict[str, Callable[[Path, Size], Part]] = {
    "bus": bus_part,
    "persistence": stored_part,
    "year": year_part,
    "moves": moves_part,
    "live-moves": live_moves_part,
    "bridge": bridge_part,
    "scan": scan_part,
    "vision": vision_part,
    "mission": mission_part,
    "dashboard": dashboard_part,
    "footprint": footprint_part,
}


def main() -> None:
    """Runs all parts or one, prints their tables, writes `bench.json`."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--part", choices=["all", *PARTS], default="all")
    arguments.add_argument("--runs", type=int, default=RUNS, help="runs of each; the median counts")
    arguments.add_argument("--messages", type=int, default=STORED, help="of a backlog, and live, for the writer")
    arguments.add_argument("--items", type=int, default=year_bench.ITEMS, help="of the year: 525,600 rows each")
    arguments.add_argument("--json", type=Path, default=Path("bench.json"))
    given = arguments.parse_args()
    console = Console(width=None if sys.stdout.isatty() else 170)
    plain: list[Any] = []
    for name in PARTS if given.part == "all" else [given.part]:
        with tempfile.TemporaryDirectory() as folder:
            table, rows = PARTS[name](Path(folder), Size(given.runs, given.messages, given.items))
        console.print(table)
        plain += rows
        given.json.write_text(json.dumps(plain, indent=1))


def writer_table(name: str, rows: list[writer_figures.Row]) -> Table:
    """Figures of the writer and of the history."""
    table = Table(name, "value", "floor", "ratio", "wanted", "the floor is")
    for row in rows:
        floor, ratio = (f"{row.floor:,.1f}", f"{row.ratio:.2f}") if row.floor and row.ratio else ("", "")
        table.add_row(row.name, f"{row.value:,.1f} {row.unit}", floor, ratio, row.wanted, row.floor_is)
    return table


def goals_table(moves: list[goal_figures.Row]) -> Table:
    """The camera's moves."""
    title = "random goals of the camera in virtual time (no frame rate to keep): time over the motors' least time"
    table = Table("firmware", "goals", "median s", "median ratio", "wanted", "worst", "commands", "most", "over 12",
                  "requests each", "worst off", "pushed", title=title)  # fmt: skip
    for row in moves:
        table.add_row(row.name, str(row.goals), f"{row.seconds:.1f}", f"{row.ratio:.2f}",
                      "" if row.bound is None else f"<= {row.bound}", f"{row.worst:.1f}", f"{row.commands:.0f}",
                      str(row.most_commands), str(row.over), f"{row.requests:.2f}", f"{row.off:.2f} deg",
                      str(row.pushed))  # fmt: skip
    return table


if __name__ == "__main__":
    main()
