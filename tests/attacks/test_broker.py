"""What one client does to the others at a real mosquitto with our own files: floods, monsters, false names."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from services import history
from services.apartment.home import Home
from services.aside import Aside
from services.bus.mqtt import MqttBus
from services.client import Client
from services.config import BusSettings
from services.peers import Missing, mosquitto, wait_until
from services.process import address, client_id
from services.runner import Runner
from services.storage import open_storage
from tests.attacks.flooding import LIMIT_S, client, granted, slowest_of_a_hundred

pytestmark = pytest.mark.mosquitto
BOUND_S = 0.1  # what the others' slowest of a hundred may take
TRIES = 3  # a machine that does something else for a moment is no fault of the broker
WAITING = 20  # messages


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[mosquitto.Broker]:
    """With accounts: nobody comes without one."""
    try:
        with mosquitto.private(tmp_path / "mosquitto") as running:
            yield running
    except Missing as missing:
        pytest.skip(str(missing))


def test_five_thousand_messages_a_second_of_one_client_do_not_hold_up_the_others(broker: mosquitto.Broker) -> None:
    """Somebody listens to the flood too, as the bridge does."""
    figures: list[float] = []
    while len(figures) < TRIES and min(figures, default=BOUND_S) >= BOUND_S:
        figures.append(slowest_of_a_hundred(broker))
    assert min(figures) < BOUND_S


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


def test_a_question_that_an_intruder_left_retained_is_refused_by_the_service_that_comes_later(
    broker: mosquitto.Broker, tmp_path: Path
) -> None:
    topic, left, asked = "history/get", '{"id": "left"}', '{"id": "asked"}'
    open_storage("sqlite:///bus.db", tmp_path).close()
    config = history.Config(url="sqlite:///bus.db", folder=tmp_path, home=Home(items={}))
    with client(broker, "openhab") as intruder:
        intruder.say(topic, left, retain=True)
        with client(broker, "history") as own, history.start(config, own.bus.post) as service:
            runner = Runner("history", service, own.bus, time.time, Aside(None))
            intruder.subscribe("history/reply/+")

            def answered(name: str) -> bool:
                runner.turn(0.05)
                intruder.pump()
                return any(message.topic == f"history/reply/{name}" for message in intruder.seen)

            wait_until(lambda: answered("left") or runner.counters["bad"] > 0, "what was left", LIMIT_S)
            wait_until(lambda: intruder.say(topic, asked) or answered("asked"), "an answer", LIMIT_S)  # type: ignore[func-returns-value]
            told = [json.loads(message.payload) for message in intruder.seen if message.topic == "history/reply/left"]
            assert all("retained" in answer["error"] and not answer["samples"] for answer in told)
            assert runner.counters["bad"] > 0
