"""restoreOnStartup on a real broker that has lost everything: the group is back, retained, and no row is new.

On one that has kept everything, hours of it, nothing is restored: the newer states come behind what waits.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from pydantic import SecretStr

from services import peers
from services.apartment.home import Home, Item
from services.aside import Aside
from services.bus import Message
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.client import Client, connected
from services.config import BusSettings
from services.peers import free_port, mosquitto
from services.persistence import Config, start
from services.runner import Runner
from services.topics import HOME_STATE, SERVICE_STATUS
from tests.databases import Database
from tests.persistence.test_service import url
from tests.persistence.trials import Publisher

KINDS = {"Light": "Switch", "Dimmer": "Dimmer", "Temp": "Number:Temperature", "Lamp": "Color", "Note": "String"}
STATES = {"Light": "ON", "Dimmer": "40", "Temp": "21.5 °C", "Lamp": "120,100,50", "Note": "Salón"}
FILTER = HOME_STATE.filter
BACKLOG = 20_000  # messages: many turns of the writer, which has no patience at all then
HOME = Home(
    groups={"gRestored": "Restored"},
    items={
        **{name: Item(type=kind, label=name, groups=("gRestored",)) for name, kind in KINDS.items()},
        "Door": Item(type="Contact", label="Door"),
    },
)
RULES = """\
items:
  - {items: [gRestored*], strategy: [everyChange, restoreOnStartup]}
  - {items: [Door], strategy: [everyChange]}
"""


@contextmanager
def writer(folder: Path, database: Database, port: int, patience_s: float = 1.0) -> Iterator[Runner]:
    """The service on the broker; its turns are the caller's."""
    password = database.address.password
    config = Config(
        url=url(database.address), password=SecretStr(password) if password else None, home=HOME, folder=folder,
        strategies=Path("persistence.yaml"), restore_after_s=patience_s,
    )  # fmt: skip
    with ExitStack() as stack:
        service = stack.enter_context(start(config, lambda message: None))
        birth = SERVICE_STATUS.message("online", service="persistence")
        bus = MqttBus(Address("persistence", port=port, protocol=4, durable=True), birth=birth)
        stack.callback(bus.close)
        yield Runner("persistence", service, bus, time.time, Aside(None))


def until(runner: Runner, reached: Callable[[], bool], what: str) -> None:
    def turned() -> bool:
        runner.turn(0.05)
        return reached()

    peers.wait_until(turned, what, 60.0)


def retained(port: int) -> dict[str, str]:
    """What the broker tells somebody who comes now."""
    with connected(BusSettings(port=port), [FILTER]) as newcomer:
        newcomer.bus.subscribe(["test/end"])
        newcomer.say("test/end", "x")
        newcomer.until(lambda message: message.topic == "test/end")
        return {one.topic.split("/")[1]: one.payload.decode() for one in newcomer.seen if one.retain}


def say(client: Client, item: str, text: str) -> None:
    client.publish(HOME_STATE.message(text, item=item))


def rows(database: Database) -> int:
    return int(database.rows("SELECT COUNT(*) FROM sample")[0][0])


@pytest.mark.mosquitto
def test_a_broker_that_lost_everything_gets_the_group_back_and_live_publishers_win(
    database: Database, tmp_path: Path
) -> None:
    (tmp_path / "persistence.yaml").write_text(RULES)
    port = free_port()
    try:
        with mosquitto.private(tmp_path / "m", port=port, anonymous=True), writer(tmp_path, database, port) as runner:
            until(runner, lambda: runner.bus.connected, "the broker")
            with connected(BusSettings(port=port)) as client:
                for item, text in {**STATES, "Door": "OPEN"}.items():
                    say(client, item, text)
                until(runner, lambda: rows(database) == len(STATES) + 1, "the rows")
            assert retained(port) == {**STATES, "Door": "OPEN"}
    except peers.Missing as missing:
        pytest.skip(str(missing))
    (tmp_path / "m" / "mosquitto.db").unlink()
    with mosquitto.private(tmp_path / "m", port=port, anonymous=True), connected(BusSettings(port=port)) as live:
        assert retained(port) == {}
        say(live, "Light", "OFF")
        with writer(tmp_path, database, port) as runner:
            counters = runner.service.counters  # type: ignore[attr-defined]
            until(runner, lambda: counters["restored"] > 0, "the restoring")
            assert counters["restored"] == len(STATES) - 1
            wanted = {**STATES, "Light": "OFF"}
            until(runner, lambda: retained(port) == wanted, "the states")
            say(live, "Dimmer", "60")
            until(runner, lambda: rows(database) == len(STATES) + 3, "the last row")
    last = dict(database.rows("SELECT i.name, COALESCE(s.text, s.num) FROM sample s JOIN item i USING (item_id) "
                              "ORDER BY s.time"))  # fmt: skip
    assert {"Light": last["Light"], "Dimmer": float(last["Dimmer"])} == {"Light": "OFF", "Dimmer": 60.0}


@pytest.mark.mosquitto
def test_states_behind_a_long_backlog_are_not_overwritten_and_what_is_missing_is_restored(
    database: Database, tmp_path: Path
) -> None:
    (tmp_path / "persistence.yaml").write_text(RULES)
    with ExitStack() as stack:
        port = free_port()
        try:
            stack.enter_context(mosquitto.private(tmp_path / "m", port=port, anonymous=True))
        except peers.Missing as missing:
            pytest.skip(str(missing))
        live = stack.enter_context(connected(BusSettings(port=port)))
        with writer(tmp_path, database, port) as runner:
            until(runner, lambda: runner.bus.listens, "the broker")
            for item, text in STATES.items():
                say(live, item, text)
            until(runner, lambda: rows(database) == len(STATES), "the rows")
        live.publish(Message(HOME_STATE.name(item="Lamp"), retain=True))  # the broker has it no more
        with Publisher(port, rate=BACKLOG, burst=500) as publisher:
            publisher.go_on(BACKLOG)
        say(live, "Light", "OFF")
        say(live, "Note", "Cocina")
        newer = {**STATES, "Light": "OFF", "Note": "Cocina"}
        peers.wait_until(lambda: retained(port) == {k: v for k, v in newer.items() if k != "Lamp"}, "the broker", 60.0)
        told = rows(database) + len(publisher.acknowledged) + 2
        with writer(tmp_path, database, port, patience_s=0.0) as runner:
            counters = runner.service.counters  # type: ignore[attr-defined]
            until(runner, lambda: counters["restored"] > 0, "the restoring")
            assert counters["restored"] == 1
            assert rows(database) == told
            until(runner, lambda: retained(port) == newer, "the states")
        assert rows(database) == told
