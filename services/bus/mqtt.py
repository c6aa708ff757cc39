"""The bus over paho, against any MQTT broker. How a client of it is made is in `connection.py`.

Every connection is a fresh paho client: what was in flight on the old one is not resent by paho behind our back,
so no command arrives late; the outbox decides what is said again. Two threads: the service's own, which calls
every method here; the keeper, which connects again and again. The keeper also reads into the inbox and writes
(`network.py`), so that a long turn holds up neither; with `Address.inline` the service's own does, in `receive`.
"""

from __future__ import annotations

import logging
import random
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any

from paho.mqtt.enums import MQTTErrorCode
from paho.mqtt.reasoncodes import ReasonCode

from services.bus import LOST_TOPIC, SESSION_TOPIC, WAKE_TOPIC, Delivery, Message, connection, topic_matches
from services.bus.connection import CONNECT_TIMEOUT_S, WINDOW, Address
from services.bus.inbox import Inbox
from services.bus.network import Client, Network
from services.bus.outbox import Outbox

log = logging.getLogger(__name__)

RETRY_S = (0.1, 1.0)  # between attempts to connect: first, longest; a restarted broker is met again within 2 s
FAREWELL_S = 2.0
DENIALS = 100  # topics that are told as denied, at most
LOOK_S = 0.01  # between two looks whether the last words are said
WAKE = Message(WAKE_TOPIC)


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
        self.refused = ""  # why the broker let us not in, when it was last asked
        self._protocol = address.protocol
        self._negotiated = address.protocol == 4
        self._will = will
        self._clock = clock
        self._filters: tuple[str, ...] = ()
        self._as_published: frozenset[str] = frozenset()  # of these filters
        self._inbox = Inbox(gathers=not address.inline)
        self._outbox = Outbox(self._send, birth)
        self._in_flight: dict[int, Message] = {}  # events that the broker has not acknowledged yet
        self._acknowledged: deque[int] = deque()
        self._sessions: deque[bool] = deque(maxlen=1)  # whether the broker had kept ours; until it is told
        self._to_acknowledge: deque[Delivery] = deque()
        self._client: Client | None = None  # of the connection that stands
        self._network = Network()
        self._link: Client | None = None  # of the connection that is being made, or stands
        self._up = 0  # the number of the connection that stands; set by the keeper's thread
        self._greeted = 0  # the one on which the outbox has spoken; set by the service's thread
        self._closing = threading.Event()
        self._lost = threading.Event()
        self._told = ""
        self._denied: set[str] = set()  # topics; told once each
        self._keeper = threading.Thread(target=self._keep_connected, name="bus", daemon=True)
        self._keeper.start()

    @property
    def connected(self) -> bool:
        """Whether messages go out now."""
        return self._up != 0 and self._up == self._greeted

    @property
    def listens(self) -> bool:
        """See `Bus`."""
        client = self._client
        return self.connected and client is not None and client.listens

    @property
    def dropped(self) -> int:
        """How many messages were not sent for want of a connection, or not taken for want of time."""
        return self._outbox.dropped + self._inbox.dropped

    # -- what the service calls

    def subscribe(self, filters: Sequence[str], as_published: Sequence[str] = ()) -> None:
        """See `Bus`."""
        self._as_published |= frozenset(as_published)
        self._filters = (*self._filters, *filters)
        if (client := self._client) is not None:
            client.ask_for(filters, self._as_published)
            self._network.wake()
            self._tell_of_session()

    def publish(self, message: Message) -> None:
        """See `Bus`."""
        self._outbox.put(message, connected=self.connected)

    def post(self, message: Message) -> None:
        """See `Bus`."""
        self._inbox.put(message._replace(received=self._clock()))
        if self.address.inline:
            self._network.wake()

    def receive(self, timeout: float | None = 0.0, most: int = WINDOW) -> list[Message]:
        """See `Bus`."""
        self._keep_up()
        if self.address.inline:
            self._go_on(timeout, lambda: most == 0 or self._inbox.empty)
            timeout = 0.0
        if not most:
            self._closing.wait(timeout)
            return []
        taken = self._inbox.take(timeout, most)
        self._keep_up()
        return self._to_handle(taken)

    def ack(self, messages: Iterable[Message]) -> None:
        """See `Bus`."""
        self._to_acknowledge.extend([one.token for one in messages if one.qos and one.token is not None])
        self._network.wake()

    def close(self) -> None:
        """See `Bus`."""
        self._closing.set()
        client, was_connected = self._client, self.connected
        self._outbox.close(self._will, connected=was_connected)
        if client is not None and was_connected:
            self._go_on(FAREWELL_S, self._has_last_words)
            client.disconnect()
            self._network.wake()
            self._go_on(FAREWELL_S, lambda: not self._lost.is_set())
        self._lost.set()
        self._network.wake()
        self._keeper.join(CONNECT_TIMEOUT_S + 1.0)
        self._network.close()

    # -- the service's thread, inside

    def _tell_of_session(self) -> None:
        """From either thread, once for each connection: a service may subscribe after the first is made."""
        if SESSION_TOPIC in self._filters:
            with suppress(IndexError):  # it is told
                self.post(Message(SESSION_TOPIC, value=self._sessions.pop()))

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

    def _to_handle(self, taken: list[Message]) -> list[Message]:
        """Without what only woke us, and without what the broker will send a durable client again."""
        if self.address.durable:
            now = self.connections
            taken = [one for one in taken if one.token is None or one.token.connection == now]
        return [one for one in taken if one.topic != WAKE_TOPIC]

    def _send(self, message: Message) -> bool:
        client = self._client
        if client is None:
            return False
        properties = connection.properties(message, self._protocol)
        info = client.publish(message.topic, message.payload, message.qos, message.retain, properties)
        self._network.wake()
        no_connection = info.rc == MQTTErrorCode.MQTT_ERR_NO_CONN
        if info.rc == MQTTErrorCode.MQTT_ERR_QUEUE_SIZE or (no_connection and message.qos == 0):
            return False
        if message.qos and not message.expires_s and (not message.retain or message.once):
            self._in_flight[info.mid] = message
        return True

    def _forget_acknowledged(self) -> None:
        while self._acknowledged:
            self._in_flight.pop(self._acknowledged.popleft(), None)

    def _has_last_words(self) -> bool:
        """Whether something that we said is not written, or not acknowledged."""
        self._forget_acknowledged()
        client = self._client
        return client is not None and (client.want_write() or bool(self._in_flight)) and not self._lost.is_set()

    def _go_on(self, timeout: float | None, wanted: Callable[[], bool]) -> None:
        """Lets the network do its work while that is wanted, in this thread where that is ours to do."""
        if self.address.inline:
            self._network.run(self._prepare, wanted, timeout)
            return
        end = time.monotonic() + (timeout or 0.0)
        while wanted() and time.monotonic() < end:
            self._lost.wait(LOOK_S)

    # -- the thread that reads and writes

    def _prepare(self) -> Client | None:
        """Hands over the acknowledgements; what came by an older connection is left out."""
        client, done = self._client, self._to_acknowledge
        packets = [token.packet for _ in range(len(done)) if (token := done.popleft()).connection == self._up]
        if packets and client is not None:
            client.ack_all(packets)
        return self._link

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
        if self._closing.is_set():
            return
        self._link = client
        if self.address.inline:
            self._network.wake()
            self._lost.wait()
        else:
            self._network.run(self._prepare, lambda: not self._lost.is_set() and client.socket() is not None)
        self._up, self._client, self._link = 0, None, None
        client.forget()

    def _new_client(self) -> Client:
        client = connection.client(self.address, self._protocol, self._will)
        client.on_connect = self._on_connect  # type: ignore[assignment]
        client.clock = self._clock
        client.on_disconnect = self._on_disconnect  # type: ignore[assignment]
        client.on_came = self._on_came
        client.on_acknowledged = self._acknowledged.append
        client.on_denied = self._on_denied
        client.on_granted = lambda: self._inbox.put(WAKE)
        return client

    def _tell(self, text: str) -> None:
        """Once when it changes, not at every attempt."""
        if text != self._told:
            log.warning("%s", text)
            self._told = text

    # -- the thread that reads and writes, called by paho

    def _on_connect(self, client: Client, _data: Any, flags: Any, reason: ReasonCode, _properties: Any) -> None:
        if reason.is_failure:
            self.refused = str(reason)
            self._tell(f"the broker refuses {self.address.client_id}: {reason}")
            self._lost.set()
            return
        if self._told:
            log.info("connected to %s:%s", self.address.host, self.address.port)
            self._told = ""
        self._client = client  # before the filters are read: who subscribes meanwhile asks by himself
        self._acknowledged.clear()
        self.connections = client.number = self.connections + 1
        client.ask_for(self._filters, self._as_published)
        self._up = self.connections  # after they are asked for: what is said is said by who listens
        self._sessions.append(bool(flags.session_present))
        self._tell_of_session()
        self._inbox.put(WAKE)

    def _on_disconnect(self, client: Client, _data: Any, _flags: Any, reason: ReasonCode, _properties: Any) -> None:
        was_up, self._up = self._up, 0
        if self._client is client and not self._closing.is_set():
            self._tell(f"connection to {self.address.host}:{self.address.port} lost: {reason}")
            if was_up and LOST_TOPIC in self._filters:
                self.post(Message(LOST_TOPIC))
        self._lost.set()

    def _on_denied(self, topic: str, why: str) -> None:
        if topic not in self._denied and len(self._denied) < DENIALS:
            self._denied.add(topic)
            log.warning("the broker takes nothing for %s from %s: %s", topic, self.address.client_id, why)

    def _on_came(self, message: Message) -> None:
        if message.retain and not any(topic_matches(wanted, message.topic) for wanted in self._filters):
            if message.qos and message.token is not None:
                self._to_acknowledge.append(message.token)
            return  # amqtt 0.12 hands out retained messages that nobody asked for, and waits for their acknowledgement
        self._inbox.put(message)
