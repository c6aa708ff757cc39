"""Connections to the dashboard: those who come and say nothing keep nobody else out, however many they are.

One address has so many at once and no more, from the moment it knocks (also before TLS is agreed on), and a request
has to be whole within HEAD_S, however steadily it comes (a "slow loris"). What is over is closed without a word.
"""

from __future__ import annotations

import asyncio
import socket
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_EACH = 100  # a page has six, and a proxy in front of us is one address for all
HEAD_S = 10.0
COMING = (h11.IDLE, h11.SEND_BODY)  # what the other end is at while its request is not whole


class Listening(socket.socket):
    """The socket that listens: hands over no more than MOST_EACH connections of one address."""

    _given: tuple[tuple[socket.socket, str], ...] = ()

    def accept(self) -> tuple[socket.socket, Any]:
        """The next who may come in; BlockingIOError when nobody else knocks."""
        while True:
            made, address = super().accept()
            self._given = tuple(one for one in self._given if one[0].fileno() >= 0)  # those that are closed have -1
            if [host for _, host in self._given].count(address[0]) < MOST_EACH:
                self._given = (*self._given, (made, address[0]))
                return made, address
            made.close()


class Visit(H11Protocol):
    """One connection."""

    _late: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """See `asyncio.Protocol`."""
        super().connection_made(transport)
        self._wait()

    def data_received(self, data: bytes) -> None:
        """See `asyncio.Protocol`: time runs from a request's first byte to its last."""
        super().data_received(data)
        if self.conn.their_state in COMING:
            self._wait()
        else:
            self._rest()

    def connection_lost(self, exc: Exception | None) -> None:
        """See `asyncio.Protocol`."""
        self._rest()
        super().connection_lost(exc)

    def _wait(self) -> None:
        if self._late is None:
            self._late = self.loop.call_later(HEAD_S, self.transport.abort)

    def _rest(self) -> None:
        if self._late is not None:
            self._late.cancel()
            self._late = None
