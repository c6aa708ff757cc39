"""What the service tells about its broker: a queue that fills up, messages dropped, a session forgotten."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from services import peers
from services.apartment.home import Home, Item
from services.aside import Aside
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.peers import free_port, mosquitto
from services.persistence import Config, start
from services.persistence.broker import DROPPED, HELD, Watch
from services.runner import Runner
from services.storage import open_storage
from tests.persistence.trials import Publisher

HOUR = 3600.0


def watch(limit: int = 1000) -> tuple[Watch, Counter[str]]:
    counters: Counter[str] = Counter()
    return Watch(limit, counters), counters


def test_a_rise_of_the_brokers_count_is_told_for_an_hour() -> None:
    one, counters = watch()
    assert one.heard(DROPPED, b"40", 0.0) is None  # nobody knows since when
    assert one.heard(DROPPED, b"40", 10.0) is None
    assert one.heard(DROPPED, b"55", 20.0) == "the broker dropped 15 messages, for us or for others"
    assert counters["broker_dropped"] == 15
    assert one.diagnostic(21.0).level == 2
    assert one.diagnostic(20.0 + HOUR).level == 0


@pytest.mark.parametrize(("before", "now", "lost"), [(0, b"7", 7), (100, b"107", 7), (100, b"7", 7), (7, b"7", 0)])
def test_what_was_dropped_while_we_were_away_is_told(before: int, now: bytes, lost: int) -> None:
    """Less than before: the broker was started anew."""
    one, counters = watch()
    one.learn(before)
    one.heard(DROPPED, now, 0.0)
    assert counters["broker_dropped"] == lost


def test_a_queue_that_is_half_full_is_told_before_it_overflows() -> None:
    one, _ = watch(limit=1000)
    one.heard(HELD, b"499", 0.0)
    assert one.diagnostic(1.0).level == 0
    one.heard(HELD, b"501", 2.0)
    assert one.diagnostic(3.0).level == 1
    assert "at 1000 it drops the newest" in one.diagnostic(3.0).message


def test_an_outage_of_the_database_says_how_long_the_queue_will_do() -> None:
    one, _ = watch(limit=100_000)
    assert one.waits(0.0) == "the broker keeps what comes"
    one.goes_on()
    for n in range(1300):
        one.came(1.0 + n / 10)
    one.waits(200.0)
    assert one.waits(200.0 + HOUR) == "about 36000 messages wait at the broker, it drops the newest in 1.8 h"


def test_what_is_no_number_is_nothing() -> None:
    one, counters = watch()
    assert one.heard(DROPPED, b"", 0.0) is None
    assert one.heard(DROPPED, b"-3", 0.0) is None
    assert not counters


class Writer:
    """The service under its runner on a real broker."""

    def __init__(self, folder: Path, broker: mosquitto.Broker, stack: ExitStack) -> None:
        items = {f"I{n}": Item(type="Number", label="I", persist=("everyUpdate",)) for n in range(100)}
        self.folder = folder
        config = Config(url="sqlite:///bus.db", home=Home(items=items), folder=folder)
        self.service = stack.enter_context(start(config, lambda message: None))
        account = {"user": "persistence", "password": broker.passwords["persistence"]}  # it may read $SYS
        self.bus = MqttBus(Address("persistence", port=broker.port, protocol=4, durable=True, **account))
        stack.callback(self.bus.close)
        self.runner = Runner("persistence", self.service, self.bus, time.time, Aside(None))

    def until(self, reached: Callable[[], bool]) -> None:
        def turned() -> bool:
            self.runner.turn(0.05)
            return reached()

        peers.wait_until(turned, "it to happen", 60.0)

    def counts(self, counter: str) -> Callable[[], bool]:
        return lambda: self.service.counters[counter] > 0

    def dropped(self) -> int | None:
        """What the database remembers of the broker's count."""
        storage = open_storage(f"sqlite:///{self.folder}/bus.db")
        try:
            return storage.noted("persistence", "dropped")
        finally:
            storage.close()


@contextmanager
def writer(folder: Path, broker: mosquitto.Broker) -> Iterator[Writer]:
    with ExitStack() as stack:
        yield Writer(folder, broker, stack)


@pytest.mark.mosquitto
def test_what_a_real_broker_drops_or_forgets_is_noticed(tmp_path: Path) -> None:
    conf = tmp_path / "small.conf"
    text = mosquitto.CONF.read_text(encoding="utf-8")
    text = re.sub(r"(?m)^max_queued_messages \d+", "max_queued_messages 50", text)
    conf.write_text(text.replace("sys_interval 10", "sys_interval 1"))
    port = free_port()
    with ExitStack() as running:
        try:
            broker = running.enter_context(mosquitto.private(tmp_path / "m", port=port, anonymous=True, conf=conf))
        except peers.Missing as missing:
            pytest.skip(str(missing))
        with writer(tmp_path, broker) as first, Publisher(port) as publisher:
            first.until(first.counts("rows"))
            first.until(lambda: first.dropped() is not None)
            assert first.service.counters["sessions_lost"] == 0
            assert publisher.said
        with Publisher(port) as publisher:  # nobody listens: more than the queue holds
            publisher.go_on(2000)
        with writer(tmp_path, broker) as second:
            second.until(second.counts("broker_dropped"))
            assert second.service.counters["sessions_lost"] == 0
    (tmp_path / "m" / "mosquitto.db").unlink()
    again = mosquitto.private(tmp_path / "m", port=port, anonymous=True, conf=conf)
    with again as broker, writer(tmp_path, broker) as third:
        third.until(third.counts("sessions_lost"))
