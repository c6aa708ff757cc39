"""A POST whose body takes as long as the sound in it: sent at its own pace, and not waiting for an answer.

Cameras take no chunked body, announce a length that is never reached, and answer late, with ERROR, or never. That is
not what HTTP clients do, so this one is written on the socket. Not here: what is sent (`sound/`).
"""

from __future__ import annotations

import socket
import ssl
import threading
import time
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from urllib.parse import urlsplit

from services.camera.address import Address
from services.camera.device import Away, Refused
from services.camera.web.gate import Gate
from services.camera.web.trust import away, trust

LENGTH = 9_999_999  # what clients announce that these cameras are known to take
CONNECT_S, SEND_S = 2.0, 6.0
LOOK_S = 0.3  # a camera that does not want it says so at once
LEAD_S = 0.25  # sent ahead, so that a hitch is not heard
PIECE_S = 0.1
FAREWELL_S = 1.0  # until a camera that answers at the end has done so


def upload(
    address: Address, head: dict[str, str], target: str, data: bytes, rate: float, gate: Gate, ended: threading.Event
) -> bool:
    """Sends `rate` bytes a second to the end, or until `ended` is set; whether the camera knew the login.

    DeviceError when it does not take the sound.
    """
    try:
        connection = _connection(address)
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
        raise away(error, f"the sound did not get through: {type(error).__name__} {error}".strip()) from error


def _connection(address: Address) -> HTTPConnection:
    parts = urlsplit(address.url)
    host = parts.hostname or ""
    if parts.scheme == "https":
        context = trust(address.url, address.certificate)
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
    if (said := _said(wire, wait_s)) is None:
        return True
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
    return not (_said(wire, FAREWELL_S) or b"").partition(b" ")[2].startswith(b"401")


def _said(wire: socket.socket, wait_s: float) -> bytes | None:
    """What has come; None: nothing. TLS has words of its own: that there is something to read need not be an answer."""
    wire.settimeout(wait_s)
    try:
        return wire.recv(4096)
    except (TimeoutError, BlockingIOError, ssl.SSLWantReadError):
        return None
    finally:
        wire.settimeout(SEND_S)
