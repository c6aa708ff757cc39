"""Our own stream: the newest picture for everybody who may look, as multipart JPEG, and one picture at a time.

    /camera/<cam>/stream.mjpg     while MJPEG is on
    /camera/<cam>/rtsp.mjpg       the same while RTSP is on: for who shows it on ROS and in the dashboard
    /camera/<cam>/snapshot.jpg    always: the newest picture, or a snapshot taken for it

X-Timestamp says of each picture when it was exposed, as is estimated, in seconds since 1970.
No credentials: loopback and the configured networks may look, all others get 403. Nothing else is served. The standard
library's threading server does: a viewer is a loop that waits for a picture and writes it, and a thread each makes a
slow one nobody else's trouble; it skips pictures, because it takes the newest one whenever it is ready.
"""

from __future__ import annotations

import re
import select
import socket
from collections.abc import Callable
from http import HTTPStatus
from ipaddress import ip_address
from threading import BoundedSemaphore
from time import monotonic
from typing import Any
from urllib.parse import urlsplit

from services.camera.video.newest import Encoded, Newest
from services.camera.video.settings import Network, StreamSettings
from services.http_doors import Doors, Visitor
from services.payloads import RTSP_PICTURE

BOUNDARY = "picture"
QUIET_S = 2.0  # between two looks whether a viewer is still there, while no picture comes
SNAPSHOT_S = 22.0  # the camera may take 20 s
FRESH_S = 2.0  # a picture as old as this is still the newest one
STRANGERS = 4  # connections at once from addresses that may not look: they are told so, and keep nobody out
SEND_BUFFER = 256 * 1024  # bytes; with more a slow viewer sees what was long ago
UNSEATED = 4  # connections that one address may have besides the seats: half of the doors
STRICT = (
    ("Cache-Control", "no-store, no-cache, must-revalidate, max-age=0"),
    ("Pragma", "no-cache"),
    ("X-Content-Type-Options", "nosniff"),
    ("Content-Security-Policy", "default-src 'none'"),
    ("Referrer-Policy", "no-referrer"),
)


