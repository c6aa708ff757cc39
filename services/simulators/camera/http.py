"""The camera on the network: connections, authentication, latency, pictures and the endless answers."""

from __future__ import annotations

import socket
import struct
import sys
from collections import deque
from collections.abc import Callable, Generator
from contextlib import closing, suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from threading import Event, Lock
from typing import Any

from services.simulators.camera import audio
from services.simulators.camera.device import Device
from services.simulators.camera.digest import Door, Verdict
from services.simulators.camera.endless import ENDLESS
from services.simulators.camera.faults import Faults, Network
from services.simulators.camera.messages import Answer, Request, read, refusal, spelt
from services.simulators.camera.onvif.service import Onvif
from services.simulators.camera.port import Port
from services.simulators.camera.view.picture import Pictures

IMAGE = "image/jpeg"
LOG_LENGTH = 2000
SOAP_BYTES = 1 << 20
ROOT = b"<html><head><title>WEB</title></head><body></body></html>"


class CameraServer(Port):
    """One camera's port: what all its connections share."""

    def __init__(
        self, address: tuple[str, int], device: Device, door: Door, pictures: Pictures, clock: Callable[[], float]
    ) -> None:
        super().__init__(address, Connection)
        self.device, self.door, self.pictures, self.clock = device, door, pictures, clock
        self.closing, self.log = Event(), deque[dict[str, Any]](maxlen=LOG_LENGTH)
        self.faults, self.network = Faults(), Network()
        self.cuts: list[Callable[[], None]] = []  # how the connections of other ports are cut
        self.running = Event()  # cleared while frozen
        self.running.set()
        self.control, self.snapshot, self._lock = Lock(), Lock(), Lock()
        self._open: set[socket.socket] = set()
        self.onvif: Onvif | None = None

    def delay(self, seconds: float) -> None:
        """Waits as long as the camera needs, or until it is switched off."""
        if seconds > 0:
            self.closing.wait(seconds)

    def judge(self, method: str, target: str, header: str | None, address: str) -> Verdict:
        """The door's verdict, one request at a time."""
        with self._lock:
            return self.door.judge(method, target, header, self.clock(), address)

    def judge_viewer(self, method: str, header: str | None) -> bool:
        """The same for RTSP, where the challenge is another's."""
        with self._lock:
            return self.door.judge_viewer(method, header, self.clock())

    @property
    def is_off(self) -> bool:
        """Whether nobody is answered: it restarts, or is switched off, or a router says that it is not there."""
        return self.device.booting(self.clock()) or self.closing.is_set() or self.network.refuses

    @property
    def shows_pictures(self) -> bool:
        """Whether new pictures go out."""
        way = self.running.is_set() and self.network.up.is_set()
        return way and not self.faults.frozen_stream and not self.is_off

    @property
    def turns_viewers_away(self) -> bool:
        """Whether a new RTSP connection is closed at once."""
        return self.faults.always == "close" or not self.network.up.is_set()

    @property
    def connected(self) -> int:
        """How many connections there are."""
        return len(self._open)

    def enter(self, connection: socket.socket) -> None:
        """A connection was opened."""
        with self._lock:
            self._open.add(connection)

    def leave(self, connection: socket.socket) -> None:
        """A connection is about to be closed."""
        with self._lock:
            self._open.discard(connection)

    def set_account(self, user: str, password: str) -> None:
        """Another password; the old one does not pass any more."""
        with self._lock:
            self.door.set_account(user, password)
        if self.onvif is not None:
            self.onvif.set_account(user, password)

    def restart(self) -> None:
        """Somebody pulled the plug and put it in again."""
        self.device.step(lambda: self.device.reboot(self.clock()))
        self.went_down()

    def went_down(self) -> None:
        """The camera restarts: nobody is connected any more, no nonce is known."""
        with self._lock:
            self.door.forget()
        self.drop()

    def challenges(self, *, stale: bool = False) -> list[str]:
        """What the door asks of somebody who said nothing."""
        with self._lock:
            return self.door.challenges(stale=stale)

    def drop(self) -> None:
        """Cuts every connection."""
        with self._lock:
            for connection in self._open:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)
        self.device.events.wake_all()
        self.cut_streams()

    def cut_streams(self) -> None:
        """Ends the RTSP connections."""
        for cut in self.cuts:
            cut()

    def switch_off(self) -> None:
        """Ends every wait and connection, so that `server_close` finds no thread left."""
        self.closing.set()
        self.running.set()
        self.network.up.set()
        self.drop()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that went away is none of our concern; anything else is a bug and told as usual."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class Connection(BaseHTTPRequestHandler):
    """One connection, one request: the camera closes after every answer."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    server: CameraServer

    def setup(self) -> None:
        """The connection was accepted."""
        super().setup()
        self.server.enter(self.connection)

    def finish(self) -> None:
        """The connection is done with."""
        self.server.leave(self.connection)
        super().finish()

    def handle(self) -> None:
        """One request, unless the camera is off."""
        if self.server.is_off:
            self._reset()
        else:
            self.handle_one_request()

    def do_GET(self) -> None:
        """One request, of any method."""
        self.close_connection = True
        entry = {"time": self.server.clock(), "method": self.command, "target": self.path, "status": None}
        entry["authorized"] = "Authorization" in self.headers
        if not self.server.network.passes(self.connection, self.server.closing):
            return self._reset()
        self.server.log.append(entry)
        self.server.running.wait()
        if fault := self.server.faults.next():
            return self._fail(fault, entry)
        if self.path == "/":
            return self._send(Answer(ROOT, content_type="text/html"), entry)
        if self.server.connected > self.server.device.profile.max_connections:
            return self._turn_away(entry)
        if self.path.startswith("/onvif/"):
            return self._soap(entry)
        header, (address, _) = self.headers.get("Authorization"), self.client_address
        verdict = self.server.judge(self.command, self.path, header, address)
        if verdict.passed:
            return self._serve(read(self.path), entry)
        return self._challenge(verdict, entry)

    do_POST = do_GET  # noqa: N815 (the base class looks for these names)

    def _serve(self, request: Request, entry: dict[str, Any]) -> None:
        endless = ENDLESS.get((request.cgi, request.action))
        if (
            request.cgi == "audio" and request.text("channel", "1") == "0"
        ):  # never good here, and this is how it says so
            self._challenge(Verdict(False, self.server.challenges(stale=True)), entry)
        elif request.cgi == "audio" and request.action == "postAudio" and self.command == "POST":
            self._speaker(entry)
        elif endless is not None:
            self._endless(endless(self.server, request), entry)
        elif request.cgi == "snapshot":
            self._snapshot(request, entry)
        else:
            self._control(request, entry)

    def _control(self, request: Request, entry: dict[str, Any]) -> None:
        """One at a time, and it acts when it has been processed."""
        encoders = self.server.device.tables.encoders
        with self.server.control:
            self.server.delay(self.server.device.latency.control(self.server.clock()))
            answer = self.server.device.answer(request, self.server.clock())
        self._send(answer, entry)
        if self.server.device.booting(self.server.clock()):
            self.server.went_down()
        elif self.server.device.tables.encoders != encoders:
            self.server.cut_streams()

    def _soap(self, entry: dict[str, Any]) -> None:
        """ONVIF checks logins itself, message by message."""
        onvif, clock = self.server.onvif, self.server.clock
        if onvif is None or self.command != "POST":
            return self._send(Answer(b"", 404), entry)
        length = self.headers.get("Content-Length", "")
        body, host = self.rfile.read(min(int(length), SOAP_BYTES) if length.isdigit() else 0), self.headers["Host"]
        with self.server.control:
            self.server.delay(self.server.device.latency.control(clock()))
            answer = self.server.device.step(lambda: onvif.answer(body, host, clock()))
        self._send(answer, entry)
        if self.server.device.booting(clock()):
            self.server.went_down()

    def _snapshot(self, request: Request, entry: dict[str, Any]) -> None:
        """Overlapping snapshots fail."""
        if not self.server.snapshot.acquire(blocking=False):
            return self._send(refusal(self.server.device.profile), entry)
        try:
            self.server.delay(self.server.device.latency.snapshot())
            data = self.server.pictures.jpeg("MainFormat", self.server.clock())
        finally:
            self.server.snapshot.release()
        if how := self.server.device.drops_snapshot():
            return self._fail(how, entry)
        return self._send(Answer(self.server.faults.picture(data), content_type=IMAGE), entry)

    def _speaker(self, entry: dict[str, Any]) -> None:
        length, kind = self.headers.get("Content-Length", ""), self.headers.get("Content-Type", "")
        entry["status"] = 200
        answer = audio.speaker(self.server, self.rfile, int(length) if length.isdigit() else 0, kind)
        with suppress(OSError):  # whoever sent it has often gone
            self._send(answer, entry)

    def _endless(self, chunks: Generator[bytes], entry: dict[str, Any]) -> None:
        entry["status"] = 200
        with closing(chunks):
            for chunk in chunks:
                self._write(chunk)

    def _challenge(self, verdict: Verdict, entry: dict[str, Any]) -> None:
        entry["status"] = 401
        offers = "".join(f"WWW-Authenticate: {offer}\r\n" for offer in verdict.challenges)
        head = f"HTTP/1.1 401 Unauthorized\r\n{offers}Connection: close\r\nCONTENT-LENGTH: {len(verdict.body)}\r\n\r\n"
        self._write(spelt(self.server.device.profile, head) + verdict.body)

    def _turn_away(self, entry: dict[str, Any]) -> None:
        """Too many are connected; a 401 then says nothing about the password."""
        if self.server.device.profile.over_limit == 401:
            return self._challenge(Verdict(False, self.server.challenges()), entry)
        return self._send(Answer(b"Error\r\nBad Request!\r\n", 400), entry)

    def _fail(self, how: str, entry: dict[str, Any]) -> None:
        entry["status"] = how
        if how == "close":
            return self._reset()
        if how == "401":
            return self._challenge(Verdict(False, self.server.challenges()), entry)
        return self._send(Answer(b"Error\r\n", 500) if how == "500" else Answer(b"busy\r\n"), entry)

    def _send(self, answer: Answer, entry: dict[str, Any]) -> None:
        entry["status"] = answer.status
        head = f"HTTP/1.1 {answer.status} {HTTPStatus(answer.status).phrase}\r\nConnection: close\r\n"
        head += f"Content-Length: {len(answer.body)}\r\nContent-Type: {answer.content_type}\r\n\r\n"
        self._write(spelt(self.server.device.profile, head) + answer.body)

    def _write(self, data: bytes) -> None:
        self.server.network.passes(self.connection, self.server.closing)
        self.connection.sendall(data)

    def _reset(self) -> None:
        """Closes without an answer, so that the other side sees a reset."""
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.connection.close()

    def log_message(self, format: str, *args: Any) -> None:
        """The request log is the side door's."""
