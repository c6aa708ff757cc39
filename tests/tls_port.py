"""A camera's HTTPS port before its HTTP port, with a certificate as firmware makes one: no authority, no host."""

from __future__ import annotations

import select
import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from socketserver import BaseRequestHandler, ThreadingTCPServer
from typing import NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from tests.serving import serving

PIECE = 65536
POLL_S = 0.05
PATIENCE_S = 5.0


class Shown(NamedTuple):
    """A certificate and its key, files."""

    certificate: Path
    key: Path


def shown(folder: Path, name: str = "AMC0000000000001", signer: str = "") -> Shown:
    """What a camera of that name shows: signed by itself, or by a `signer` that nobody knows."""
    key, now = ec.generate_private_key(ec.SECP256R1()), datetime.now(UTC)
    signing = ec.generate_private_key(ec.SECP256R1()) if signer else key
    made = (
        x509.CertificateBuilder()
        .subject_name(_called(name))
        .issuer_name(_called(signer or name))
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(hours=1))
        .not_valid_after(now + timedelta(days=1))
        .sign(signing, hashes.SHA256())
    )
    files = Shown(folder / f"{name}.pem", folder / f"{name}.key")
    pem, plain = serialization.Encoding.PEM, serialization.NoEncryption()
    files.certificate.write_bytes(made.public_bytes(pem))
    files.key.write_bytes(key.private_bytes(pem, serialization.PrivateFormat.PKCS8, plain))
    return files


def _called(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


class TlsPort(ThreadingTCPServer):
    """Shakes hands after `hesitates_s`, and passes on what is said."""

    daemon_threads = False
    request_queue_size = 64

    def __init__(self, to: int, shows: Shown, hesitates_s: float) -> None:
        super().__init__(("127.0.0.1", 0), Visit)
        self.to, self.hesitates_s, self.ended = to, hesitates_s, threading.Event()
        self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.context.load_cert_chain(*shows)
        self.knocks: list[object] = []  # the addresses of those who came

    @property
    def url(self) -> str:
        return f"https://127.0.0.1:{self.server_address[1]}"


class Visit(BaseRequestHandler):
    server: TlsPort

    def handle(self) -> None:
        self.server.knocks.append(self.client_address)
        self.server.ended.wait(self.server.hesitates_s)
        self.request.settimeout(PATIENCE_S)
        with (
            suppress(OSError),  # who does not trust us, and who has gone
            self.server.context.wrap_socket(self.request, server_side=True) as near,
            socket.create_connection(("127.0.0.1", self.server.to)) as far,
        ):
            carry(near, far, self.server.ended)


def carry(near: ssl.SSLSocket, far: socket.socket, ended: threading.Event) -> None:
    """Both ways in one thread, since TLS takes no two at a time; who has said all may still listen."""
    heard: list[socket.socket] = [near, far]
    while not ended.is_set():
        ready = [near] if near in heard and near.pending() else select.select(heard, [], [], POLL_S)[0]
        for one in ready:
            near.settimeout(0.0 if one is near else PATIENCE_S)
            try:
                data = one.recv(PIECE)
            except ssl.SSLWantReadError:
                continue
            if data:
                (far if one is near else near).sendall(data)
            elif one is far:
                return
            else:
                far.shutdown(socket.SHUT_WR)
                heard.remove(near)


@contextmanager
def tls_port(to: int, shows: Shown, hesitates_s: float = 0.0) -> Iterator[TlsPort]:
    """One before that port of this machine, until the context ends."""
    with serving(TlsPort(to, shows, hesitates_s)) as server:
        try:
            yield server
        finally:
            server.ended.set()
