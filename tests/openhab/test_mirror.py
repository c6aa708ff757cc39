"""OpenHAB without the MQTT binding: the mirror against a stand-in of its REST interface."""

from __future__ import annotations

import os
import queue
import shutil
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from pydantic import SecretStr, ValidationError

from services.bus import Message
from services.client import connected
from services.config import BusSettings, load
from services.errors import BadMessage
from services.openhab.mirror import Config, Mirror, start
from services.openhab.rest import change_of
from services.peers import free_port, mosquitto, wait_until
from services.supervisor import Supervisor, commands, in_background, processes
from services.topics import HOME_COMMAND, HOME_SET
from tests.openhab.homes import SHIPPED, shipped
from tests.openhab.rest_stand_in import OpenHab, serving

LIMIT_S = 60.0
TOKEN = "oh.apartment.only-for-tests"


def items() -> dict[str, dict[str, Any]]:
    """The items of a site."""
    return {
        "ROS": {"type": "Group", "state": "NULL", "groupNames": []},
        "Lamp": {"type": "Switch", "state": "OFF", "groupNames": ["ROS"]},
        "Temp": {"type": "Number:Temperature", "state": "21.5 °C", "groupNames": ["ROS", "gClimate"]},
        "Door": {"type": "Contact", "state": "CLOSED", "groupNames": ["ROS"]},
        "Still": {"type": "Image", "state": "raw type (image/jpeg): 12 bytes", "groupNames": ["ROS"]},
        "Secret": {"type": "Switch", "state": "ON", "groupNames": ["gOther"]},
    }


class Runs:
    """The service with what was posted to it, as the runner would drive it."""

    def __init__(self, service: Mirror, posted: queue.SimpleQueue[Message]) -> None:
        self.service, self.posted = service, posted
        self.said: dict[str, list[str]] = {}

    def turn(self) -> None:
        """Handles what was posted."""
        while not self.posted.empty():
            for message in self.service.handle(self.posted.get(), time.time()):
                assert message.retain
                self.said.setdefault(message.topic.split("/")[1], []).append(message.payload.decode())

    def until(self, item: str, state: str) -> None:
        """Waits for a state on the bus."""
        wait_until(lambda: (self.turn(), self.said.get(item, [None])[-1] == state)[1], f"{item} {state}", LIMIT_S)

    def counted(self, key: str, wanted: int) -> None:
        """Waits for a counter."""
        wait_until(lambda: (self.turn(), self.service.counters[key] == wanted)[1], f"{key} {wanted}", LIMIT_S)

    def say(self, message: Message, age_s: float = 0.0) -> None:
        """Somebody says something on the bus."""
        now = time.time()
        assert list(self.service.handle(message._replace(received=now - age_s), now)) == []


@contextmanager
def running(port: int, **settings: Any) -> Iterator[Runs]:
    """The mirror of an OpenHAB on that port."""
    posted: queue.SimpleQueue[Message] = queue.SimpleQueue()
    config = Config(url=f"http://127.0.0.1:{port}", token=SecretStr(TOKEN), home=shipped(), **settings)
    with start(config, posted.put) as service:
        yield Runs(service, posted)


@pytest.fixture
def openhab() -> OpenHab:
    """A site of 3 or later."""
    return OpenHab(items(), TOKEN, "openhab")


@pytest.fixture
def runs(openhab: OpenHab) -> Iterator[Runs]:
    """The mirror beside it, connected."""
    with serving(openhab) as port, running(port) as mirror:
        mirror.until("Lamp", "OFF")
        yield mirror


def test_all_members_of_ros_are_said_first_and_nobody_else(runs: Runs) -> None:
    runs.until("Temp", "21.5 °C")
    runs.until("Door", "CLOSED")
    assert set(runs.said) == {"Lamp", "Temp", "Door"}


def test_a_change_is_said(openhab: OpenHab, runs: Runs) -> None:
    openhab.update("Secret", "OFF")
    openhab.update("Temp", "22 °C")
    runs.until("Temp", "22 °C")
    assert "Secret" not in runs.said


def test_a_command_is_posted_and_its_state_comes_back_once(openhab: OpenHab, runs: Runs) -> None:
    runs.say(HOME_COMMAND.message("ON", item="Lamp"))
    runs.until("Lamp", "ON")
    runs.counted("commands", 1)
    assert openhab.commands == [("Lamp", "ON")]
    assert runs.said["Lamp"] == ["OFF", "ON"]


def test_an_update_is_put_with_every_sign(openhab: OpenHab, runs: Runs) -> None:
    runs.say(HOME_SET.message("19.5 °C", item="Temp"))
    runs.until("Temp", "19.5 °C")
    assert openhab.updates == [("Temp", "19.5 °C")]


