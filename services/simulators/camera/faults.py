"""What is wrong with the camera or its network just now, as the tests ordered it; how to order it is in `troubles`."""

from __future__ import annotations

import socket
from contextlib import suppress
from dataclasses import dataclass, field
from threading import Event

LOOKS_S = 0.1  # how often a connection that waits for the network looks whether all is over


@dataclass
class Faults:
    """How requests fail, and what the streams do not do; the streams look at their flags themselves."""

    left: int = 0  # of the next requests fail
    how: str = "close"  # or 401, 500, text
    always: str | None = None  # every request fails, in one of the same ways
    silent_events: bool = False  # event streams stay open and say nothing, not even that they live
    frozen_stream: bool = False  # video connections stay open without a new picture
    corrupt_jpeg: bool = False

    def next(self) -> str | None:
        """How this request is to fail."""
        if self.left <= 0:
            return self.always
        self.left -= 1
        return self.how

    def picture(self, jpeg: bytes) -> bytes:
        """The picture as it goes out: whole, or with its second half lost."""
        return jpeg[: len(jpeg) // 2] if self.corrupt_jpeg else jpeg


def _up() -> Event:
    event = Event()
    event.set()
    return event


@dataclass
class Network:
    """The way to the camera: while it is cut nothing arrives, and nothing that is sent reaches anybody.

    As with a pulled plug neither side is told: a connection whose client has waited goes on afterwards, what was
    asked by a client that gave up never arrives. `refuses`: a router answers for the camera that it is not there.
    """

    up: Event = field(default_factory=_up)
    refuses: bool = False

    def passes(self, connection: socket.socket, closing: Event) -> bool:
        """Waits while the network is cut; whether what was sent then still arrives."""
        if self.up.is_set():
            return True
        while not self.up.wait(LOOKS_S):
            if closing.is_set():
                return False
        return _is_open(connection)


def _is_open(connection: socket.socket) -> bool:
    """Whether the other side has not closed."""
    with suppress(BlockingIOError):
        try:
            return connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT) != b""
        except BlockingIOError:
            return True
        except OSError:
            return False
    return True
