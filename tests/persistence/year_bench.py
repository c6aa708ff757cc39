"""A year of history for `make bench`: how long questions take, and what clearing old rows costs the writer.

The rows are made by the database itself; means are made, and rows cleared, by the service's own code.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import statistics
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

from services.history import answers
from services.history.keeping import Keep, pieces
from services.history.service import PAUSE_S
from services.payloads import stamp
from services.payloads.history import HistoryGet
from services.peers import mariadb, mosquitto
from services.storage import Address, Item, Storage, keeping, open_storage, read_address
from tests.persistence import figures
from tests.persistence.figures import Row

ITEMS = 40  # 21 million rows; 200 are the 105 million of a large home
DAY, MINUTE = 86_400, 60
DAYS = 365
WIDTHS = (300, 3600)  # seconds of the kept means, as in the shipped configuration
POINT_S = 31_500  # 1,001 points of a year, made of the narrow means
HOURS_S = 32_400  # 973 points, nine hours each, of the wide ones
PIECE_DAYS = 30  # of the rows made at a time
QUESTIONS = 20
LATENCY_S = 10.0
LINE = Keep(items=("*",), raw="90d", means={"5m": "forever", "1h": "forever"})
VALUE = "20 + {0} % 1440 / 100.0 + {0} % 7 / 10.0"  # the same every day, and a little noise
FILL = {
    "mysql": "INSERT INTO sample SELECT {item}, FROM_UNIXTIME({start} + seq * 60), {value}, NULL FROM seq_0_to_{last}",
    "sqlite": "INSERT INTO sample WITH RECURSIVE c(seq) AS (SELECT 0 UNION ALL SELECT seq+1 FROM c WHERE seq<{last}) "
    "SELECT {item}, ({start} + seq * 60) * 1000000, {value}, NULL FROM c",
}


def names(count: int) -> list[str]:
    """Of the items that have a year behind them."""
    return [f"Y{number}" for number in range(count)]


def fill(storage: Storage, items: int, end: int, days: int) -> None:
    """A row a minute of each item until `end`, seconds since 1970."""
    storage.add_items([Item(name, "Number", "°C") for name in names(items)])
    for name in names(items):
        for day in range(0, days, PIECE_DAYS):
            length = min(PIECE_DAYS, days - day)
            start, last = end - (days - day) * DAY, length * DAY // MINUTE - 1
            storage.change(
                FILL[storage.dialect].format(
                    item=storage.items[name].item_id, start=start, last=last, value=VALUE.format("seq")
                )
            )


def make_means(storage: Storage, items: int, end: int, days: int) -> None:
    """Of the whole time, as the retention would have made them day by day."""
    for name in names(items):
        for day in range(0, days, PIECE_DAYS):
            start = end - (days - day) * DAY
            for width in WIDTHS:
                keeping.summarise(storage, storage.items[name], width, start, min(start + PIECE_DAYS * DAY, end))


def asked(storage: Storage, items: int, end: int, days: int, every: float | None, rng: random.Random) -> list[float]:
    """Milliseconds of each question about the last `days` of a random item."""
    took = []
    for number in range(QUESTIONS):
        since, until = stamp(end - days * DAY), stamp(end)
        question = HistoryGet(
            id=str(number), item=rng.choice(names(items)), since=since, until=until, every=every, limit=2000
        )
        began = time.perf_counter()
        answer = answers.answer(storage, question, float(end))
        took.append(1000 * (time.perf_counter() - began))
        wanted = days * DAY // (every or MINUTE)
        assert answer.error is None, answer.error
        assert abs(len(answer.samples) - wanted) <= 2, (len(answer.samples), wanted)
    return took


def clear(address: Address, items: int, now: int, cleared: Any, stop: Any) -> None:
    """A process of its own: the retention, piece after piece, as the service does it."""
    with closing(open_storage(address)) as storage:
        for done in pieces(storage, dict.fromkeys(names(items), LINE), now):
            cleared.value += done
            if stop.wait(PAUSE_S):
                return


@contextmanager
def clearing(address: Address, items: int, now: int) -> Iterator[Any]:
    """Old rows go meanwhile; gives the count of them."""
    context = multiprocessing.get_context("spawn")
    stop, cleared = context.Event(), context.Value("q", 0)
    process = context.Process(target=clear, args=(address, items, now, cleared, stop), daemon=True)
    process.start()
    while not cleared.value and process.is_alive():
        stop.wait(0.05)
    yield cleared
    stop.set()
    process.join(30)


def of_one(name: str, folder: Path, address: Address, items: int, days: int, seconds: float) -> Iterator[Row]:
    """The figures of one database."""
    rng, end = random.Random(1), int(time.time()) // DAY * DAY
    with closing(open_storage(address)) as storage:
        began = time.perf_counter()
        fill(storage, items, end, days)
        rows = items * days * DAY // MINUTE
        yield Row(
            f"{name}: rows made by the database itself, a second", f"of {rows:,}", rows / (time.perf_counter() - began)
        )
        day = asked(storage, items, end, min(days, 1), None, rng)
        raw = asked(storage, items, end, days, POINT_S, rng)
        make_means(storage, items, end, days)
        means = asked(storage, items, end, days, POINT_S, rng)
        hourly = asked(storage, items, end, days, HOURS_S, rng)
        storage.read("SELECT 1")
    yield Row(f"{name}: a day of an item, every sample, median", "ms", statistics.median(day), wanted="<= 50")
    yield Row(f"{name}: a day of an item, every sample, slowest of {QUESTIONS}", "ms", max(day))
    yield Row(
        f"{name}: a year as 973 points from hourly means, median", "ms", statistics.median(hourly), wanted="<= 150"
    )
    yield Row(f"{name}: a year as 973 points from hourly means, slowest", "ms", max(hourly))
    yield Row(
        f"{name}: a year as 1,001 points from 5-minute means, median", "ms", statistics.median(means), wanted="<= 150"
    )
    yield Row(f"{name}: a year as 1,001 points from 5-minute means, slowest", "ms", max(means))
    yield Row(f"{name}: a year as 1,000 points from the raw rows, median", "ms", statistics.median(raw))
    with ExitStack() as stack:
        broker = stack.enter_context(mosquitto.private(folder / f"m{name}", anonymous=True))
        figures.latency(broker.port, open_storage(address), 1000, 1.0)  # makes the writer's own items
        alone = figures.latency(broker.port, open_storage(address), 1000, seconds)
        with clearing(address, items, end) as cleared:
            before = cleared.value
            beside = figures.latency(broker.port, open_storage(address), 1000, seconds)
            gone = (cleared.value - before) / seconds
    yield Row(f"{name}: publish to commit at 1000/s, 99 %", "ms", alone[1])
    yield Row(
        f"{name}: the same while old rows are cleared, 99 %", "ms", beside[1], alone[1], "without clearing", "<= 50 ms"
    )
    yield Row(f"{name}: rows cleared meanwhile", "/s", gone)


def rows(folder: Path, items: int, days: int = DAYS, seconds: float = LATENCY_S) -> Iterator[Row]:
    """All figures."""
    folder.mkdir(parents=True, exist_ok=True)
    with mariadb.private(folder / "mariadb") as server:
        yield from of_one("MariaDB", folder, read_address(server.url, password=server.password), items, days, seconds)
    yield from of_one("SQLite", folder, read_address(f"sqlite:///{folder}/year.db"), items, days, seconds)
    yield Row("load of the machine, the last minute", "", os.getloadavg()[0])
