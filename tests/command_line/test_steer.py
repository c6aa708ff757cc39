"""`apartment log` and `reload`: over the bus, on a real broker."""

from __future__ import annotations

import logging
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.bus import Delivery, Message
from services.errors import BadMessage
from services.peers.mosquitto import Broker, private
from services.steering import Steered
from tests.command_line.terminal import Terminal, apartment, config_of, done


class Plain:
    """A service with nothing to do."""

    subscribes = ("home/#",)
    due = None

    def __init__(self) -> None:
        self.heard: list[str] = []

    def handle(self, message: Message, now: float) -> Iterator[Message]:
        self.heard.append(message.topic)
        yield Message("home/Lamp/set", b"OFF")

    def tick(self, now: float) -> tuple[Message, ...]:
        return ()


@pytest.fixture
def own_level() -> Iterator[None]:
    before = logging.getLogger("services").level
    yield
    logging.getLogger("services").setLevel(before)


@pytest.mark.usefixtures("own_level")
def test_a_service_hears_nothing_of_how_it_is_steered() -> None:
    inside, reloads = Plain(), list[str]()
    steered = Steered("hubs", inside, lambda: reloads.append("again"))
    assert steered.subscribes == ("home/#", "service/hubs/log_level/set", "service/hubs/reload/set")
    for topic, payload in (
        ("home/Lamp/state", b"ON"),
        ("service/hubs/log_level/set", b"error"),
        ("service/hubs/reload/set", b""),
    ):
        list(steered.handle(Message(topic, payload), 0.0))
    assert (inside.heard, reloads) == (["home/Lamp/state"], ["again"])
    assert steered.counters["log_level"] == logging.ERROR


def lines(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [one.getMessage() for one in caplog.records if one.name == "services.run.hubs"]


@pytest.mark.usefixtures("own_level")
def test_at_debug_it_logs_what_it_hears_and_says(caplog: pytest.LogCaptureFixture) -> None:
    steered = Steered("hubs", Plain(), lambda: None)
    lamp = Message("home/Lamp/state", b"ON")
    assert [one.topic for one in steered.handle(lamp, 0.0)] == ["home/Lamp/set"]
    assert lines(caplog) == []
    list(steered.handle(Message("service/hubs/log_level/set", b"debug"), 0.0))
    assert [one.topic for one in steered.handle(lamp, 0.0)] == ["home/Lamp/set"]
    assert lines(caplog) == ["heard home/Lamp/state, 2 bytes", "said home/Lamp/set, 3 bytes"]


@pytest.mark.parametrize(
    "message",
    [
        Message("service/hubs/log_level/set", b"loud"),
        Message("service/hubs/log_level/set", b"debug", retain=True),
        Message("service/hubs/reload/set", b"now", retain=True),
    ],
)
def test_a_bad_or_retained_wish_is_refused(message: Message) -> None:
    reloads: list[str] = []
    with pytest.raises(BadMessage):
        list(Steered("hubs", Plain(), lambda: reloads.append("again")).handle(message, 0.0))
    assert reloads == []


def test_a_reload_that_the_broker_sends_again_does_not_end_the_new_one() -> None:
    reloads: list[str] = []
    again = Message("service/hubs/reload/set", b"now", token=Delivery(1, 1, again=True))
    assert list(Steered("hubs", Plain(), lambda: reloads.append("again")).handle(again, 0.0)) == []
    assert reloads == []


def test_a_service_logs_more_and_starts_again_when_told(mosquitto_broker: Broker, tmp_path: Path) -> None:
    config = config_of(tmp_path, mosquitto_broker, sections="hubs: {}\n")
    with apartment(config, "run", "hubs") as running:
        running.ready()
        assert done(config, "log", "hubs", "debug") == (0, "hubs logs at debug\n")
        code, text = done(config, "reload", "hubs")
        assert (code, "hubs runs again" in text) == (0, True), text
        wait_for_line(running, "hubs ended with exit 0")
        assert running.ended(signal.SIGTERM) == 0


def wait_for_line(terminal: Terminal, words: str) -> None:
    while words not in terminal.line():
        pass


def test_a_service_that_is_not_configured_is_refused(mosquitto_broker: Broker, tmp_path: Path) -> None:
    config = config_of(tmp_path, mosquitto_broker, sections="hubs: {}\n")
    assert done(config, "log", "nobody", "debug")[0] == 2


def test_only_an_operator_may_steer(tmp_path: Path) -> None:
    with private(tmp_path / "mosquitto") as broker:
        acl = (broker.folder / "acl").read_text(encoding="utf-8").split("\n\n")
    rights = {part.split("\n")[0].removeprefix("user "): part for part in acl if part.startswith("user ")}
    writes = [user for user, text in rights.items() if "write service/+/reload/set" in text]
    assert writes == ["operator"]
    assert "topic read service/bridge/reload/set" in rights["bridge"]
    assert "topic read service/camera-ip1/log_level/set" in rights["camera-ip1"]
