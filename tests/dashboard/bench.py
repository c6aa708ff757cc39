"""What the dashboard costs: a flood of states with many viewers, and a year of an item plotted.

Figures are of this machine as it is; what the issue wants stands beside them.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.table import Table

from services import peers
from services.history import keeping
from services.history.keeping import Keep
from services.peers import free_port, mariadb, mosquitto
from services.simulated import CONFIG
from services.storage import open_storage, reading
from tests.dashboard import browser as browsers
from tests.dashboard.parts import Browser
from tests.databases import connected as database_of
from tests.databases import fresh_mariadb

ITEMS, RATE, VIEWERS = 1000, 2000, 20
FLOOD_S = 10.0
YEAR = 525_600  # minutes
BEGAN = 1_735_689_600  # 2025-01-01
TASKS = """() => { window.tasks = [];
  new PerformanceObserver((list) => window.tasks.push(...list.getEntries().map((one) => one.duration)))
  .observe({entryTypes: ["longtask"]}); }"""


@dataclass(frozen=True)
class Row:
    """One figure."""

    name: str
    value: float
    unit: str
    wanted: str


def rows(folder: Path) -> Iterator[Row]:
    """All of them."""
    yield from flood(folder / "flood")
    yield from year(folder / "year")


def table(found: list[Row]) -> Table:
    """For people."""
    made = Table("dashboard", "value", "wanted")
    for row in found:
        made.add_row(row.name, f"{row.value:,.2f} {row.unit}", row.wanted)
    return made


def flood(folder: Path, seconds: float = FLOOD_S) -> Iterator[Row]:
    """ITEMS at RATE with VIEWERS, one of them a real page."""
    with ExitStack() as stack:
        port, url, pid = stack.enter_context(_serving(folder, stack))
        stack.enter_context(_program(folder, "look", url.rsplit(":", 1)[1], str(VIEWERS - 1)))
        chromium = stack.enter_context(browsers.chromium())
        page = stack.enter_context(browsers.page(chromium, url))
        browsers.view(page, "devices")
        stack.enter_context(_program(folder, "say", str(port), str(ITEMS), str(RATE)))
        page.locator("[data-item=Item_999] .value", has_text="°C").wait_for()
        page.evaluate(TASKS)
        with Browser(url) as asking:
            first, began = _just_told(asking)
            before = _cpu_s(pid)
            shown = page.locator(".card .value").all_text_contents()
            page.wait_for_timeout(seconds * 500)
            moved = sum(a != b for a, b in zip(shown, page.locator(".card .value").all_text_contents(), strict=True))
            browsers.view(page, "bus")
            page.wait_for_timeout(seconds * 500)
            last, ended = _just_told(asking)
            spent, messages, took = _cpu_s(pid) - before, last - first, ended - began
        tasks = page.evaluate("() => window.tasks")
    yield Row(f"server, {ITEMS} items at {RATE} msg/s, {VIEWERS} viewers", spent / took, "cores", "< 1")
    yield Row("messages that it took of them", messages / took, "msg/s", f"{RATE}")
    yield Row("items of the page that changed meanwhile", moved, "", f"{ITEMS}")
    yield Row("longest task of the page, Devices and Bus", max(tasks, default=0.0), "ms", "< 200")
    yield Row("tasks over 50 ms meanwhile", len(tasks), "", "")


def year(folder: Path, runs: int = 7) -> Iterator[Row]:
    """A year of one item at 1-minute steps on MariaDB, downsampled there."""
    with mariadb.private(folder) as server:
        database = fresh_mariadb(server)
        with closing(open_storage(database.address)) as storage:
            with database_of(server, server.user, server.password, server.database) as link, link.cursor() as cursor:
                cursor.execute("INSERT INTO item(name, kind, unit) VALUES ('Kitchen_Temp', 'Number', '°C')")
                cursor.execute(
                    "INSERT INTO sample(item_id, time, num) SELECT item_id, FROM_UNIXTIME(%s + 60 * seq), "
                    "20 + 5 * SIN(seq / 229) + RAND() FROM item, seq_0_to_%s",
                    (BEGAN, YEAR - 1),
                )
                link.commit()
            item, span = reading.items(storage)["Kitchen_Temp"], (BEGAN * 10**6, (BEGAN + 60 * YEAR) * 10**6)

            def plotted() -> None:
                assert sum(one.n for one in reading.buckets(storage, item, *span, 43200)) == YEAR

            count = f"SELECT COUNT(*) FROM sample WHERE item_id={item.item_id}"
            floor, before = statistics.median(timed(partial(storage.read, count), runs)), _cpu_s(server.pid)
            raw = timed(plotted, runs)
            spent = (_cpu_s(server.pid) - before) / runs * 1000
            keep = Keep(items=("Kitchen_Temp",), raw="5y", means={"5m": "2y", "1h": "forever"})
            for _ in keeping.pieces(storage, {"Kitchen_Temp": keep}, BEGAN + 60 * YEAR + 3600):
                pass
            kept = timed(plotted, runs)
    yield Row("a year at 1-minute steps as 730 points, as the history keeps it", statistics.median(kept), "ms", "< 300")
    yield Row("the same before means were made, from raw rows, median", statistics.median(raw), "ms", "< 300")
    yield Row("the best of them", min(raw), "ms", "")
    yield Row("processor time of the database for each", spent, "ms", "")
    yield Row("a floor: the same rows counted by SQL", floor, "ms", "")


def timed(ask: Callable[[], object], runs: int) -> list[float]:
    """Milliseconds of each run."""
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        ask()
        times.append((time.perf_counter() - began) * 1000)
    return times


@contextmanager
def _serving(folder: Path, stack: ExitStack) -> Iterator[tuple[int, str, int]]:
    """A broker, and a dashboard of a home with ITEMS items in a process of its own: port, address, pid."""
    broker = stack.enter_context(mosquitto.private(folder / "mosquitto", anonymous=True))
    shutil.copytree(CONFIG, folder / "config")
    items = "\n".join(f"  Item_{n}: {{type: Number, label: Sensor {n}, room: r{n % 20}}}" for n in range(ITEMS))
    rooms = "\n".join(f"  r{n}: {{label: Room {n}}}" for n in range(20))
    (folder / "config" / "home.yaml").write_text(f"rooms:\n{rooms}\nitems:\n{items}\n", encoding="utf-8")
    file = folder / "config" / "flood.yaml"
    file.write_text(
        f"bus: {{port: {broker.port}}}\nstate: {folder}/state\nhome: home.yaml\ndashboard: {{port: {free_port()}}}\n",
        encoding="utf-8",
    )
    port = int(file.read_text(encoding="utf-8").rsplit("port: ", 1)[1].rstrip("}\n"))
    command = [sys.executable, "-m", "services", "serve", "dashboard", "--config", str(file)]
    with peers.running(command, folder / "dashboard.log", lambda: peers.answers(port)) as process:
        yield broker.port, f"http://127.0.0.1:{port}", process.pid


@contextmanager
def _program(folder: Path, *arguments: str) -> Iterator[None]:
    process = subprocess.Popen([sys.executable, "-m", "tests.dashboard.flood", *arguments], start_new_session=True)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def _cpu_s(pid: int) -> float:
    """What a process has used so far, user and system."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _just_told(asking: Browser) -> tuple[float, float]:
    """The next number of messages that the dashboard tells, which is every few seconds, and when it did."""
    before = _taken(asking)
    peers.wait_until(lambda: _taken(asking) != before, "its next word of itself")
    return _taken(asking), time.monotonic()


def _taken(asking: Browser) -> float:
    """Messages that the dashboard has taken, as it tells of itself."""
    text = asking.get("/api/states", params={"topics": "service/dashboard/info"}).json()["service/dashboard/info"]
    return float(json.loads(text)["counters"]["received"])
