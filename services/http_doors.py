"""HTTP servers with a thread for each connection, in which those who come and say nothing keep nobody else out.

One address has so many connections at once and no more, and whoever has not said within HEAD_S what he wants is sent
away, however steadily he sends (a "slow loris"). Not here: the dashboard's server, `dashboard/http/connection.py`.
"""

from __future__ import annotations

import logging
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from threading import Thread
from time import monotonic
from typing import Any

log = logging.getLogger(__name__)

HEAD_S = 10.0  # for a whole request
STALLED_S = 10.0  # one who takes nothing for so long is gone
POLL_S = 0.5  # between two looks for those who are late, or whether the port is to close


class Doors(ThreadingHTTPServer):
    """The port, served in a thread of its own until `close`. OSError when it cannot listen there."""

    daemon_threads = False  # they end by themselves: see close
    request_queue_size = 32

    def __init__(self, host: str, port: int, handler: Callable[..., BaseHTTPRequestHandler], most_each: int) -> None:
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        super().__init__((host, port), handler)
        self.most_each = most_each
        self._open: dict[socket.socket, str] = {}
        self._silent: dict[socket.socket, float] = {}  # since when, of those who have not said what they want
        self._thread = Thread(target=self.serve_forever, args=(POLL_S,), name="http", daemon=True)

    def begin(self) -> None:
        """Serves from now on."""
        self._thread.start()

    def server_bind(self) -> None:
        """Binds; asks no name server for its own name."""
        host, port = str(self.server_address[0]), self.server_address[1]
        try:
            TCPServer.server_bind(self)
        except OSError as error:
            raise OSError(error.errno, f"cannot listen on {host}:{port}: {error.strerror}") from error
        self.server_name, self.server_port = str(self.server_address[0]), int(self.server_address[1])

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """More connections of one address than it may have are closed without a word."""
        address = str(client_address[0])
        if list(self._open.values()).count(address) >= self.most_each:
            return False
        self._open[request], self._silent[request] = address, monotonic()
        return True

    def heard(self, connection: socket.socket) -> None:
        """Somebody has said what he wants."""
        self._silent.pop(connection, None)

    def service_actions(self) -> None:
        """Every POLL_S: sends away who is late."""
        late = monotonic() - HEAD_S
        for connection in [one for one, since in list(self._silent.items()) if since < late]:
            self.heard(connection)
            _end(connection)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """One connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.heard(request)
            del self._open[request]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Who went away before his answer came is no fault of ours; anything else is, and told."""
        if not isinstance(sys.exception(), OSError):
            log.exception("%s could not be answered", client_address[0])

    def close(self) -> None:
        """Ends the port and every connection."""
        self.shutdown()
        self._thread.join()
        for connection in list(self._open):
            _end(connection)
        self.server_close()


class Visitor(BaseHTTPRequestHandler):
    """One connection to `Doors`."""

    server: Doors
    timeout = STALLED_S

    def parse_request(self) -> bool:
        """See the standard library; what is wanted has been said."""
        understood = super().parse_request()
        self.server.heard(self.connection)
        return understood


def _end(connection: socket.socket) -> None:
    with suppress(OSError):  # it was about to end by itself
        connection.shutdown(socket.SHUT_RDWR)
