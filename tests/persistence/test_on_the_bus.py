"""The service under the runner: what is acknowledged when, and whose state wins on the bus."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from services.apartment.home import Home, Item
from services.aside import Aside
from services.bus.memory import Hub, MemoryBus
from services.persistence import Config, start
from services.runner import Runner
from services.topics import HOME_STATE, SERVICE_STATUS

HOME = Home(items={name: Item(type="Switch", label=name) for name in ("Light", "Fan")})


class Site:
    """A hub with the persistence on it, a publisher, and a clock that only the test moves."""

    def __init__(self, folder: Path) -> None:
        self.now = 1_769_839_200.0
        self.hub = Hub(lambda: self.now)
        self.openhab = MemoryBus(self.hub)
        self.folder = folder

    @contextmanager
    def persistence(self) -> Iterator[Runner]:
        config = Config(url="sqlite:///bus.db", home=HOME, folder=self.folder)
        birth = SERVICE_STATUS.message("online", service="persistence")
        with start(config, lambda message: None) as service:
            self.bus = MemoryBus(self.hub, birth=birth, durable=True)
            yield Runner("persistence", service, self.bus, lambda: self.now, Aside(None))
            self.bus.close()

    def says(self, item: str, text: str) -> None:
        self.openhab.publish(HOME_STATE.message(text, item=item))

    def rows(self) -> list[tuple[str, str]]:
        with closing(sqlite3.connect(self.folder / "bus.db")) as connection:
            return connection.execute(
                "SELECT name, text FROM sample JOIN item USING (item_id) ORDER BY time"
            ).fetchall()

    def retained(self) -> dict[str, bytes]:
        return {topic: message.payload for topic, message in self.hub.retained.items() if topic.startswith("home/")}


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path)


def test_nothing_is_acknowledged_before_it_is_committed(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.storage.sqlite.BUSY_S", 0.01)
    with site.persistence() as runner:
        runner.turn()
        with closing(sqlite3.connect(site.folder / "bus.db", isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            site.says("Light", "ON")
            runner.turn()
            site.says("Light", "OFF")
            site.now += 1
            runner.turn()
            waiting = [message.payload for message in site.bus.unacknowledged if message.topic.startswith("home/")]
            assert waiting == [b"ON", b"OFF"]
            assert runner.counters["unavailable"] == 2
        for _ in range(3):
            site.now += 10
            runner.turn()
        assert not [message for message in site.bus.unacknowledged if message.topic.startswith("home/")]
    assert site.rows() == [("Light", "ON"), ("Light", "OFF")]


def test_a_fresh_broker_gets_the_last_states_back_and_live_publishers_win(site: Site) -> None:
    with site.persistence() as runner:
        site.says("Light", "ON")
        site.says("Fan", "ON")
        runner.turn()
    site.hub.retained.clear()
    with site.persistence() as runner:
        runner.turn()
        site.says("Fan", "OFF")
        runner.turn()
        site.now += 2.1
        runner.turn()
        runner.turn()
        assert site.retained() == {"home/Light/state": b"ON", "home/Fan/state": b"OFF"}
        site.says("Light", "OFF")
        runner.turn()
        site.hub.down()
        site.hub.back()
        runner.turn()
        assert site.retained() == {"home/Light/state": b"OFF", "home/Fan/state": b"OFF"}
    assert site.rows() == [("Light", "ON"), ("Fan", "ON"), ("Fan", "OFF"), ("Light", "OFF")]


def test_a_reconnect_makes_no_rows(site: Site) -> None:
    with site.persistence() as runner:
        site.says("Light", "ON")
        runner.turn()
        for _ in range(3):
            site.hub.down()
            site.hub.back()
            site.now += 5
            runner.turn()
    assert site.rows() == [("Light", "ON")]
