"""A POST whose body takes as long as the sound in it: sent at its own pace, and not waiting for an answer.

Cameras take no chunked body, announce a length that is never reached, and answer late, with ERROR, or never. That is
not what HTTP clients do, so this one is written on the socket. Not here: what is sent (`sound/`).
"""

from __future__ import annotations

import select
import socket
import ssl
import threading
import time
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from urllib.parse import urlsplit

from services.camera.device import Away, Refused
from services.camera.web.gate import Gate

LENGTH = 9_999_999  # what clients announce that these cameras are known to take
CONNECT_S, SEND_S = 2.0, 6.0
LOOK_S = 0.3  # a camera that does not want it says so at once
LEAD_S = 0.25  # sent ahead, so that a hitch is not heard
PIECE_S = 0.1
FAREWELL_S = 1.0  # until a camera that answers at the end has done so


def upload(
    url: str, head: dict[str, str], target: str, data: bytes, rate: float, gate: Gate, ended: threading.Event
) -> bool:
    """Sends `rate` bytes a second to the end, or until `ended` is set; whether the camera knew the login.

    DeviceError when it does not take the sound.
    """
    try:
        connection = _connection(url)
        try:
            with gate.login() as login:
                connection.putrequest("POST", target, skip_accept_encoding=True)
                for name, value in {**head, "Content-Length": str(LENGTH)}.items():
                    connection.putheader(name, value)
                connection.endheaders()
                known = _known(connection.sock, LOOK_S)
            known = known and _stream(connection.sock, data, rate, ended) and _leave(connection.sock)
            if not known:
                login.failed()
            return known
        finally:
            connection.close()
    except (OSError, HTTPException) as error:
        raise Away(f"the sound did not get through: {type(error).__name__} {error}".strip()) from error


def _connection(url: str) -> HTTPConnection:
    parts = urlsplit(url)
    host = parts.hostname or ""
    if parts.scheme == "https":
        context = ssl.create_default_context()
        return HTTPSConnection(host, parts.port, timeout=CONNECT_S, context=context)
    return HTTPConnection(host, parts.port, timeout=CONNECT_S)


def _stream(wire: socket.socket, data: bytes, rate: float, ended: threading.Event) -> bool:
    wire.settimeout(SEND_S)
    size, began = max(1, round(PIECE_S * rate)), time.monotonic()
    for at in range(0, len(data), size):
        if ended.wait(max(0.0, began + at / rate - LEAD_S - time.monotonic())):
            return True
        if not _known(wire, 0.0):
            return False
        wire.sendall(data[at : at + size])
    ended.wait(max(0.0, began + len(data) / rate - time.monotonic()))
    return True


def _known(wire: socket.socket, wait_s: float) -> bool:
    """Whether no answer has come that the login is not known; Refused when it is another no."""
    if not select.select([wire], [], [], wait_s)[0]:
        return True
    said = wire.recv(4096)
    if not said:
        raise Away("the camera ended the connection")
    status = said.partition(b" ")[2]
    if status.startswith(b"401"):
        return False
    if not status.startswith(b"200") or b"\r\n\r\nerror" in said.lower():
        raise Refused(f"the camera does not take the sound: {' '.join(said.decode('ascii', 'replace').split())[:80]}")
    return True


def _leave(wire: socket.socket) -> bool:
    """Says that this was all; closing at once would throw away what the camera has not read yet."""
    wire.shutdown(socket.SHUT_WR)
    if not select.select([wire], [], [], FAREWELL_S)[0]:
        return True
    return not wire.recv(4096).partition(b" ")[2].startswith(b"401")
