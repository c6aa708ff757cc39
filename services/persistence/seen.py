"""Which messages are stored already: a broker sends again what it has no acknowledgement of. Pure.

After a crash between commit and acknowledgement the broker sends the same packets again, with the same ids and the
flag DUP, because the session is kept. So each turn stores, in the transaction of its rows, the packet ids that it
handled and a checksum of each message; a message is the second of its kind when all three agree. A broker that was
killed itself may give old messages new ids: those cannot be told from new ones, by anybody.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterable
from zlib import crc32

from services.bus import Message
from services.storage import SeenTurn

# All packet ids that there are. The broker's window (1000) would do if it kept it: while messages are queued behind the
# window mosquitto 2.0.11 lets several new ones out for one acknowledgement; 7000 were seen under way at once.
REMEMBERED = 65_535
SLOTS = 65_536  # turns that are stored, one row each, the oldest overwritten: enough when each has but one message
PAIR = struct.Struct("<HI")


class Seen:
    """What one writer (a client of the broker) has handled lately."""

    def __init__(self, client: str) -> None:
        self._client = client
        self._known: dict[int, int] = {}  # packet id to checksum, oldest first
        self._fresh: deque[bytes] = deque(maxlen=REMEMBERED)  # pairs that are not committed yet
        self._turn = 0

    @property
    def any(self) -> bool:
        """Whether there ever was one, so that the broker must know us."""
        return bool(self._known)

    def learn(self, turns: Iterable[SeenTurn]) -> None:
        """What the database remembers."""
        for turn in sorted(turns, key=lambda one: one.turn):
            self._turn = max(self._turn, turn.turn)
            for packet, checksum in PAIR.iter_unpack(turn.packets):
                self._remember(packet, checksum)

    def is_second(self, message: Message) -> bool:
        """Whether this message was handled before; from now on it was."""
        delivery = message.token
        if delivery is None or not message.qos:
            return False
        checksum = crc32(message.topic.encode()) ^ crc32(message.payload)
        if delivery.again and self._known.get(delivery.packet) == checksum:
            return True
        self._remember(delivery.packet, checksum)
        self._fresh.append(PAIR.pack(delivery.packet, checksum))
        return False

    def turn(self) -> SeenTurn | None:
        """What goes with the rows of this turn, and of turns before that had none; None when nothing is new."""
        if not self._fresh:
            return None
        return SeenTurn(self._client, (self._turn + 1) % SLOTS, self._turn + 1, b"".join(self._fresh))

    def committed(self) -> None:
        """What `turn` gave is stored."""
        self._turn += 1
        self._fresh.clear()

    def _remember(self, packet: int, checksum: int) -> None:
        known = self._known
        known.pop(packet, None)
        known[packet] = checksum
        if len(known) > REMEMBERED:
            del known[next(iter(known))]
