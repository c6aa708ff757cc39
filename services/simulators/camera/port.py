"""A port of the simulator's own, for HTTP: the camera's and the side door's."""

from __future__ import annotations

from http.server import ThreadingHTTPServer
from socketserver import TCPServer


class Port(ThreadingHTTPServer):
    """A port that asks no name server for its own name, and waits for its threads when it is closed."""

    daemon_threads = False
    request_queue_size = 64

    def server_bind(self) -> None:
        """Binds; the name is the address."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = str(self.server_address[0]), int(self.server_address[1])
