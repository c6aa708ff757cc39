"""What the writer's figures are measured with: publishers, subscribers that only acknowledge, and the writer itself.

All of it is QoS 1 over MQTT 3.1.1, 1,000 items, on a real broker. Not here: which figures there are (`bench.py`).
"""

from __future__ import annotations

import multiprocessing
import random
import socket
import statistics
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import paho.mqtt.client as paho

from services.apartment.home import Home, Item
from services.aside import Aside
from services.bus.connection import Address as BusAddress
from services.bus.mqtt import MqttBus
from services.persistence import Config
from services.persistence.service import Persistence
from services.persistence.writers import Writers
from services.runner import Runner
from services.storage import Batch, Sample, Storage
from services.storage import Item as Stored

ITEMS = 1000
WINDOW = 500  # of the publisher, and of the acknowledgements of the second floor
HOME = Home(items={f"I{n}": Item(type="Number", label="I", persist=("everyUpdate",)) for n in range(ITEMS)})
FILTER = "home/+/state"
ONE = Writers()
Go = Callable[[], None]


@dataclass
class Row:
    """One figure; `ratio` is `value` over `floor`, where there is one."""

    name: str
    unit: str
    value: float
    floor: float | None = None
    floor_is: str = ""
    wanted: str = ""

    @property
    def ratio(self) -> float | None:
        return self.value / self.floor if self.floor else None


def publish(port: int, count: int, rate: float, start: Any) -> None:
    """A process of its own: so many messages over a bare socket; as fast as they are taken, or `rate` a second.

    Each says when it was sent, in seconds.
    """
    with socket.create_connection(("127.0.0.1", port)) as link:
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        link.sendall(b"\x10\x10\x00\x04MQTT\x04\x02\x00\x3c\x00\x04fast")
        assert link.recv(4)[3] == 0, "refused"
        start.wait()
        due, burst = time.monotonic(), 1 if rate else WINDOW
        for first in range(0, count, burst):
            if rate:
                due += random.expovariate(rate)
                threading.Event().wait(max(0.0, due - time.monotonic()))
            link.sendall(b"".join(_packet(number) for number in range(first, min(first + burst, count))))
            taken = 0
            while taken < 4 * min(burst, count - first):
                taken += len(link.recv(65536))
        link.sendall(b"\xe0\x00")


def _packet(number: int) -> bytes:
    topic = f"home/I{number % ITEMS}/state".encode()
    body = (
        len(topic).to_bytes(2, "big") + topic + (number % 65535 + 1).to_bytes(2, "big") + f"{time.time():.6f}".encode()
    )
    return b"\x32" + bytes([len(body)]) + body


@contextmanager
def publishing(port: int, count: int, rate: float = 0.0) -> Iterator[Go]:
    """A publisher that begins when it is told to, and has ended with the block."""
    context = multiprocessing.get_context("spawn")
    start = context.Event()
    process = context.Process(target=publish, args=(port, count, rate, start), daemon=True)
    process.start()
    yield start.set
    process.join(300)


def bare(port: int, count: int, *, together: int, backlog: bool) -> tuple[float, float]:
    """A floor: paho, which acknowledges each message, or so many at once.

    Messages per second, and CPU microseconds per message.
    """
    name, done, times, seen = f"bare{together}", threading.Event(), [0.0, 0.0], [0]
    held: list[int] = []
    client = _bare_client(name, together)

    def on_message(_client: Any, _data: Any, message: Any) -> None:
        if not seen[0]:
            times[:] = time.perf_counter(), time.process_time()
        seen[0] += 1
        if together > 1:
            held.append(message.mid)
            if len(held) == together or seen[0] == count:
                for mid in held:
                    client.ack(mid, 1)
                held.clear()
        if seen[0] == count:
            times.extend((time.perf_counter(), time.process_time()))
            done.set()

    if backlog:
        _subscribe_and_leave(port, name)
        with publishing(port, count) as go:
            go()
        client.on_message = on_message
        client.connect("127.0.0.1", port)
        client.loop_start()
        assert done.wait(300), f"only {seen[0]} of {count} came"
    else:
        client.on_message = on_message
        with publishing(port, count) as go:
            client.on_subscribe = lambda *_: go()
            client.connect("127.0.0.1", port)
            client.subscribe(FILTER, 1)
            client.loop_start()
            assert done.wait(300), f"only {seen[0]} of {count} came"
    client.disconnect()
    client.loop_stop()
    began, began_cpu, ended, ended_cpu = times
    return (count - 1) / (ended - began), (ended_cpu - began_cpu) / count * 1e6


