"""The bus inside one process: for tests and for virtual time. Part of the product, kept by the contract test.

Not here: threads, sockets, waiting for a network. The hub delivers within `publish`; time is the hub's clock.
"""

from __future__ import annotations

import queue
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence

from services.bus import LOST_TOPIC, WAKE_TOPIC, Delivery, Message, topic_matches
from services.bus.outbox import Outbox

WINDOW = 1000


class Hub:
    """What a broker is to the others: it keeps retained messages and hands each message to who asked for it."""

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        self.clock = clock
        self.up = True
        self.retained: dict[str, Message] = {}
        self.clients: list[MemoryBus] = []

    def deliver(self, message: Message) -> None:
        """Hands a published message to everyone who asked for it; retained ones are kept for who comes later."""
        if message.retain:
            self.retained[message.topic] = message._replace(token=None)
            if not message.payload:
                del self.retained[message.topic]
        for client in list(self.clients):
            if client.wants(message.topic):
                retain = message.retain and client.wants_as_published(message.topic)
                client.take(message._replace(retain=retain, token=None))

    def down(self, *, forget: bool = False) -> None:
        """The broker goes away, every connection breaks. `forget`: it had no persistence, retained states go too."""
        self.up = False
        for client in list(self.clients):
            client.lose()
        if forget:
            self.retained.clear()

    def back(self) -> None:
        """The broker is there again, and everyone connects."""
        self.up = True
        for client in list(self.clients):
            client.connect()


class MemoryBus:
    """One client of a hub."""

    def __init__(
        self, hub: Hub, birth: Message | None = None, will: Message | None = None, *, durable: bool = False
    ) -> None:
        self.hub = hub
        self.durable = durable
        self.connected = False
        self.connections = 0
        self._packet = 1
        self._will = will
        self._filters: list[str] = []
        self._as_published: list[str] = []
        self._inbox: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._unacked: deque[Message] = deque()
        self._outbox = Outbox(self._send, birth)
        hub.clients.append(self)
        if hub.up:
            self.connect()

    @property
    def listens(self) -> bool:
        """See `Bus`: what is subscribed to is heard at once."""
        return self.connected

    @property
    def dropped(self) -> int:
        """How many messages could not be kept while there was no connection."""
        return self._outbox.dropped

    @property
    def unacknowledged(self) -> list[Message]:
        """What a durable client has been given and has not acknowledged."""
        return list(self._unacked)

    def connect(self) -> None:
        """As after every reconnect: what the outbox kept goes out, the retained states come in."""
        self.connected = True
        self.connections += 1
        waiting, self._unacked = list(self._unacked), deque()
        if self.durable:
            for message in waiting:
                self.take(message)
        self._outbox.flush()
        self._replay(self._filters)

    def lose(self) -> None:
        """The connection breaks without a word; the hub says our last will."""
        if self.connected and LOST_TOPIC in self._filters:
            self.post(Message(LOST_TOPIC))
        self.connected = False
        if self._will is not None and self.hub.up:
            self.hub.deliver(self._will)
        elif self._will is not None:
            self.hub.retained[self._will.topic] = self._will

    def wants(self, topic: str) -> bool:
        """Whether this client gets a message of that topic now."""
        return (self.connected or self.durable) and any(topic_matches(wanted, topic) for wanted in self._filters)

    def wants_as_published(self, topic: str) -> bool:
        """Whether it hears what is said there with the retain flag of who says it."""
        return any(topic_matches(wanted, topic) for wanted in self._as_published)

    def take(self, message: Message) -> None:
        """Puts a delivered message into the inbox."""
        packet, again = self._packet, False
        if message.token is not None:  # of an older connection: it is the same packet
            packet, again = message.token.packet, True
        else:
            self._packet = packet % 65535 + 1
        token = Delivery(self.connections, packet, again)
        taken = message._replace(received=self.hub.clock(), token=token)
        if message.qos and self.durable:
            self._unacked.append(taken)
        if self.connected:
            self._inbox.put(taken)

    def subscribe(self, filters: Sequence[str], as_published: Sequence[str] = ()) -> None:
        """See `Bus`."""
        self._as_published.extend(as_published)
        self._filters.extend(filters)
        if self.connected:
            self._replay(filters)

    def publish(self, message: Message) -> None:
        """See `Bus`."""
        self._outbox.put(message, connected=self.connected)

    def post(self, message: Message) -> None:
        """See `Bus`."""
        self._inbox.put(message._replace(received=self.hub.clock()))

    def receive(self, timeout: float | None = 0.0, most: int = WINDOW) -> list[Message]:
        """See `Bus`."""
        taken: list[Message] = []
        try:
            if most and timeout != 0.0:
                taken.append(self._inbox.get(timeout=timeout))
            while len(taken) < most:
                taken.append(self._inbox.get_nowait())
        except queue.Empty:
            pass
        return [message for message in taken if message.topic != WAKE_TOPIC and not self._came_before(message)]

    def ack(self, messages: Iterable[Message]) -> None:
        """See `Bus`."""
        done = {id(message) for message in messages}
        self._unacked = deque(message for message in self._unacked if id(message) not in done)

    def close(self) -> None:
        """See `Bus`."""
        self._outbox.close(self._will, connected=self.connected)
        self.connected = False
        self.hub.clients.remove(self)

    def _send(self, message: Message) -> bool:
        self.hub.deliver(message)
        return True

    def _replay(self, filters: Sequence[str]) -> None:
        for topic, message in list(self.hub.retained.items()):
            if any(topic_matches(wanted, topic) for wanted in filters):
                self.take(message)

    def _came_before(self, message: Message) -> bool:
        """Of an older connection of a durable session: it comes again."""
        return self.durable and message.token is not None and message.token.connection != self.connections
