"""A bus for people and tests: say something, and wait for what comes of it.

Not here: a service's life (`process.py`). Used by the command line, the demo and the pytest plugin.
"""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from services.bus import Bus, Message, topic_matches
from services.bus.mqtt import MqttBus
from services.config import BusSettings
from services.payloads import Order, OrderResult
from services.process import address
from services.topics import CAMERA_ORDER, CAMERA_ORDER_RESULT, read


class Client:
    """Waits on a bus from the caller's thread. What came while it waited for something else is kept in `seen`."""

    def __init__(self, bus: Bus, came: Sequence[Message] = ()) -> None:
        """`came`: what has come already; the first `pump` gives it."""
        self.bus = bus
        self.seen: list[Message] = []
        self._came = list(came)

    def subscribe(self, *filters: str) -> None:
        """Asks for everything that matches any of the filters."""
        self.bus.subscribe(filters)

    def publish(self, message: Message) -> None:
        """Sends one message."""
        self.bus.publish(message)

    def say(self, topic: str, payload: str | bytes, *, retain: bool = False, qos: int = 1) -> None:
        """Sends bytes as they are, whatever the topic table says: what `mosquitto_pub` does."""
        self.bus.publish(Message(topic, payload.encode() if isinstance(payload, str) else payload, retain, qos))

    def pump(self, timeout_s: float = 0.0) -> list[Message]:
        """What has come since the last call; waits for the first up to `timeout_s`."""
        came, self._came = self._came or self.bus.receive(timeout_s), []
        self.bus.ack(came)
        self.seen.extend(came)
        return came

    def collect(self, seconds: float) -> list[Message]:
        """Everything seen, after listening that long: what retained states are there."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.pump(left)
        return self.seen

    def until(self, condition: Callable[[Message], bool], timeout_s: float = 10.0, what: str = "a message") -> Message:
        """The first message, seen already or still to come, that satisfies; TimeoutError names what was awaited."""
        end = time.monotonic() + timeout_s
        fresh = list(self.seen)
        while True:
            for message in fresh:
                if condition(message):
                    return message
            if time.monotonic() > end:
                came = ", ".join(dict.fromkeys(message.topic for message in self.seen[-20:])) or "nothing"
                raise TimeoutError(f"{what}: not within {timeout_s:.1f} s; came: {came}")
            fresh = self.pump(0.05)

    def payload(self, topic: str, wanted: Callable[[Any], bool] = lambda _: True, timeout_s: float = 10.0) -> Any:
        """The first payload (read by the topic table) on topics matching this filter that satisfies."""

        def fits(message: Message) -> bool:
            return topic_matches(topic, message.topic) and wanted(read(message, message.received).payload)

        return read(found := self.until(fits, timeout_s, topic), found.received).payload

    def forget(self) -> None:
        """Forgets what came: the next wait is for new messages only."""
        self.pump()
        self.seen.clear()

    def give(self, camera: str, key: str, value: Any = "") -> str:
        """Gives a camera an order; the id that its answers carry."""
        name = uuid.uuid4().hex[:12]
        self.publish(CAMERA_ORDER.message(Order(value=value, id=name), cam=camera, key=key))
        return name

    def order(
        self,
        camera: str,
        key: str,
        value: Any = "",
        timeout_s: float = 60.0,
        tell: Callable[[OrderResult], None] | None = None,
    ) -> OrderResult:
        """Gives a camera an order and waits for the answer that ends it; TimeoutError when none comes."""
        given = self.give(camera, key, value)

        def ours(result: OrderResult) -> bool:
            if result.id != given:
                return False
            if tell is not None:
                tell(result)
            return result.final

        result: OrderResult = self.payload(CAMERA_ORDER_RESULT.name(cam=camera), ours, timeout_s)
        return result


@contextmanager
def connected(
    settings: BusSettings, filters: Sequence[str] = (), account: str = "operator", timeout_s: float = 5.0
) -> Iterator[Client]:
    """A client of the configured broker; TimeoutError when it does not answer."""
    bus = MqttBus(address(settings, f"{account}-{os.getpid()}-{uuid.uuid4().hex[:6]}", account))
    try:
        bus.subscribe(filters)
        end = time.monotonic() + timeout_s
        waiting: list[Message] = []
        while not bus.listens:
            if time.monotonic() > end:
                raise TimeoutError(f"no broker answers at {settings.host}:{settings.port}")
            waiting += bus.receive(0.05)
        yield Client(bus, waiting)
    finally:
        bus.close()
