"""A network between a service and a camera that can be cut: a TCP relay on loopback. What it does to TCP is real.

While it is cut, nothing that is on its way arrives and no connection is made: the kernel drops the SYN of whoever
knocks at a full queue, as a router without a link does, and the sender's own kernel tries again after 1, 3, 7 s.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

PIECE = 65536
POLL_S = 0.05


class Network:
    """A relay to one port; `port` is where it listens."""

    def __init__(self, to: int) -> None:
        self.to = to
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=64)
        self._listener.settimeout(POLL_S)
        self.port = int(self._listener.getsockname()[1])
        self._flowing, self._parked, self._closing = threading.Event(), threading.Event(), threading.Event()
        self._flowing.set()
        self.let_in: list[float] = []  # when a connection was, seconds since 1970
        self.spoke: list[float] = []  # when whoever was let in said its first word to the other side
        self._lost: list[socket.socket] = []  # our own that fill the queue, and who was let in too late
        self._open: set[socket.socket] = set()
        self._far: set[socket.socket] = set()
        self._threads = [threading.Thread(target=self._accept, name="network")]
        self._threads[0].start()

    def cut(self) -> None:
        """Nothing arrives any more, and what was on its way is lost; the near side does not learn of it."""
        self._parked.clear()
        self._flowing.clear()
        self._parked.wait()
        for far in list(self._far):
            with suppress(OSError):
                far.shutdown(socket.SHUT_RDWR)
        self._listener.listen(0)
        self._lost += self._waiting()
        for _ in range(3):  # the queue of the kernel is one longer than it was told
            filler = socket.socket()
            filler.setblocking(False)
            with suppress(BlockingIOError):
                filler.connect(("127.0.0.1", self.port))
            self._lost.append(filler)

    def mend(self) -> None:
        """Who knocks again is let in."""
        if self._flowing.is_set():
            return
        lost = [*self._lost, *self._waiting()]
        self._lost.clear()
        self._listener.listen(64)
        self._flowing.set()
        for one in lost:
            one.close()

    def _waiting(self) -> list[socket.socket]:
        """Who stands in the kernel's queue."""
        found = []
        self._listener.setblocking(False)
        with suppress(BlockingIOError):
            while True:
                found.append(self._listener.accept()[0])
        self._listener.settimeout(POLL_S)
        return found

    def close(self) -> None:
        """Ends every connection and thread."""
        self._closing.set()
        self.mend()
        for one in list(self._open):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join(5)
        self._listener.close()

    def _accept(self) -> None:
        while not self._closing.is_set():
            if not self._flowing.is_set():
                self._parked.set()
                self._flowing.wait(POLL_S)
                continue
            try:
                near, _ = self._listener.accept()
            except TimeoutError:
                continue
            if not self._flowing.is_set():
                self._lost.append(near)
                continue
            self.let_in.append(time.time())
            try:
                far = socket.create_connection(("127.0.0.1", self.to), timeout=2)
            except OSError:
                near.close()
                continue
            far.settimeout(None)
            near.settimeout(None)
            self._open |= {near, far}
            self._far.add(far)
            ends = threading.Barrier(2, action=lambda pair=(near, far): self._end(pair))  # type: ignore[misc]
            for source, target in ((near, far), (far, near)):
                thread = threading.Thread(target=self._pump, args=(source, target, ends), daemon=True, name="pump")
                self._threads.append(thread)
                thread.start()

    def _pump(self, source: socket.socket, target: socket.socket, ends: threading.Barrier) -> None:
        silent = target in self._far
        with suppress(OSError):
            while piece := source.recv(PIECE):
                self._flowing.wait()
                if silent:
                    self.spoke.append(time.time())
                    silent = False
                target.sendall(piece)
        self._flowing.wait()
        with suppress(OSError):
            target.shutdown(socket.SHUT_WR)
        ends.wait()

    def _end(self, pair: tuple[socket.socket, socket.socket]) -> None:
        for one in pair:
            self._open.discard(one)
            self._far.discard(one)
            one.close()


@dataclass(frozen=True)
class Link:
    """The way to a camera's web server and that to its video: they are cut and mended together."""

    web: Network
    video: Network

    def cut(self) -> None:
        """See `Network`."""
        self.web.cut()
        self.video.cut()

    def mend(self) -> None:
        """See `Network`; the way to the video first: whoever wants that could come first."""
        self.video.mend()
        self.web.mend()


@contextmanager
def network(to: int) -> Iterator[Network]:
    """A relay to that port until the end of the block."""
    relay = Network(to)
    try:
        yield relay
    finally:
        relay.close()