def _bare_client(name: str, together: int) -> paho.Client:
    return paho.Client(
        paho.CallbackAPIVersion.VERSION2, client_id=name, clean_session=False, manual_ack=together > 1, protocol=4
    )


def _subscribe_and_leave(port: int, name: str) -> None:
    """A session that the broker keeps."""
    there = threading.Event()
    client = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id=name, clean_session=False, protocol=4)
    client.on_subscribe = lambda *_: there.set()
    client.connect("127.0.0.1", port)
    client.subscribe(FILTER, 1)
    client.loop_start()
    assert there.wait(10)
    client.disconnect()
    client.loop_stop()


class Timed:
    """A storage that notes how old each number (the time when it was sent) is once it is committed."""

    def __init__(self, real: Storage) -> None:
        self.real = real
        self.ages: list[float] = []

    def write(self, batch: Batch) -> None:
        self.real.write(batch)
        now = time.time()
        self.ages += [now - sample.num for sample in batch.samples if sample.num]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.real, name)


class Writer:
    """The service under its runner."""

    def __init__(self, port: int, storage: Storage, writers: Writers = ONE) -> None:
        self.storage = Timed(storage)
        self.storage.add_items([Stored(name, "Number") for name in HOME.items])
        config = Config(url="sqlite:///unused", home=HOME, writers=writers)
        self.service = Persistence(config, lambda: self.storage)  # type: ignore[arg-type,return-value]
        name = writers.name("writer")
        self.bus = MqttBus(BusAddress(name, port=port, protocol=4, durable=True))
        self.runner = Runner(name, self.service, self.bus, time.time, Aside(None))

    @property
    def rows(self) -> int:
        return self.service.counters["rows"]

    def connect(self) -> None:
        while not self.bus.connected:
            self.runner.turn(0.05)
        self.runner.turn(0.2)

    def until(self, stored: Callable[[], bool]) -> None:
        while not stored():
            self.runner.turn(0.05)

    def run(self, count: int) -> tuple[float, float]:
        """Rows per second from the first to the last, and CPU seconds of this process."""
        self.until(lambda: self.rows > 0)
        first, already, cpu = time.perf_counter(), self.rows, time.process_time()
        self.until(lambda: self.rows >= count)
        return (count - already) / (time.perf_counter() - first), time.process_time() - cpu

    def close(self) -> None:
        self.bus.close()
        self.service.connection.close()


def stores(port: int, storage: Storage, count: int, *, backlog: bool) -> tuple[float, float]:
    """Our writer: messages per second until they are committed, and CPU microseconds per message."""
    if backlog:
        _subscribe_and_leave(port, "writer")
        with publishing(port, count) as go:
            go()
        writer = Writer(port, storage)
        rate, cpu = writer.run(count)
    else:
        writer = Writer(port, storage)
        writer.connect()
        with publishing(port, count) as go:
            go()
            rate, cpu = writer.run(count)
    writer.close()
    return rate, cpu / count * 1e6


def latency(port: int, storage: Storage, rate: float, seconds: float) -> tuple[float, float]:
    """From being sent to being committed, milliseconds: median and 99th percentile."""
    writer, count = Writer(port, storage), int(rate * seconds)
    writer.connect()
    with publishing(port, count, rate) as go:
        go()
        writer.run(count)
    writer.close()
    return _middle_and_99(writer.storage.ages)


def commits(storage: Storage, rate: float, seconds: float) -> tuple[float, float]:
    """A floor: one row after the other, each committed, as the database takes them; milliseconds as of `latency`."""
    storage.add_items([Stored("Floor", "Number")])
    ages, due = [], time.monotonic()
    for _ in range(int(rate * seconds)):
        due += random.expovariate(rate)
        threading.Event().wait(max(0.0, due - time.monotonic()))
        began = time.perf_counter()
        storage.write(Batch([Sample("Floor", time.time_ns() // 1000, 1.0, None)]))
        ages.append(time.perf_counter() - began)
    storage.close()
    return _middle_and_99(ages)


def _middle_and_99(seconds: list[float]) -> tuple[float, float]:
    seconds = sorted(seconds)
    return 1000 * statistics.median(seconds), 1000 * seconds[int(len(seconds) * 0.99)]
