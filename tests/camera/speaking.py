"""A camera's microphone and loudspeaker on the network, from the facts alone, for the tests of sound.

The microphone gives a tone in A-law, in pieces of odd sizes, as fast as it is read; the loudspeaker keeps what comes.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from random import Random

import numpy as np

from services.camera.sound import g711, wav
from services.simulators.camera.digest import Door
from services.simulators.camera.firmwares import PROFILES
from tests.serving import serving

PASSWORD = "secret123"


class SpeakingCamera(ThreadingHTTPServer):
    """Its `door` is the simulated camera's; `answers` is what a POST is answered at its end (None: nothing)."""

    daemon_threads = False

    def __init__(self, profile: str, hz: float, content_type: str) -> None:
        super().__init__(("127.0.0.1", 0), Visit)
        self.door = Door("Login to AMC", "ros", PASSWORD, PROFILES[profile], Random(1))
        sound = 0.5 * np.sin(2 * np.pi * hz * np.arange(60 * g711.RATE) / g711.RATE)
        self.tone, self.content_type = g711.encode(wav.to_samples(sound)), content_type
        self.lasts_s: float | None = None  # the microphone's answer ends after so much sound
        self.refuses = False
        self.odd: list[int] = []  # a POST of these is answered 401 after so many bytes, although its login is right
        self.heard: list[bytes] = []
        self.took_s: list[float] = []
        self.heads: list[dict[str, str]] = []
        self.targets: list[str] = []

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class Visit(BaseHTTPRequestHandler):
    server: SpeakingCamera
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        self.close_connection = True
        self.server.targets.append(self.path)
        if not self.let_in():
            return
        if "audio.cgi" not in self.path:
            self.wfile.write(
                b"HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Type: text/plain\r\nContent-Length: 6\r\n\r\ntype=X"
            )
            return
        self.wfile.write(f"HTTP/1.1 200 OK\r\nContent-Type: {self.server.content_type}\r\n\r\n".encode())
        tone = self.server.tone[: None if self.server.lasts_s is None else round(self.server.lasts_s * g711.RATE)]
        try:
            for at in range(0, len(tone), 333):
                self.wfile.write(tone[at : at + 333])
        except OSError:
            pass

    def do_POST(self) -> None:
        self.close_connection = True
        self.server.targets.append(self.path)
        self.server.heads.append(dict(self.headers))
        if not self.let_in():
            return
        if self.server.refuses:
            self.wfile.write(b"HTTP/1.1 400 Bad Request\r\nContent-Length: 20\r\n\r\nError\r\nBad Request!\r\n")
            return
        if self.server.odd:
            self.doubt(self.server.odd.pop(0))
            return
        began, got = time.monotonic(), b""
        while piece := self.rfile.read1(4096):
            got += piece
        self.server.took_s.append(time.monotonic() - began)
        self.server.heard.append(got)

    def doubt(self, after: int) -> None:
        self.rfile.read(after)
        self.wfile.write(b"HTTP/1.1 401 Unauthorized\r\nContent-Length: 0\r\n\r\n")
        while self.rfile.read1(4096):
            pass

    def let_in(self) -> bool:
        verdict = self.server.door.judge(self.command, self.path, self.headers.get("Authorization"), time.time())
        if not verdict.passed:
            offers = "".join(f"WWW-Authenticate: {offer}\r\n" for offer in verdict.challenges)
            self.wfile.write(
                f"HTTP/1.1 401 Unauthorized\r\n{offers}Connection: close\r\nContent-Length: 0\r\n\r\n".encode()
            )
        return verdict.passed

    def log_message(self, format: str, *args: object) -> None:
        pass


@contextmanager
def speaking(
    profile: str = "ip3m-941w-2019", hz: float = 1000.0, content_type: str = "Audio/G.711A"
) -> Iterator[SpeakingCamera]:
    """One that runs until the context ends."""
    with serving(SpeakingCamera(profile, hz, content_type)) as server:
        yield server
