"""The client for people and tests: nothing that came is kept from who asks."""

from __future__ import annotations

import time

import pytest

from services.bus import Message
from services.bus.mqtt import MqttBus
from services.client import Client, connected
from services.config import BusSettings
from services.peers import mosquitto, wait_until

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


def _pumped(client: Client) -> list[Message]:
    """What `pump` gives, when it gives something."""
    given: list[Message] = []
    wait_until(lambda: given.extend(client.pump(0.05)) or given, "something", 5.0)
    return given
