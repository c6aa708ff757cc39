"""A bus for people and tests: say something, and wait for what comes of it.

Not here: a service's life (`process.py`). Used by the command line, the demo and the pytest plugin.
"""

from __future__ import annotations

import math
import os
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from services.bus import Bus, Message, topic_matches
from services.bus.mqtt import MqttBus
from services.config import BusSettings
from services.errors import Unavailable
from services.payloads import Order, OrderResult
from services.process import address
from services.topics import CAMERA_ORDER, CAMERA_ORDER_RESULT, SERVICE_STATUS, read

ANSWER_S = 10.0  # an order that is handled after 5 s is refused, so it is answered by then if anybody is there


class Client:
    """Waits on a bus from the caller's thread. What came while it waited for something else is kept in `seen`."""

    def __init__(
        self,
        bus: Bus,
        came: Sequence[Message] = (),
        filters: Sequence[str] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`came`: what has come already, by `filters`, which are subscribed to; the first `pump` gives it."""
        self.bus = bus
        self.seen: list[Message] = []
        self._came = list(came)
        self._filters = list(filters)
        self._clock = clock
        self._forgotten = 0  # the connection whose kept messages are old news

    def subscribe(self, *filters: str) -> None:
        """Asks for everything that matches any of the filters."""
        self._forgotten = 0
        self._filters.extend(filters)
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
        if self._forgotten == self.bus.connections:
            came = [message for message in came if not message.retain]
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
        """Forgets what came: the next wait is for new messages only.

        What the broker had kept when this was connected is none, even if it is still on its way.
        """
        self.pump()
        self.seen.clear()
        self._forgotten = self.bus.connections

    def order(
        self,
        camera: str,
        key: str,
        value: Any = "",
        timeout_s: float = math.inf,
        tell: Callable[[OrderResult], None] | None = None,
        hear: Callable[[Any], None] | None = None,
    ) -> OrderResult:
        """Gives a camera an order and waits for the answer that ends it, as long as that takes.

        `tell` is given each of its answers, `hear` what else of that camera comes meanwhile. TimeoutError when nobody
        answers within ANSWER_S, or nothing more comes after the camera's service or the broker was away.
        """
        order = Order(value=value, id=uuid.uuid4().hex[:12])
        given, connections = _Given(order.id, camera, self._clock()), self.bus.connections
        end = self._clock() + timeout_s
        self._hear(given.answers, given.status)  # before it is given, so nothing is missed
        self.publish(CAMERA_ORDER.message(order, cam=camera, key=key))
        while (now := self._clock()) < min(end, given.until):
            for message in self.pump(0.05):
                result = given.take(message, now)
                if result is not None and tell is not None:
                    tell(result)
                if result is not None and result.final:
                    return result
                if hear is not None and message.topic.startswith(f"camera/{camera}/"):
                    hear(read(message, message.received).payload)
            if not self.bus.connected or self.bus.connections != connections:
                connections = self.bus.connections
                given.lost(now)
        raise TimeoutError(f"camera-{camera}: {key} has not ended: {given.state}")

    def _hear(self, *topics: str) -> None:
        """Subscribes to those that no filter of ours matches yet."""
        if missing := [one for one in topics if not any(topic_matches(known, one) for known in self._filters)]:
            self.subscribe(*missing)


class _Given:
    """An order that was given: what its answers say, and until when the next one has to come."""

    def __init__(self, order_id: str | None, camera: str, now: float) -> None:
        self.answers = CAMERA_ORDER_RESULT.name(cam=camera)
        self.status = SERVICE_STATUS.name(service=f"camera-{camera}")
        self.until = now + ANSWER_S
        self.state = f"no answer within {ANSWER_S:.0f} s"
        self._id = order_id

    def take(self, message: Message, now: float) -> OrderResult | None:
        """The answer that the message is, if it is one to this order."""
        if message.topic == self.status and message.payload == b"offline":
            self.lost(now)
        if message.topic != self.answers:
            return None
        result: OrderResult = read(message, message.received).payload
        if result.id != self._id:
            return None
        self.until, self.state = math.inf, f"it is {result.state}"
        return result

    def lost(self, now: float) -> None:
        """Who carries it out, or the broker, was away: it may be forgotten, and its end may have been missed."""
        if self.until == math.inf:
            self.until, self.state = now + ANSWER_S, f"{self.state}, but its service or the broker was away"


@contextmanager
def connected(
    settings: BusSettings, filters: Sequence[str] = (), account: str = "operator", timeout_s: float = 5.0
) -> Iterator[Client]:
    """A client of the configured broker; TimeoutError when it does not answer, Unavailable when it lets us not in."""
    bus = MqttBus(address(settings, f"{account}-{os.getpid()}-{uuid.uuid4().hex[:6]}", account))
    try:
        bus.subscribe(filters)
        end = time.monotonic() + timeout_s
        waiting: list[Message] = []
        while not bus.listens:
            if bus.refused:
                who = f"bus.accounts.{account}" if settings.accounts.get(account) else "somebody without a name"
                raise Unavailable(f"the broker at {settings.host}:{settings.port} refuses {who}: {bus.refused}")
            if time.monotonic() > end:
                raise TimeoutError(f"no broker answers at {settings.host}:{settings.port}")
            waiting += bus.receive(0.05)
        yield Client(bus, waiting, filters)
    finally:
        bus.close()
