"""The bus contract: what a message is, what a bus can do, and how topics match filters.

Not here: the implementations, `memory.py` (in this process), `mqtt.py` (paho, any broker) and `embedded.py`
One contract test, `tests/bus/test_contract.py`, runs against all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol

WAKE_TOPIC = "/bus/wake"  # posted to end a wait; no service sees it
SESSION_TOPIC = "/bus/session"  # posted at each connection; `value`: whether the broker had kept our messages
LOST_TOPIC = "/bus/lost"  # posted when the connection breaks, to a service that has subscribed to it


class Delivery(NamedTuple):
    """How a message with QoS 1 came: what acknowledges it, within the connection (counted from 1) that it came by.

    `again`: the broker says that it has sent this packet before, in this session (MQTT's flag DUP).
    """

    connection: int
    packet: int
    again: bool


class Message(NamedTuple):
    """One message, as it travels and as a service sees it. A tuple, since one is made for each that comes.

    Bus topics never begin with `/`; locally posted ones (`/camera/reply`) do, and carry `value`, any object that
    nobody changes any more, instead of a payload. `received` is the receiver's clock in seconds at arrival.
    `reply_to` and `correlation` are MQTT 5's response topic and correlation data, where the client sent them.
    """

    topic: str
    payload: bytes = b""
    retain: bool = False
    qos: int = 1
    received: float = 0.0
    value: object = None
    reply_to: str | None = None
    correlation: bytes | None = None
    expires_s: int | None = None  # MQTT 5 message expiry; None: never
    once: bool = False  # a state of somebody else's topic (a restored one): not said again after a reconnect
    token: Delivery | None = None  # what the bus needs to acknowledge this one


class Bus(Protocol):
    """The one contract of every bus. All calls come from the service's main thread but `post`, which any may use.

    States (`retain`) are remembered and published again after every reconnect. While there is no connection
    events wait in a bounded queue (the oldest goes first when it is full, counted in `dropped`), and commands,
    which have an expiry, are dropped and counted: a late command is worse than none (`outbox.py`). What comes waits in
    an inbox; QoS 1 is held back by the window of unacknowledged messages, of QoS 0 the newest are dropped and counted.
    """

    connections: int

    @property
    def connected(self) -> bool:
        """Whether messages go out now."""
        ...

    @property
    def listens(self) -> bool:
        """Whether it is connected, and hears from now on what it subscribed to."""
        ...

    @property
    def dropped(self) -> int:
        """How many messages were not sent for want of a connection, or not taken for want of time."""
        ...

    def subscribe(self, filters: Sequence[str], as_published: Sequence[str] = ()) -> None:
        """Asks for everything that matches; restored after every reconnect. `/bus/lost` is the bus's own word.

        `retain` marks what the broker had kept; what comes by the filters that are in `as_published` too has it as it
        was said (MQTT 5).
        """

    def publish(self, message: Message) -> None:
        """Sends without waiting, at the latest in the next `receive`."""

    def post(self, message: Message) -> None:
        """Puts a local message (topic begins with `/`) into the inbox, from any thread."""

    def receive(self, timeout: float | None = 0.0, most: int = ...) -> list[Message]:
        """All that waits, in the order of arrival, `most` at most; waits up to `timeout` s for the first.

        `timeout` None waits for ever. It also keeps the bus going (reconnected: states are said again), so it is
        called in every turn; `most=0` does that alone.
        """
        ...

    def ack(self, messages: Iterable[Message]) -> None:
        """Acknowledges; what came by an older connection is left to the broker, which sends it again."""

    def close(self) -> None:
        """Sends what is still to be sent, says `offline`, and leaves."""


def topic_matches(topic_filter: str, topic: str) -> bool:
    """Whether an MQTT filter (`+` one level, a last `#` any rest) matches a topic (MQTT 5, section 4.7).

    What stands before a shared one (`$share/<group>/`) says who gets the message, not which.
    """
    wanted = topic_filter.split("/")
    if wanted[0] == "$share":
        wanted = wanted[2:]
    levels = topic.split("/")
    if topic.startswith("$") and wanted[0] in ("+", "#"):
        return False
    for index, level in enumerate(wanted):
        if level == "#":
            return True
        if index >= len(levels) or level not in ("+", levels[index]):
            return False
    return len(wanted) == len(levels)
