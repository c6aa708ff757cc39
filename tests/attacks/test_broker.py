"""What one client does to the others at a real mosquitto with our own files: floods, monsters, false names."""

from __future__ import annotations

import subprocess
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.client import Client
from services.config import BusSettings
from services.peers import Missing, mosquitto, program, wait_until
from services.process import address, client_id

pytestmark = pytest.mark.mosquitto
RATE, PIECES = 5000, 200  # messages a second, in so many pieces
BOUND_S = 0.1  # what the others' slowest of a hundred may take
ROUNDS, LONG_S = 300, 1.0  # at least
TRIES = 3  # a machine that does something else for a moment is no fault of the broker
LIMIT_S = 20.0
WAITING = 20  # messages


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[mosquitto.Broker]:
    """With accounts: nobody comes without one."""
    try:
        with mosquitto.private(tmp_path / "mosquitto") as running:
            yield running
    except Missing as missing:
        pytest.skip(str(missing))


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
    folder.mkdir()
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


def round_trips(asker: Client, answerer: Client) -> list[float]:
    """How long a question and its answer take, one after the other."""
    times = []
    end = time.monotonic() + LONG_S
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


def test_five_thousand_messages_a_second_of_one_client_do_not_hold_up_the_others(broker: mosquitto.Broker) -> None:
    """Somebody listens to the flood too, as the bridge does."""
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
            for _ in range(TRIES):
                times = round_trips(asker, answerer)
                if times[len(times) * 99 // 100] < BOUND_S:
                    break
            wait_until(lambda: bool(listener.pump(0.02)) and len(listener.seen) > RATE // 2, "its water", LIMIT_S)
        assert times[len(times) * 99 // 100] < BOUND_S
        assert given[0] >= len(listener.seen)


def test_a_monster_costs_its_sender_the_connection_and_nobody_else(broker: mosquitto.Broker) -> None:
    with client(broker, "operator") as listener, client(broker, "camera-ip1") as sender:
        listener.subscribe("camera/ip1/snapshot")
        granted(listener, sender, "camera/ip1/snapshot")
        sender.say("camera/ip1/snapshot", b"x" * 4_194_304, qos=0)
        listener.until(lambda m: len(m.payload) == 4_194_304, LIMIT_S)
        before = sender.bus.connections  # type: ignore[attr-defined]
        sender.say("camera/ip1/snapshot", b"x" * 6_000_000, qos=0)
        wait_until(lambda: bool(sender.pump(0.05)) or sender.bus.connections > before, "it is thrown out", LIMIT_S)  # type: ignore[attr-defined]
        listener.seen.clear()
        granted(listener, sender, "camera/ip1/snapshot")
        assert not [one for one in listener.seen if len(one.payload) > 4_194_304]


def test_nobody_takes_what_waits_for_a_service_by_coming_under_its_name(
    broker: mosquitto.Broker, tmp_path: Path
) -> None:
    settings = BusSettings(port=broker.port, accounts=broker.passwords)  # type: ignore[arg-type]
    own = client_id(settings, "persistence", tmp_path)
    assert own == client_id(settings, "persistence", tmp_path), "in its next life too"
    assert own != "persistence"
    assert (tmp_path / "persistence/client").stat().st_mode & 0o777 == 0o600
    at = address(settings, own, "persistence", durable=True, protocol=4)
    with client(broker, "openhab") as openhab:
        first = MqttBus(at)
        first.subscribe(["home/+/state"])
        granted(Client(first), openhab, "home/Lab_Lamp/state")
        first.close()
        for number in range(WAITING):
            openhab.say("home/Lab_Lamp/state", f"{number}")
        with client(broker, "robot", "persistence") as thief:
            thief.pump(0.1)
            assert thief.seen == []
        second = MqttBus(at)
        second.subscribe(["home/+/state"])
        came: list[int] = []

        def all_came() -> bool:
            came.extend(int(one.payload) for one in second.receive(0.02) if one.payload.isdigit())
            return len(came) >= WAITING

        wait_until(all_came, "what waited", LIMIT_S)
        second.close()
    assert came == list(range(WAITING))
