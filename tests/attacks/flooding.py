"""A client of a real broker that floods it, and how long the others then wait. For tests and `make soak`."""

from __future__ import annotations

import random
import subprocess
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.client import Client
from services.peers import mosquitto, program, wait_until

RATE, PIECES = 5000, 200  # messages a second, in so many pieces
ROUNDS, LONG_S = 300, 1.0  # at least
LIMIT_S = 20.0


@contextmanager
def client(broker: mosquitto.Broker, account: str, name: str = "", *, durable: bool = False) -> Iterator[Client]:
    who = name or f"{account}-{uuid.uuid4().hex[:6]}"
    password = broker.passwords[account]
    bus = MqttBus(Address(who, port=broker.port, user=account, password=password, durable=durable))
    try:
        wait_until(lambda: bool(bus.receive(0.02)) or bus.connected, f"{account} at the broker", LIMIT_S)
        yield Client(bus)
    finally:
        bus.close()


@contextmanager
def flood(broker: mosquitto.Broker, account: str, topic: str) -> Iterator[list[int]]:
    """`RATE` messages a second by mosquitto's own client until the end of the block; yields how many it was given."""
    folder = broker.folder / "flood"
    folder.mkdir(exist_ok=True)
    (folder / "mosquitto_pub").write_text(f"-u {account}\n-P {broker.passwords[account]}\n")
    command = [program("mosquitto_pub", "mosquitto-clients"), "-p", str(broker.port), "-t", topic, "-l"]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, env={"XDG_CONFIG_HOME": str(folder)})
    given, stop = [0], threading.Event()

    def pour() -> None:
        piece = b"ON\n" * (RATE // PIECES)
        begin = time.monotonic()
        assert process.stdin is not None
        while not stop.is_set():
            process.stdin.write(piece)
            process.stdin.flush()
            given[0] += RATE // PIECES
            stop.wait(begin + given[0] / RATE - time.monotonic())

    thread = threading.Thread(target=pour, name="flood")
    thread.start()
    try:
        yield given
    finally:
        stop.set()
        thread.join()
        assert process.stdin is not None
        process.stdin.close()
        process.wait(LIMIT_S)


def granted(listener: Client, speaker: Client, topic: str) -> None:
    """Waits until what one says reaches the other."""

    def reaches() -> bool:
        speaker.say(topic, "granted")
        return any(message.payload == b"granted" for message in listener.pump(0.05))

    wait_until(reaches, f"a subscription of {topic}", LIMIT_S)


def round_trips(asker: Client, answerer: Client, long_s: float) -> list[float]:
    """How long a question and its answer take, one after the other."""
    times = []
    end = time.monotonic() + long_s
    while len(times) < ROUNDS or time.monotonic() < end:
        number = len(times)
        begin = time.monotonic()
        asker.say("history/get", f"{number}")
        answerer.until(lambda m, number=number: m.payload == str(number).encode(), LIMIT_S)  # type: ignore[misc]
        answerer.say("history/reply/a", f"{number}")
        asker.until(lambda m, number=number: m.payload == str(number).encode(), LIMIT_S)  # type: ignore[misc]
        times.append(time.monotonic() - begin)
        asker.seen.clear()
        answerer.seen.clear()
    return sorted(times)


def slowest_of_a_hundred(broker: mosquitto.Broker, long_s: float = LONG_S) -> float:
    """Seconds that a question and its answer take, but for one in a hundred, while one floods and one listens."""
    with (
        client(broker, "operator") as asker,
        client(broker, "history") as answerer,
        client(broker, "bridge") as listener,
    ):
        asker.subscribe("history/reply/a")
        answerer.subscribe("history/get")
        listener.subscribe("home/+/state")
        granted(answerer, asker, "history/get")
        granted(asker, answerer, "history/reply/a")
        with flood(broker, "openhab", "home/Lab_Lamp/state") as given:
            wait_until(lambda: bool(listener.pump(0.02)), "the flood", LIMIT_S)
            times = round_trips(asker, answerer, long_s)
            wait_until(lambda: bool(listener.pump(0.02)) and len(listener.seen) > RATE // 2, "its water", LIMIT_S)
        assert given[0] >= len(listener.seen)
        return times[len(times) * 99 // 100]


@contextmanager
def floods() -> Iterator[Callable[[random.Random], float]]:
    """For `make soak`: each turn is ten seconds of flood; milliseconds."""
    with tempfile.TemporaryDirectory() as name, mosquitto.private(Path(name)) as broker:
        yield lambda _: slowest_of_a_hundred(broker, 10.0) * 1000