@pytest.mark.parametrize(("item", "text"), [("Secret", "ON"), ("Nobody", "ON"), ("Door", "OPEN"), ("Lamp", "loud")])
def test_what_openhab_would_not_take_is_refused_at_once(openhab: OpenHab, runs: Runs, item: str, text: str) -> None:
    with pytest.raises(BadMessage, match=item):
        runs.say(HOME_COMMAND.message(text, item=item))
    assert runs.service.counters["refused"] == 1
    assert openhab.commands == []


def test_an_answer_of_four_hundred_is_no_success(
    openhab: OpenHab, runs: Runs, caplog: pytest.LogCaptureFixture
) -> None:
    del openhab.items["Lamp"]
    runs.say(HOME_COMMAND.message("ON", item="Lamp"))
    runs.counted("unconfirmed", 1)
    assert runs.service.counters["commands"] == 0
    assert "404" in caplog.text


def test_a_stream_that_ends_is_opened_again_and_nothing_is_missed(openhab: OpenHab, runs: Runs) -> None:
    openhab.hang_up()
    openhab.update("Temp", "5 °C")
    runs.until("Temp", "5 °C")
    openhab.update("Temp", "6 °C")
    runs.until("Temp", "6 °C")


def test_an_openhab_that_comes_later_or_restarts_is_found(openhab: OpenHab) -> None:
    port = free_port()
    with running(port) as mirror:
        mirror.counted("connected", 0)
        with serving(openhab, port):
            mirror.until("Lamp", "OFF")
        mirror.counted("connected", 0)
        openhab.items["Lamp"]["state"] = "ON"
        with serving(openhab, port):
            mirror.until("Lamp", "ON")
            mirror.counted("connected", 1)


def test_a_silent_stream_is_opened_again(openhab: OpenHab) -> None:
    with serving(openhab) as port, running(port, silence_s=0.3) as mirror:
        mirror.until("Lamp", "OFF")
        openhab._listeners.clear()  # as if a cable had been pulled: nothing comes, nothing ends
        openhab.items["Lamp"]["state"] = "ON"
        mirror.until("Lamp", "ON")


def test_the_second_series_is_heard_under_its_old_name() -> None:
    old = OpenHab(items(), None, "smarthome")
    with serving(old) as port, running(port, topic="smarthome") as mirror:
        mirror.until("Lamp", "OFF")
        old.update("Lamp", "ON")
        mirror.until("Lamp", "ON")


def test_a_wrong_token_is_told_and_tried_again(openhab: OpenHab, caplog: pytest.LogCaptureFixture) -> None:
    openhab.token = "another"
    with serving(openhab) as port, running(port) as mirror:
        wait_until(lambda: "401" in caplog.text, "the refusal", LIMIT_S)
        openhab.token = TOKEN
        mirror.until("Lamp", "OFF")
    assert TOKEN not in caplog.text


@pytest.mark.parametrize(
    "line",
    ["", "event: message", "data: not JSON", "data: []", 'data: {"type": "ItemStateChangedEvent"}', "data: 5",
     'data: {"type": "ItemStateChangedEvent", "topic": "x", "payload": "{}"}', 'data: {"type": "ALIVE"}'],
)  # fmt: skip
def test_lines_that_are_no_changes_are_passed_over(line: str) -> None:
    assert change_of(line) is None


def test_an_address_with_a_password_is_refused() -> None:
    with pytest.raises(ValidationError, match="without a password"):
        Config(url="http://user:secret@192.0.2.1:8080", home=shipped())


@pytest.mark.mosquitto
def test_it_runs_as_a_process_on_a_real_broker(
    openhab: OpenHab, mosquitto_broker: mosquitto.Broker, tmp_path: Path
) -> None:
    config = tmp_path / "config" / "simulated.yaml"
    shutil.copytree(SHIPPED.parent, config.parent)
    given = {
        "APARTMENT_BROKER_PORT": str(mosquitto_broker.port),
        "APARTMENT_STATE": str(tmp_path),
        "OPENHAB_TOKEN": TOKEN,
    }
    with ExitStack() as stack:
        port = stack.enter_context(serving(openhab))
        section = f"\nopenhab: {{url: 'http://127.0.0.1:{port}', token: '${{OPENHAB_TOKEN}}'}}\n"
        config.write_text(config.read_text(encoding="utf-8") + section, encoding="utf-8")
        apartment = load(config, ("openhab",), environment={**os.environ, **given})
        running_ = commands(processes(apartment, ["openhab"]), config)
        stack.enter_context(in_background(Supervisor(running_, given, tmp_path / "services.log")))
        bus = stack.enter_context(connected(BusSettings(port=mosquitto_broker.port), ["#"], timeout_s=LIMIT_S))
        assert bus.payload("home/Temp/state", lambda text: text == "21.5 °C", LIMIT_S) == "21.5 °C"
        bus.say("home/Lamp/command", "ON")
        assert bus.payload("home/Lamp/state", lambda text: text == "ON", LIMIT_S) == "ON"
        assert bus.payload("service/openhab/status", lambda text: text == "online", LIMIT_S) == "online"
    assert openhab.commands == [("Lamp", "ON")]
