"""What has come and is still to be handled: how much of it is kept, and when more is left to gather."""

from __future__ import annotations

import queue
import time

from services.bus import Message

FLOOD = 4, 4000.0  # messages at once, and a second, from which one at a time costs a change of threads for each
GATHER_S = 0.002  # in a flood the next ones are left to gather so long
LIMIT = 20_000  # waiting messages, beyond which those of QoS 0 are dropped


class Inbox:
    """Filled from any thread, emptied by one; `gathers` when another thread fills it than the one that empties it."""

    def __init__(self, *, gathers: bool) -> None:
        self.dropped = 0
        self._gathers = gathers
        self._waiting: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._flooded = False
        self._taken = time.monotonic()

    @property
    def empty(self) -> bool:
        """Whether nothing waits."""
        return self._waiting.empty()

    def put(self, message: Message) -> None:
        """Of QoS 0 the newest are dropped, and counted, when too many wait; QoS 1 is held back by the window."""
        if message.token is not None and message.qos == 0 and self._waiting.qsize() > LIMIT:
            self.dropped += 1
            return
        self._waiting.put(message)

    def take(self, timeout: float | None, most: int) -> list[Message]:
        """All that waits, `most` at most; waits up to `timeout` s for the first, None: for ever."""
        if self._flooded and self._gathers:
            time.sleep(GATHER_S)
        get, taken = self._waiting.get_nowait, []
        try:
            taken.append(self._waiting.get(timeout=timeout) if timeout != 0.0 else get())
            while len(taken) < most:
                taken.append(get())
        except queue.Empty:
            pass
        before, self._taken = self._taken, time.monotonic()
        self._flooded = len(taken) >= max(FLOOD[0], FLOOD[1] * (self._taken - before))
        return taken