class Proxy(Doors):
    """The port. `on(key)`: whether the order of that key has switched its stream on; `ask()` asks for a snapshot,
    which will come into the slot; False when there is nobody to ask.

    OSError when it cannot listen there.
    """

    def __init__(
        self, camera: str, settings: StreamSettings, newest: Newest, on: Callable[[str], bool], ask: Callable[[], bool]
    ) -> None:
        super().__init__(settings.host, settings.port, Viewer, settings.viewers + UNSEATED)
        self.settings, self.newest, self.on, self.ask = settings, newest, on, ask
        self.stream_path = f"/camera/{camera}/stream.mjpg"
        self.keys = {self.stream_path: "MJPEG", f"/camera/{camera}/{RTSP_PICTURE}": "RTSP"}
        self.snapshot_path = f"/camera/{camera}/snapshot.jpg"
        self.names = _own_names(settings)
        self.seats = BoundedSemaphore(settings.viewers)
        self.doors = BoundedSemaphore(
            2 * (settings.viewers + UNSEATED)
        )  # connections that have not said what they want, too
        self.porch = BoundedSemaphore(STRANGERS)
        self._entrances: dict[socket.socket, BoundedSemaphore] = {}
        self.closing = False
        self.begin()

    def may_look(self, address: str) -> bool:
        """Whether somebody there may look."""
        known = ip_address(address.partition("%")[0])
        known = getattr(known, "ipv4_mapped", None) or known
        return known.is_loopback or any(_within(known, network) for network in self.settings.allow)

    def knows(self, host: str) -> bool:
        """Whether a request's Host is us: a page elsewhere that gave its own name our address may not read pictures."""
        if not host:
            return True  # no browser
        name = host.lower().rpartition(":")[0] if re.fullmatch(r".*:\d*", host) else host.lower()
        name = name.rstrip(".")
        try:
            ip_address(name.removeprefix("[").removesuffix("]"))
        except ValueError:
            return name in self.names
        return True

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """More connections than there are doors are closed without a word."""
        entrance = self.doors if self.may_look(str(client_address[0])) else self.porch
        if not entrance.acquire(blocking=False):
            return False
        if not super().verify_request(request, client_address):
            entrance.release()
            return False
        self._entrances[request] = entrance
        return True

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """One connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._entrances.pop(request).release()

    def close(self) -> None:
        """Ends the port and every viewer."""
        self.closing = True
        self.newest.close()
        super().close()


class Viewer(Visitor):
    """One connection of one who looks."""

    server: Proxy
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "apartment", ""

    def setup(self) -> None:
        """A small buffer: pictures wait here, not in the network."""
        self.request.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        super().setup()

    def do_GET(self) -> None:  # noqa: N802  # the standard library's name
        """Looks."""
        self.close_connection = True
        path = self.path.partition("?")[0]
        if not self.server.may_look(str(self.client_address[0])) or not self.server.knows(self.headers["Host"] or ""):
            self._refuse(HTTPStatus.FORBIDDEN, "this address may not look: see stream.allow in the configuration")
        elif path not in (*self.server.keys, self.server.snapshot_path):
            self._refuse(HTTPStatus.NOT_FOUND, f"there are {', '.join(self.server.keys)}, {self.server.snapshot_path}")
        elif not self.server.seats.acquire(blocking=False):
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, "too many viewers", ("Retry-After", "5"))
        else:
            try:
                self._snapshot() if path == self.server.snapshot_path else self._stream(self.server.keys[path])
            finally:
                self.server.seats.release()

    def do_HEAD(self) -> None:  # noqa: N802  # the same
        """The same without pictures."""
        self.do_GET()

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """What the standard library refuses: broken requests, and methods that are not looking."""
        self.close_connection = True
        if code == HTTPStatus.NOT_IMPLEMENTED:
            self._refuse(HTTPStatus.METHOD_NOT_ALLOWED, "there is nothing to do but look", ("Allow", "GET, HEAD"))
        else:
            self._refuse(HTTPStatus(code), "not a request that is understood here")

    def _stream(self, key: str) -> None:
        if not self.server.on(key):
            return self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, f"the stream is off: order {key}")
        self._head(HTTPStatus.OK, ("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}"))
        if self.command == "HEAD":
            return None
        with self.server.newest.watched():
            self._pictures(key)
        return None

    def _pictures(self, key: str) -> None:
        """The boundary follows each picture at once: a browser shows it when it knows where it ends."""
        self.wfile.write(f"--{BOUNDARY}\r\n".encode())
        number, step, due = self.server.newest.stale(FRESH_S), 1 / self.server.settings.fps, monotonic()
        while self.server.on(key) and not self.server.closing and not self._gone(max(0.0, due - monotonic())):
            found = self.server.newest.jpeg(number, QUIET_S)
            if found is None:
                continue
            number, data, exposed = found
            due = max(due + step, monotonic())
            head = f"Content-Type: image/jpeg\r\nContent-Length: {len(data)}\r\nX-Timestamp: {exposed:.3f}\r\n\r\n"
            self.wfile.write(head.encode() + data + f"\r\n--{BOUNDARY}\r\n".encode())

    def _gone(self, within_s: float) -> bool:
        """Whether the viewer has ended the connection, or does in that time."""
        readable, _, _ = select.select([self.connection], [], [], within_s)
        return bool(readable) and self.connection.recv(1024) == b""

    def _snapshot(self) -> None:
        found = self._newest()
        if found is None:
            return self._refuse(HTTPStatus.GATEWAY_TIMEOUT, "the camera gives no picture", ("Retry-After", "5"))
        about = ("Content-Length", str(len(found.data))), ("X-Timestamp", f"{found.exposed:.3f}")
        self._head(HTTPStatus.OK, ("Content-Type", "image/jpeg"), *about)
        if self.command != "HEAD":
            self.wfile.write(found.data)
        return None

    def _newest(self) -> Encoded | None:
        newest = self.server.newest
        with newest.watched():
            number = newest.stale(FRESH_S)
            if newest.wait(number, 0.0) is None and not self.server.ask():
                return None
            return newest.jpeg(number, SNAPSHOT_S)

    def _refuse(self, status: HTTPStatus, why: str, *more: tuple[str, str]) -> None:
        body = f"{status.value} {status.phrase}: {why}\n".encode()
        self._head(status, ("Content-Type", "text/plain; charset=utf-8"), ("Content-Length", str(len(body))), *more)
        if self.command != "HEAD":
            self.wfile.write(body)

    def _head(self, status: HTTPStatus, *headers: tuple[str, str]) -> None:
        self.send_response(status)
        for name, value in (*headers, *STRICT, ("Connection", "close")):
            self.send_header(name, value)
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Who looks at what is nobody's business."""


def _within(address: Any, network: Network) -> bool:
    return address.version == network.version and address in network


def _own_names(settings: StreamSettings) -> frozenset[str]:
    own = socket.gethostname().lower()
    told = urlsplit(settings.url).hostname if settings.url else None
    return frozenset(name for name in ("localhost", own, f"{own.partition('.')[0]}.local", settings.host, told) if name)
