"""The writer's figures for `make bench`: how fast it stores, beside floors measured in the same run, and latencies.

MariaDB writes each commit to its disk before it answers; a message is acknowledged after its commit.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

from services import payloads
from services.history import answers
from services.payloads.history import HistoryGet
from services.peers import mariadb, mosquitto
from services.persistence.openhab_tables import LAYOUTS
from services.persistence.writers import Writers
from services.storage import Address, Batch, Storage, mysql_text, open_storage, read_address
from services.storage import Item as Stored
from tests.persistence import figures
from tests.persistence.figures import HOME, Row

RATES = (100, 1000)  # messages per second at which latency is measured
LATENCY_S = 5.0
READ_EVERY_S = 0.05  # a question to the history
WRITERS = (1, 2, 4)
Found = dict[str, list[float]]


class PerItem:
    """Storage with a real table for each item, as OpenHAB's JDBC service has them: the samples go there."""

    def __init__(self, real: Storage) -> None:
        self._real = real
        self._layout = LAYOUTS["jdbc"]

    def make(self) -> None:
        self._real.add_items([Stored(name, "Number") for name in HOME.items])
        time, value = self._layout.columns
        for item in self._real.items.values():
            self._real.change(
                f"CREATE TABLE IF NOT EXISTS {self._layout.table(item.item_id)} "
                f"({time} {self._layout.time_type.replace('(3)', '(6)')}, {value} DOUBLE, PRIMARY KEY ({time}))"
            )

    def write(self, batch: Batch) -> None:
        by_item: dict[str, list[str]] = {}
        for one in batch.samples:
            by_item.setdefault(one.item, []).append(f"(FROM_UNIXTIME({one.time / 1e6:.6f}),{one.num!r})")
        time, value = self._layout.columns
        rest = Batch(rows=batch.rows, seen=batch.seen)
        self._real.change(
            *(
                f"INSERT INTO {self._layout.table(self._real.items[item].item_id)} ({time}, {value}) "
                f"VALUES {','.join(values)} ON DUPLICATE KEY UPDATE {value}=VALUES({value})"
                for item, values in by_item.items()
            ),
            *mysql_text.inserts(rest, self._real.items, self._real.quote),
        )

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)


def ask(address: Address, stop: Any) -> None:
    """A process of its own: somebody looks at the last hour of one item after the other, as samples and as means."""
    with closing(open_storage(address)) as storage:
        while not stop.is_set():
            for item in HOME.items:
                now = time.time()
                for every in (None, 60.0):
                    question = HistoryGet(id="q", item=item, since=payloads.stamp(now - 3600), every=every)
                    answers.answer(storage, question, now)
                if stop.wait(READ_EVERY_S):
                    break


@contextmanager
def asked(address: Address) -> Iterator[None]:
    """History is read meanwhile."""
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    process = context.Process(target=ask, args=(address, stop), daemon=True)
    process.start()
    yield
    stop.set()
    process.join(30)


def one_of_them(port: int, address: Address, writers: Writers, shared: tuple[Any, Any, Any], count: int) -> None:
    """A process of its own: one of several writers, until they have stored all together."""
    stored, ready, times = shared
    writer = figures.Writer(port, open_storage(address), writers)
    writer.connect()
    ready.release()
    began = told = 0

    def all_stored() -> bool:
        nonlocal began, told
        if writer.rows != told:
            began = began or time.time_ns()
            with stored.get_lock():
                stored.value += writer.rows - told
            told = writer.rows
        return bool(stored.value >= count)

    writer.until(all_stored)
    times.put((began or time.time_ns(), time.time_ns()))
    writer.close()


def together(port: int, address: Address, count: int, number: int, by: str) -> float:
    """So many writers, live: messages per second that all of them store together."""
    context = multiprocessing.get_context("spawn")
    shared = context.Value("q", 0), context.Semaphore(0), context.Queue()
    writers = [Writers(count=number, number=n, by=by) for n in range(number)]  # type: ignore[arg-type]
    processes = [context.Process(target=one_of_them, args=(port, address, one, shared, count)) for one in writers]
    for process in processes:
        process.start()
        assert shared[1].acquire(timeout=120)
    with figures.publishing(port, count) as go:
        go()
        spans = [shared[2].get(timeout=300) for _ in processes]
    for process in processes:
        process.join(30)
    return count / (max(end for _, end in spans) - min(began for began, _ in spans)) * 1e9


