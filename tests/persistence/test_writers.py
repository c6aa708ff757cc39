"""Several writers: each takes its own, nothing is lost or doubled, and split by item the order stays."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import pytest
from pydantic import SecretStr, ValidationError

from services import peers
from services.apartment.home import Home, Item
from services.aside import Aside
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.errors import ConfigError
from services.peers import mariadb, mosquitto
from services.persistence import Config, start
from services.persistence.writers import Writers
from services.runner import Runner
from services.storage import open_storage, read_address
from services.topics import DIAGNOSTICS, HOME_STATE
from tests.databases import fresh_mariadb
from tests.persistence.trials import ITEMS, Publisher

EVERY = Home(items={f"I{n}": Item(type="Number", label="I", persist=("everyUpdate",)) for n in range(ITEMS)})
MESSAGES = 2000


def of(count: int, by: str) -> list[Writers]:
    return [Writers(count=count, number=number, by=by) for number in range(count)]  # type: ignore[arg-type]


def test_every_item_is_one_writers_and_all_else_the_firsts() -> None:
    filters = [one.filters(EVERY) for one in of(3, "item")]
    heard = Counter(one for filters_of_one in filters for one in filters_of_one)
    assert set(heard.values()) == {1}
    assert {HOME_STATE.name(item=name) for name in EVERY.items} < set(heard)
    assert [DIAGNOSTICS.filter in one for one in filters] == [True, False, False]
    assert min(map(len, filters)) > ITEMS / 6


def test_no_two_writers_have_a_time_in_common() -> None:
    writers, times = of(3, "share"), Counter[int]()
    last = [0, 0, 0]
    for now in [1000] * 50 + [900] * 50 + [2000] * 50:
        for number, one in enumerate(writers):
            last[number] = one.next_time(now, last[number])
            assert last[number] >= now
            times[last[number]] += 1
    assert set(times.values()) == {1}
    assert [Writers().next_time(at, 10) for at in (5, 11, 30)] == [11, 11, 30]


def test_what_needs_the_last_value_cannot_be_dealt_out() -> None:
    home = Home(items={"Light": Item(type="Switch", label="L"), "Fan": Item(type="Switch", label="F", persist=())})
    config = Config(url="sqlite:///unused", home=home, writers=Writers(count=2, by="share"))
    told = "by: expected item, or everyUpdate alone without a filter for Light, got share"
    with pytest.raises(ConfigError, match=told), start(config, lambda message: None):
        pass


def test_a_writer_that_is_not_among_them_is_told() -> None:
    with pytest.raises(ValidationError, match="expected a number below 2, got 2"):
        Writers(count=2, number=2)


@contextmanager
def running(server: mariadb.Server, port: int, writers: Writers) -> Iterator[Runner]:
    """One writer with a client of its own; its turns are the caller's."""
    config = Config(url=server.url, password=SecretStr(server.password), home=EVERY, writers=writers)
    client = f"{writers.by}{writers.number}"
    with ExitStack() as stack:
        service = stack.enter_context(start(config, lambda message: None))
        bus = MqttBus(Address(client, port=port, protocol=4, durable=True))
        stack.callback(bus.close)
        runner = Runner(client, service, bus, time.time, Aside(None))
        while not bus.connected:
            runner.turn(0.05)
        runner.turn(0.5)
        yield runner


def until(reached: Callable[[], bool], runners: list[Runner]) -> None:
    def turned() -> bool:
        for runner in runners:
            runner.turn(0.01)
        return reached()

    peers.wait_until(turned, "the rows", 120.0)  # the machine may be busy with other things


@pytest.mark.mosquitto
@pytest.mark.mariadb
@pytest.mark.parametrize("by", ["item", "share"])
def test_nothing_is_lost_or_doubled_although_one_leaves_for_a_while(
    by: str, mariadb_server: mariadb.Server, mosquitto_broker: mosquitto.Broker
) -> None:
    fresh_mariadb(mariadb_server)
    port, (first, second) = mosquitto_broker.port, of(2, by)
    storage = open_storage(read_address(mariadb_server.url, password=mariadb_server.password))

    def rows() -> list[tuple[str, int]]:
        found = storage.read("SELECT i.name, s.num FROM sample s JOIN item i USING (item_id) ORDER BY s.time")
        return [(str(name), int(num)) for name, num in found]

    with running(mariadb_server, port, first) as one:
        with running(mariadb_server, port, second) as other, Publisher(port) as publisher:
            until(lambda: publisher.said >= MESSAGES, [one, other])
            until(lambda: min(one.service.counters["rows"], other.service.counters["rows"]) > 0, [one, other])  # type: ignore[attr-defined]
        with Publisher(port) as later:  # the second is away; the broker keeps its share
            until(lambda: later.said >= MESSAGES, [one])
        wanted = Counter([*publisher.acknowledged, *later.acknowledged])
        with running(mariadb_server, port, second) as other:
            until(lambda: len(rows()) >= wanted.total(), [one, other])
            until(lambda: True, [one, other])
    found = rows()
    storage.close()
    assert Counter(number for _, number in found) == wanted
    if by == "item":
        for name in EVERY.items:
            numbers = [number for item, number in found if item == name]
            again = numbers.index(min(numbers), 1)  # where the later publisher began to count anew
            assert numbers[:again] == sorted(numbers[:again])
            assert numbers[again:] == sorted(numbers[again:])
