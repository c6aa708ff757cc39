"""The bus over paho, against any MQTT broker. How a client of it is made is in `connection.py`.

Every connection is a fresh paho client: what was in flight on the old one is not resent by paho behind our back,
so no command arrives late; the outbox decides what is said again. Three threads: the service's own, which calls
every method here; paho's network thread, which only fills the inbox; a keeper that connects again.
"""

from __future__ import annotations

import logging
import queue
import random
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import MQTTErrorCode
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from services.bus import WAKE_TOPIC, Message, connection
from services.bus.connection import CONNECT_TIMEOUT_S, WINDOW, Address
from services.bus.outbox import Outbox

log = logging.getLogger(__name__)

RETRY_S = (0.1, 1.0)  # between attempts to connect: first, longest; a restarted broker is met again within 2 s
FAREWELL_S = 2.0
WAKE = Message(WAKE_TOPIC)


@dataclass(frozen=True, slots=True)
class Token:
    """What acknowledges a message: only within the connection that it came by."""

    connection: int
    mid: int
    dup: bool


class MqttBus:
    """One client of a broker; see `services.bus.Bus` for what each method promises."""

    def __init__(
        self,
        address: Address,
        birth: Message | None = None,
        will: Message | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.address = address
        self.connections = 0
        self.session_present = False
        self._protocol = address.protocol
        self._negotiated = address.protocol == 4
        self._will = will
        self._clock = clock
        self._filters: tuple[str, ...] = ()
        self._inbox: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._outbox = Outbox(self._send, birth)
        self._in_flight: dict[int, Message] = {}  # events that the broker has not acknowledged yet
        self._acknowledged: deque[int] = deque()
        self._client: paho.Client | None = None
        self._up = 0  # the number of the connection that stands; set by paho's thread
        self._greeted = 0  # the one on which the outbox has spoken; set by the service's thread
        self._closing = threading.Event()
        self._lost = threading.Event()
        self._told = ""
        self._keeper = threading.Thread(target=self._keep_connected, name="bus", daemon=True)
        self._keeper.start()

    @property
    def connected(self) -> bool:
        """Whether messages go out now."""
        return self._up != 0 and self._up == self._greeted

    @property
    def dropped(self) -> int:
        """How many messages could not be kept while there was no connection."""
        return self._outbox.dropped

    # -- what the service calls

    def subscribe(self, filters: Sequence[str]) -> None:
        """See `Bus`."""
        self._filters = (*self._filters, *filters)
        if self.connected and self._client is not None:
            self._subscribe(self._client, filters)

    def publish(self, message: Message) -> None:
        """See `Bus`."""
        self._outbox.put(message, connected=self.connected)

    def post(self, message: Message) -> None:
        """See `Bus`."""
        self._inbox.put(replace(message, received=self._clock()))

    def receive(self, timeout: float | None = 0.0, most: int = WINDOW) -> list[Message]:
        """See `Bus`."""
        self._keep_up()
        taken: list[Message] = []
        if not most:
            self._lost.wait(timeout)
        try:
            if most:
                taken.append(self._inbox.get(timeout=timeout) if timeout != 0.0 else self._inbox.get_nowait())
            while len(taken) < most:
                taken.append(self._inbox.get_nowait())
        except queue.Empty:
            pass
        self._keep_up()
        return [message for message in taken if self._is_to_handle(message)]

    def ack(self, messages: Iterable[Message]) -> None:
        """See `Bus`."""
        client, connection = self._client, self.connections
        if client is None or not self.connected:
            return
        for message in messages:
            token = message.token
            if isinstance(token, Token) and token.connection == connection and message.qos:
                client.ack(token.mid, message.qos)

    def close(self) -> None:
        """See `Bus`."""
        self._closing.set()
        client, was_connected = self._client, self.connected
        self._outbox.close(self._will, connected=was_connected)
        if client is not None and was_connected:
            self._wait_for_the_last_words()
            client.disconnect()
        self._lost.set()
        self._keeper.join(CONNECT_TIMEOUT_S + 1.0)

    # -- the service's thread, inside

    def _keep_up(self) -> None:
        self._forget_acknowledged()
        up = self._up
        if up and up != self._greeted:
            unacknowledged = list(self._in_flight.values())
            self._in_flight.clear()
            self._greeted = up
            self._outbox.flush(unacknowledged)
        elif up:
            self._outbox.drain()

    def _is_to_handle(self, message: Message) -> bool:
        token = message.token
        came_before = isinstance(token, Token) and token.connection != self.connections
        return message.topic != WAKE_TOPIC and not (self.address.durable and came_before)

    def _send(self, message: Message) -> bool:
        client = self._client
        if client is None:
            return False
        info = client.publish(
            message.topic, message.payload, qos=message.qos, retain=message.retain, properties=self._properties(message)
        )
        if info.rc == MQTTErrorCode.MQTT_ERR_QUEUE_SIZE or (
            info.rc == MQTTErrorCode.MQTT_ERR_NO_CONN and message.qos == 0
        ):
            return False
        if message.qos and not message.expires_s and (not message.retain or message.once):
            self._in_flight[info.mid] = message
        return True

    def _properties(self, message: Message) -> Properties | None:
        if self._protocol != 5 or (
            message.expires_s is None and message.correlation is None and message.reply_to is None
        ):
            return None
        properties = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
        if message.expires_s is not None:
            properties.MessageExpiryInterval = message.expires_s
        if message.correlation is not None:
            properties.CorrelationData = message.correlation
        if message.reply_to is not None:
            properties.ResponseTopic = message.reply_to
        return properties

    def _forget_acknowledged(self) -> None:
        while self._acknowledged:
            self._in_flight.pop(self._acknowledged.popleft(), None)

    def _wait_for_the_last_words(self) -> None:
        """Until the broker has acknowledged what we said, or FAREWELL_S."""
        client = self._client
        end = time.monotonic() + FAREWELL_S
        while client is not None and client.want_write() and time.monotonic() < end:
            self._lost.wait(0.01)
        while self._in_flight and time.monotonic() < end and not self._lost.wait(0.01):
            self._forget_acknowledged()

    # -- the keeper's thread

    def _keep_connected(self) -> None:
        pause = RETRY_S[0]
        while not self._closing.is_set():
            self._lost.clear()
            before = self.connections
            self._one_connection()
            pause = RETRY_S[0] if self.connections > before else min(pause * 2, RETRY_S[1])
            self._closing.wait(pause * random.uniform(0.8, 1.2))

    def _one_connection(self) -> None:
        try:
            if not self._negotiated:
                self._protocol, self._negotiated = connection.negotiate(self.address), True
            client = self._new_client()
            connection.connect(client, self.address, self._protocol)
        except (OSError, ValueError) as error:
            self._tell(f"no connection to {self.address.host}:{self.address.port}: {error}")
            return
        client.loop_start()
        self._lost.wait()
        self._up = 0
        client.loop_stop()

    def _new_client(self) -> paho.Client:
        client = connection.client(self.address, self._protocol, self._will)
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        client.on_message = self._on_message
        client.on_publish = self._on_publish
        return client

    def _tell(self, text: str) -> None:
        """Once when it changes, not at every attempt."""
        if text != self._told:
            log.warning("%s", text)
            self._told = text

    # -- paho's thread

    def _on_connect(self, client: paho.Client, _data: Any, flags: Any, reason: ReasonCode, _properties: Any) -> None:
        if reason.is_failure:
            self._tell(f"the broker refuses {self.address.client_id}: {reason}")
            self._lost.set()
            return
        if self._told:
            log.info("connected to %s:%s", self.address.host, self.address.port)
            self._told = ""
        self._client = client
        self.session_present = bool(flags.session_present)
        self._acknowledged.clear()
        self.connections += 1
        self._subscribe(client, self._filters)
        self._up = self.connections
        self._inbox.put(WAKE)

    def _subscribe(self, client: paho.Client, filters: Sequence[str]) -> None:
        if filters:
            client.subscribe([(wanted, 1) for wanted in filters])

    def _on_disconnect(
        self, client: paho.Client, _data: Any, _flags: Any, reason: ReasonCode, _properties: Any
    ) -> None:
        self._up = 0
        if self._client is client and not self._closing.is_set():
            self._tell(f"connection to {self.address.host}:{self.address.port} lost: {reason}")
        self._lost.set()

    def _on_message(self, _client: paho.Client, _data: Any, message: paho.MQTTMessage) -> None:
        try:
            topic = message.topic
        except UnicodeDecodeError:  # a broker must refuse it (MQTT 5, 1.5.4); it would end this thread
            return
        properties = message.properties
        self._inbox.put(
            Message(
                topic=topic,
                payload=bytes(message.payload),
                retain=message.retain,
                qos=message.qos,
                received=self._clock(),
                reply_to=getattr(properties, "ResponseTopic", None) if properties else None,
                correlation=getattr(properties, "CorrelationData", None) if properties else None,
                token=Token(self.connections, message.mid, message.dup),
            )
        )

    def _on_publish(self, _client: paho.Client, _data: Any, mid: int, _reason: Any, _properties: Any) -> None:
        self._acknowledged.append(mid)