class Bench:
    """One run after the other; each broker is fresh, the databases fill up."""

    def __init__(self, folder: Path, server: mariadb.Server, messages: int) -> None:
        self._folder = folder
        self._messages = messages
        self._address = read_address(server.url, password=server.password)
        with closing(open_storage(self._address)) as storage:
            PerItem(storage).make()
        self._brokers = 0
        self.found: Found = {}

    def _note(self, name: str, measure: Callable[[int], tuple[float, ...]]) -> None:
        self._brokers += 1
        with mosquitto.private(self._folder / f"m{self._brokers}", anonymous=True) as broker:
            for number, value in enumerate(measure(broker.port)):
                self.found.setdefault(f"{name}/{number}", []).append(value)

    def run(self, run: int) -> None:
        """All figures once, floors between them."""
        count = self._messages
        maria = self._address
        lite = read_address(f"sqlite:///{self._folder}/bus{run}.db")
        for backlog in (True, False):
            for acks in (1, 500):
                self._note(
                    f"bare{acks}{backlog}",
                    lambda p, a=acks, b=backlog: figures.bare(p, count, together=a, backlog=b),
                )  # type: ignore[misc]
            for name, address in (("MariaDB", maria), ("SQLite", lite)):
                self._note(
                    f"{name}{backlog}",
                    lambda p, a=address, b=backlog: figures.stores(p, open_storage(a), count, backlog=b),
                )  # type: ignore[misc]
        for number, value in enumerate(figures.commits(open_storage(maria), RATES[-1], LATENCY_S)):
            self.found.setdefault(f"commit/{number}", []).append(value)
        for rate in RATES:
            self._note(f"latency{rate}", lambda p, r=rate: figures.latency(p, open_storage(maria), r, LATENCY_S))  # type: ignore[misc]
        with asked(maria):
            self._note("read", lambda p: figures.latency(p, open_storage(maria), RATES[-1], LATENCY_S))
        self._note("tables", lambda p: figures.stores(p, PerItem(open_storage(maria)), count // 4, backlog=True))  # type: ignore[arg-type]
        for number in WRITERS:
            for by in ("item", "share") if number > 1 else ("item",):
                self._note(f"{number}{by}", lambda p, n=number, b=by: (together(p, maria, count // 2, n, b),))  # type: ignore[misc]


def rows(folder: Path, runs: int, messages: int) -> list[Row]:
    """All figures, medians of interleaved runs."""
    folder.mkdir(parents=True, exist_ok=True)
    logging.getLogger("services").setLevel(logging.ERROR)  # the writer rightly misses its session in each fresh broker
    with ExitStack() as stack:
        bench = Bench(folder, stack.enter_context(mariadb.private(folder / "mariadb")), messages)
        for run in range(runs):
            bench.run(run)
    return list(_rows({name: statistics.median(values) for name, values in bench.found.items()}))


def _rows(f: dict[str, float]) -> Iterator[Row]:
    each, batched = "bare paho, an ack each, the same way", "bare paho, acks by 500, the same way"
    yield Row("floor: bare paho draining, acks by 500", "msg/s", f["bare500True/0"])
    yield Row("floor: bare paho live, an ack each", "msg/s", f["bare1False/0"])
    for name in ("MariaDB", "SQLite"):
        drains, live = f[f"{name}True/0"], f[f"{name}False/0"]
        yield Row(f"{name}: drains a backlog", "msg/s", drains, f["bare500True/0"], batched, ">= 0.5, goal 0.6")
        yield Row(f"{name}: drains a backlog", "msg/s", drains, f["bare1True/0"], each)
        yield Row(f"{name}: live flat out", "msg/s", live, f["bare1False/0"], each, ">= 0.9, goal 1.0")
        yield Row(f"{name}: live flat out", "msg/s", live, f["bare500False/0"], batched)
        yield Row(f"{name}: CPU, draining", "us/msg", f[f"{name}True/1"], f["bare500True/1"], batched)
        yield Row(f"{name}: CPU, live", "us/msg", f[f"{name}False/1"], f["bare1False/1"], each)
    bare = "a row and its commit, nothing else"
    for name, key, most in (
        ("publish to commit at 100/s", "latency100", ""),
        ("publish to commit at 1000/s", "latency1000", "<= 10"),
        ("the same at 1000/s while history is read", "read", "<= 10"),
    ):
        yield Row(f"{name}, median", "ms", f[f"{key}/0"], f["commit/0"], bare)
        yield Row(f"{name}, 99 %", "ms", f[f"{key}/1"], f["commit/1"], bare, most)
    yield Row(
        "a table for each item (OpenHAB's layout): drains",
        "msg/s",
        f["tables/0"],
        f["MariaDBTrue/0"],
        "one narrow table",
    )
    alone = f["1item/0"]
    for name, value in f.items():
        if name[0] in "124" and name[1:] in ("item/0", "share/0"):
            split = "" if name[0] == "1" else ", split by item" if "item" in name else ", shared"
            yield Row(f"{name[0]} writers live{split}", "msg/s", value, alone, "one writer in a process of its own")
    yield Row("load of the machine, the last minute", "", os.getloadavg()[0])
