"""What one of our ROS topics sends: everything of a turn in one write, and to who comes new first what is kept.

rospy writes message by message, each with a change of threads. Here a turn's messages are joined and go from the main
thread to the kernel; a thread writes on to a subscriber that is behind. One lock stands between what is kept for a
newcomer and the first live message, so that no older word follows a newer one. Not here: making and registering the
topic (`ros.py`).
"""

from __future__ import annotations

import logging
import socket
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

log = logging.getLogger(__name__)


class Line:
    """To one subscriber, by a connection of rospy's. The kernel takes what it can; `queue` turns wait, the newest."""

    def __init__(self, connection: Any, queue: int) -> None:
        self.connection = connection
        self._queue = queue
        self._waiting: deque[memoryview] = deque()
        self._lock = threading.Lock()
        self._behind = False  # the thread writes, nobody else may

    def write(self, data: bytes) -> None:
        """Waits for nobody; OSError or AttributeError when the connection has ended."""
        with self._lock:
            self.connection.stat_bytes += len(data)
            self.connection.stat_num_msg += 1
            if not self._behind:
                left = memoryview(data)[self._sent(data) :]
                if not left:
                    return
                self._behind = True
                threading.Thread(target=self._catch_up, args=(left,), name="slow subscriber", daemon=True).start()
                return
            self._waiting.append(memoryview(data))
            if len(self._waiting) > self._queue:
                self._waiting.popleft()

    def _sent(self, data: bytes) -> int:
        try:
            return int(self.connection.socket.send(data, socket.MSG_DONTWAIT))
        except BlockingIOError:
            return 0

    def _catch_up(self, left: memoryview) -> None:
        """A thread's body. A connection that has ended is found by the next `write`."""
        data: memoryview | None = left
        while data is not None:
            try:
                self.connection.socket.sendall(data)
            except (OSError, AttributeError) as error:
                log.info("a subscriber has gone: %s", error)
                data = None
            with self._lock:
                data = self._waiting.popleft() if data is not None and self._waiting else None
                self._behind = data is not None


class Outgoing:
    """`say` and `flush` are the main thread's; the rest is rospy's SubscribeListener, on threads of rospy."""

    def __init__(self, queue: int) -> None:
        self._queue = queue
        self._kept: dict[str, bytes] = {}
        self._waiting: list[bytes] = []
        self._greeted: tuple[Line, ...] = ()  # those who have got what is kept
        self._connections: Callable[[], list[Any]] = list
        self._lock = threading.Lock()

    def attach(self, topic: Any) -> None:
        """The topic of rospy that it speaks for; until then messages are only kept."""
        self._connections = lambda: list(topic.connections or ())

    @property
    def listeners(self) -> int:
        """How many listen, without those who left since."""
        here = self._connections()
        return sum(one.connection in here for one in self._greeted)

    def say(self, data: bytes, key: str | None = None) -> None:
        """A message with its length before it; `key`: kept for who comes, instead of the older one of that key."""
        with self._lock:
            if key is not None:
                self._kept[key] = data
            if self._greeted:
                self._waiting.append(data)

    def again(self) -> None:
        """Says everything that is kept once more, to all."""
        with self._lock:
            self._waiting.extend(self._kept.values())

    def flush(self) -> None:
        """Sends what was said since."""
        if not self._waiting:
            return
        with self._lock:
            gone = self._write(self._greeted, self._waiting)
            self._waiting = []
        self._close(gone)

    def peer_subscribe(self, topic: str, publish: Any, publish_to_peer: Any) -> None:
        """Greets whoever is new. Which connection that is rospy does not say."""
        with self._lock:
            gone = self._write(self._greeted, self._waiting)  # for those who are here already
            self._waiting = []
            known = [one.connection for one in self._greeted]
            new = tuple(Line(one, self._queue) for one in self._connections() if one not in known)
            self._greeted += new
            gone += self._write(new, list(self._kept.values()))
        self._close(gone)

    def peer_unsubscribe(self, topic: str, peers: int) -> None:
        """Forgets who has gone."""
        with self._lock:
            here = self._connections()
            self._greeted = tuple(one for one in self._greeted if one.connection in here)

    def _write(self, lines: tuple[Line, ...], messages: list[bytes]) -> list[Line]:
        """Says it to all; those who have gone."""
        gone: list[Line] = []
        if not messages:
            return gone
        data = messages[0] if len(messages) == 1 else b"".join(messages)
        for line in lines:
            try:
                line.write(data)
            except (OSError, AttributeError) as error:  # rospy takes the socket away when it closes
                log.info("a subscriber has gone: %s", error)
                gone.append(line)
        return gone

    def _close(self, gone: list[Line]) -> None:
        """Never under our lock: rospy takes its own to close, and holds it while it tells us of another."""
        for line in gone:
            line.connection.close()
