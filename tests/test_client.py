"""The client for people and tests: nothing that came is kept from who asks, and an order is waited for to its end."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from services.bus import Message
from services.bus.memory import WINDOW, Hub, MemoryBus
from services.bus.mqtt import MqttBus
from services.client import ANSWER_S, Client, connected
from services.config import BusSettings
from services.errors import Unavailable
from services.payloads import Motion, OrderResult, OrderState
from services.peers import free_port, mosquitto, wait_until
from services.topics import CAMERA_ORDER_RESULT

STATE = Message("home/Kitchen_Light/state", b"ON", retain=True)


class Slow(MqttBus):
    """It takes a while to see that it is connected, as on a busy machine."""

    def __init__(self, *arguments: object, **options: object) -> None:
        super().__init__(*arguments, **options)  # type: ignore[arg-type]
        self.born = time.monotonic()

    @property
    def connected(self) -> bool:
        return super().connected and time.monotonic() - self.born > 0.5


@pytest.mark.mosquitto
def test_what_comes_before_it_is_known_to_be_connected_is_given_by_the_first_pump(
    mosquitto_broker: mosquitto.Broker, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = BusSettings(port=mosquitto_broker.port)
    with connected(settings, ["home/#"]) as speaker:
        speaker.publish(STATE)
        speaker.until(lambda message: message.topic == STATE.topic)
    monkeypatch.setattr("services.client.MqttBus", Slow)
    with connected(settings, ["home/#"]) as late:
        assert [message.topic for message in _pumped(late)] == [STATE.topic]
        assert [message.topic for message in late.seen] == [STATE.topic]


@pytest.mark.mosquitto
def test_what_was_kept_and_is_still_on_its_way_is_forgotten_until_the_broker_is_back(tmp_path: Path) -> None:
    with ExitStack() as clients:
        with mosquitto.private(tmp_path, anonymous=True) as broker:
            settings = BusSettings(port=broker.port)
            speaker = clients.enter_context(connected(settings, ["home/Item2999/state"]))
            for number in range(3000):  # more than one turn takes
                speaker.say(f"home/Item{number}/state", "old", retain=True)
            speaker.until(lambda message: message.payload == b"old")
            late = clients.enter_context(connected(settings, ["home/#"]))
            late.forget()
            speaker.say("home/Item0/state", "new", retain=True)
            late.until(lambda message: message.payload == b"new")
            assert [message.payload for message in late.seen] == [b"new"]
            late.subscribe("home/Item1/+")
            late.until(lambda message: message.topic == "home/Item1/state")
            late.forget()
        with mosquitto.private(tmp_path, port=broker.port, anonymous=True):
            late.until(lambda message: message.topic == "home/Item2/state", 30.0)


@pytest.mark.mosquitto
@pytest.mark.parametrize(
    ("accounts", "who"), [({"operator": "wrong"}, "bus.accounts.operator"), ({}, "somebody without a name")]
)
def test_who_is_not_let_in_is_told_that_and_not_that_nobody_answers(
    tmp_path: Path, accounts: dict[str, str], who: str
) -> None:
    with mosquitto.private(tmp_path) as broker:
        settings = BusSettings.model_validate({"port": broker.port, "accounts": accounts})
        with pytest.raises(Unavailable) as told, connected(settings, timeout_s=30.0):
            pass
    assert str(told.value) == f"the broker at 127.0.0.1:{broker.port} refuses {who}: Not authorized"


def test_nobody_there_is_told_as_before() -> None:
    port = free_port()
    told = pytest.raises(TimeoutError, match=f"no broker answers at 127.0.0.1:{port}")
    with told, connected(BusSettings(port=port), timeout_s=0.2):
        pass


def _pumped(client: Client) -> list[Message]:
    """What `pump` gives, when it gives something."""
    given: list[Message] = []
    wait_until(lambda: given.extend(client.pump(0.05)) or given, "something", 5.0)
    return given


class Now:
    """A clock that stands until it is told to go on."""

    def __init__(self) -> None:
        self.s = 0.0

    def __call__(self) -> float:
        return self.s


class Told(MemoryBus):
    """Time passes while it is waited on, and what is to happen by then happens."""

    def __init__(self, hub: Hub, now: Now) -> None:
        super().__init__(hub)
        self._now = now
        self.happens: list[tuple[float, Callable[[], None]]] = []

    def receive(self, timeout: float | None = 0.0, most: int = WINDOW) -> list[Message]:
        self._now.s += timeout or 0.0
        while self.happens and self.happens[0][0] <= self._now.s:
            self.happens.pop(0)[1]()
        return super().receive(0.0, most)


class Flat:
    """A client, and a camera that answers what the test wants, when it wants it."""

    def __init__(self) -> None:
        self.now, self.hub = Now(), Hub()
        self.bus = Told(self.hub, self.now)
        self.camera = MemoryBus(self.hub)
        self.camera.subscribe(["camera/ip1/order/+"])
        self.client = Client(self.bus, clock=self.now)
        self.id = ""

    def after(self, seconds: float, happens: Callable[[], None]) -> None:
        self.bus.happens.append((seconds, happens))

    def answers(self, seconds: float, state: OrderState) -> None:
        self.after(seconds, lambda: self._answer(state))

    def says(self, seconds: float, topic: str, payload: bytes) -> None:
        self.after(seconds, lambda: self.camera.publish(Message(topic, payload)))

    def _answer(self, state: OrderState) -> None:
        for message in self.camera.receive():
            self.id = json.loads(message.payload)["id"]
        result = OrderResult(id=self.id, key="Reboot", value="True", state=state)
        self.camera.publish(CAMERA_ORDER_RESULT.message(result, cam="ip1"))


STATUS = "service/camera-ip1/status"


def test_an_order_is_waited_for_as_long_as_it_takes() -> None:
    flat, told = Flat(), list[str]()
    flat.answers(1.0, "accepted")
    flat.answers(2.0, "running")
    flat.answers(1000.0, "done")
    assert flat.client.order("ip1", "Reboot", "True", tell=lambda result: told.append(result.state)).state == "done"
    assert told == ["accepted", "running", "done"]
    assert flat.now.s == pytest.approx(1000.0, abs=0.1)


def test_an_order_that_nobody_answers_is_given_up_soon() -> None:
    flat = Flat()
    with pytest.raises(TimeoutError, match="camera-ip1: Reboot has not ended: no answer within 10 s"):
        flat.client.order("ip1", "Reboot", "True")
    assert flat.now.s == pytest.approx(ANSWER_S, abs=0.1)


def test_an_order_is_given_up_after_the_time_that_one_has_for_it() -> None:
    flat = Flat()
    flat.answers(1.0, "running")
    with pytest.raises(TimeoutError, match="it is running"):
        flat.client.order("ip1", "Reboot", "True", timeout_s=30.0)
    assert flat.now.s == pytest.approx(30.0, abs=0.1)


@pytest.mark.parametrize("how", ["service", "broker", "broker for ever"])
def test_an_order_is_given_up_when_who_carries_it_out_went_away(how: str) -> None:
    flat = Flat()
    flat.answers(1.0, "running")
    if how == "service":
        flat.says(100.0, STATUS, b"offline")
        flat.says(103.0, STATUS, b"online")
    else:
        flat.after(100.0, flat.hub.down)
    if how == "broker":
        flat.after(100.0, flat.hub.back)
    with pytest.raises(TimeoutError, match="it is running, but its service or the broker was away"):
        flat.client.order("ip1", "Reboot", "True")
    assert flat.now.s == pytest.approx(110.0, abs=0.2)


def test_an_order_is_not_given_up_when_its_service_comes_back_and_still_carries_it_out() -> None:
    flat = Flat()
    flat.answers(1.0, "accepted")
    flat.says(100.0, STATUS, b"offline")
    flat.answers(105.0, "running")
    flat.answers(300.0, "cancelled")
    assert flat.client.order("ip1", "Reboot", "True").state == "cancelled"


def test_what_a_camera_says_meanwhile_is_heard_and_what_others_say_is_not() -> None:
    flat, heard = Flat(), list[Any]()
    flat.client.subscribe("camera/#")
    flat.answers(1.0, "running")
    flat.says(2.0, "camera/ip1/motion", b'{"value": 1, "since": "2026-01-31T07:05:00.123Z"}')
    flat.says(3.0, "camera/ip2/motion", b'{"value": 0, "since": "2026-01-31T07:05:00.123Z"}')
    flat.answers(4.0, "done")
    flat.client.order("ip1", "Reboot", "True", hear=heard.append)
    assert [one.value for one in heard if isinstance(one, Motion)] == [1]
