"""What one of our ROS topics sends: everything of a turn in one write, and to who comes new first what is kept.

rospy writes message by message, each with a change of threads; a turn's messages are joined here instead. One lock
stands between what is kept for a newcomer and the first live message, so that no older word follows a newer one.
Not here: making and registering the topic (`ros.py`).
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

log = logging.getLogger(__name__)


class Outgoing:
    """`say` and `flush` are the main thread's; the rest is rospy's SubscribeListener, on threads of rospy."""

    def __init__(self, broken: tuple[type[Exception], ...]) -> None:
        self._broken = broken  # what a connection may raise that ended
        self._kept: dict[str, bytes] = {}
        self._waiting: list[bytes] = []
        self._greeted: tuple[Any, ...] = ()  # connections that have got what is kept
        self._connections: Callable[[], list[Any]] = list
        self._lock = threading.Lock()

    def attach(self, topic: Any) -> None:
        """The topic of rospy that it speaks for; until then messages are only kept."""
        self._connections = lambda: list(topic.connections or ())

    @property
    def listeners(self) -> int:
        """How many listen, without those who left since."""
        here = self._connections()
        return sum(one in here for one in self._greeted)

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
            data = self._waiting[0] if len(self._waiting) == 1 else b"".join(self._waiting)
            self._waiting = []
            gone = [connection for connection in self._greeted if not self._write(connection, data)]
        self._close(gone)

    def peer_subscribe(self, topic: str, publish: Any, publish_to_peer: Any) -> None:
        """Greets whoever is new. Which connection that is rospy does not say."""
        with self._lock:
            waiting, self._waiting = b"".join(self._waiting), []  # for those who are here already
            gone = [one for one in self._greeted if waiting and not self._write(one, waiting)]
            kept = b"".join(self._kept.values())
            new = [one for one in self._connections() if one not in self._greeted]
            self._greeted = (*self._greeted, *new)
            gone += [one for one in new if kept and not self._write(one, kept)]
        self._close(gone)

    def peer_unsubscribe(self, topic: str, peers: int) -> None:
        """Forgets who has gone."""
        with self._lock:
            here = self._connections()
            self._greeted = tuple(one for one in self._greeted if one in here)

    def _write(self, connection: Any, data: bytes) -> bool:
        """Into rospy's queue, whose thread does the sending; False when the connection has ended."""
        try:
            connection.write_data(data)
        except self._broken as error:
            log.info("a subscriber has gone: %s", error)
            return False
        return True

    def _close(self, gone: list[Any]) -> None:
        """Never under our lock: rospy takes its own to close, and holds it while it tells us of another."""
        for connection in gone:
            connection.close()
