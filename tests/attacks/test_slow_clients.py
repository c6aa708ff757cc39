"""Many connections that say next to nothing, steadily (a "slow loris"), at every HTTP server of ours.

They come from an address of their own, 127.0.0.2, as a machine elsewhere would.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest

from services import http_doors, metrics
from services.camera.video.newest import Newest, Upright
from services.camera.video.proxy import UNSEATED, Proxy
from services.camera.video.settings import StreamSettings
from services.dashboard.http import connection
from services.metrics.service import ASKERS
from services.peers import Missing, wait_until
from tests.dashboard.parts import running

HERE, ELSEWHERE = "127.0.0.1", "127.0.0.2"
WORDS = b"G", b"GET / HTTP/1.1\r\nX-A: "  # said again, the second is a header more
MORE = 20  # connections than one address may have
SLACK_S = 20.0
Address = tuple[int, str, int, int]  # port, a path, what it answers, connections of one address


@contextmanager
def dashboard(folder: Path) -> Iterator[Address]:
    """The whole service, with its broker."""
    try:
        with running(folder) as one:
            yield httpx.URL(one.url).port or 0, "/api/session", 200, connection.MOST_EACH
    except Missing as missing:
        pytest.skip(str(missing))


@contextmanager
def stream(_: Path) -> Iterator[Address]:
    """A camera's, which is off."""
    settings = StreamSettings()
    with closing(Proxy("ip1", settings, Newest(Upright()), lambda _: False, lambda: False)) as proxy:
        yield proxy.server_port, proxy.stream_path, 503, settings.viewers + UNSEATED


@contextmanager
def numbers(_: Path) -> Iterator[Address]:
    """Prometheus' page."""
    with metrics.start(metrics.Config(port=0), lambda message: None) as service:
        yield httpx.URL(service.addresses["metrics"]).port or 0, "/metrics", 200, ASKERS


def test_every_server_has_the_same_patience() -> None:
    assert connection.HEAD_S == http_doors.HEAD_S


@dataclass
class Crowd:
    """Those who come to one server, half of them slow in the first line and half in the head."""

    server: Address
    there: list[tuple[socket.socket, bytes]] = field(default_factory=list)

    def left(self) -> int:
        """How many are still there, after a word more of each."""
        self.there = [one for one in self.there if _says(*one)]
        return len(self.there)

    def answer(self) -> int:
        """What somebody else is told meanwhile."""
        port, path, _, _ = self.server
        return httpx.get(f"http://{HERE}:{port}{path}", timeout=SLACK_S, trust_env=False).status_code


@pytest.mark.mosquitto
def test_those_who_say_it_slowly_are_sent_away_and_the_others_served_meanwhile(tmp_path: Path) -> None:
    with ExitStack() as stack:
        crowds = [Crowd(stack.enter_context(server(tmp_path))) for server in (dashboard, stream, numbers)]
        began = time.monotonic()
        for crowd in crowds:
            port, _, status, most = crowd.server
            crowd.there = [(stack.enter_context(_knock(port)), WORDS[number % 2]) for number in range(most + MORE)]
            wait_until(
                lambda crowd=crowd, most=most: crowd.left() <= most, "the end of those who are too many", SLACK_S
            )  # type: ignore[misc]
            if time.monotonic() - began < connection.HEAD_S:  # else the first may be gone already
                assert crowd.left() > most // 2
            assert crowd.answer() == status
        last = time.monotonic()
        while sum(crowd.left() for crowd in crowds) and time.monotonic() - last < connection.HEAD_S + SLACK_S:
            assert [crowd.answer() for crowd in crowds] == [crowd.server[2] for crowd in crowds]
        assert [crowd.left() for crowd in crowds] == [0, 0, 0]


def _knock(port: int) -> socket.socket:
    made = socket.create_connection((HERE, port), timeout=SLACK_S, source_address=(ELSEWHERE, 0))
    made.setblocking(False)
    return made


def _says(one: socket.socket, word: bytes) -> bool:
    """Whether he is still there, after a word more."""
    try:
        one.send(word)
        return one.recv(1000) != b""
    except BlockingIOError:
        return True
    except OSError:
        one.close()
        return False
