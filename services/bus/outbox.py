"""What is still to be said: which messages are kept while there is no connection, and in which order they go out.

* A **state** (`retain`) is remembered, the newest of each topic, and said again after every reconnect, unless it
  is marked `once`.
* An **event** waits in a queue of `LIMIT`; when it is full the oldest goes, and is counted.
* A **command** or **blob** (`expires_s`) is dropped at once and counted: a late command is worse than none.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from services.bus import Message

LIMIT = 1000  # events of some minutes; a scan or an order makes a handful


class Outbox:
    """Used from one thread. `send` says whether it took the message; what it did not take waits."""

    def __init__(self, send: Callable[[Message], bool], birth: Message | None = None) -> None:
        self._send = send
        self._birth = birth
        self._states: dict[str, Message] = {}
        self._waiting: deque[Message] = deque()
        self.dropped = 0

    def put(self, message: Message, *, connected: bool) -> None:
        """Sends, or keeps what is worth keeping."""
        if message.retain and not message.once:
            self._states[message.topic] = message
        if connected and not self._waiting and self._send(message):
            return
        if connected or not message.retain or message.once:
            self.keep([message])

    def keep(self, messages: list[Message]) -> None:
        """Puts messages behind those that wait."""
        for message in messages:
            if message.expires_s is not None:
                self.dropped += 1
                continue
            self._waiting.append(message)
            if len(self._waiting) > LIMIT:
                self._waiting.popleft()
                self.dropped += 1

    def flush(self, unacknowledged: list[Message] | None = None) -> None:
        """After a connect: birth, all states, then the events in their order, first those never acknowledged."""
        waiting = [*(unacknowledged or []), *self._waiting]
        self._waiting.clear()
        for message in [*([self._birth] if self._birth else []), *self._states.values()]:
            self._send(message)
        self.keep(waiting)
        self.drain()

    def drain(self) -> None:
        """Sends what waits, as far as it is taken."""
        while self._waiting and self._send(self._waiting[0]):
            self._waiting.popleft()

    def close(self, farewell: Message | None, *, connected: bool) -> None:
        """A clean end sends no last will, so it is said here."""
        if connected:
            self.drain()
            if farewell is not None:
                self._send(farewell)
