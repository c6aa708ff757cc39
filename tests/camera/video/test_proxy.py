"""The multipart JPEG stream and the single picture, over real HTTP: who may look, what it costs, and that it ends."""

from __future__ import annotations

import http.client
import itertools
import re
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass, field

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services import peers
from services.camera.video import pictures
from services.camera.video.newest import Newest, Upright
from services.camera.video.proxy import BOUNDARY, Proxy
from services.camera.video.settings import StreamSettings
from services.camera.video.timing import Exposure
from services.peers import wait_until


def picture(number: int, size: tuple[int, int] = (240, 320)) -> NDArray[np.uint8]:
    image = np.full((*size, 3), 60, np.uint8)
    cv2.putText(image, str(number), (20, size[0] // 2), cv2.FONT_HERSHEY_SIMPLEX, 2, (255, 255, 255), 3)
    return image


@dataclass
class Studio:
    """A proxy, and a source of pictures that the test works by hand."""

    newest: Newest
    proxy: Proxy
    on: set[str]
    asked: list[float] = field(default_factory=list)
    developed: list[int] = field(default_factory=list)
    numbers: Iterator[int] = field(default_factory=lambda: itertools.count(1))

    @property
    def stream(self) -> str:
        return f"http://127.0.0.1:{self.proxy.server_port}/camera/ip1/stream.mjpg"

    def expose(self, size: tuple[int, int] = (240, 320), ago: float = 0.0) -> int:
        number = next(self.numbers)
        image = picture(number, size)

        def develop() -> NDArray[np.uint8]:
            self.developed.append(number)
            return image

        self.newest.put(develop, Exposure(time.time() - ago, 0.1), time.time() - ago)
        return number

    def get(self, path: str, method: str = "GET", host: str | None = None) -> tuple[int, dict[str, str], bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.proxy.server_port, timeout=10)
        try:
            connection.request(method, path, headers={"Host": host} if host else {})
            answer = connection.getresponse()
            return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
        finally:
            connection.close()


@pytest.fixture
def settings() -> StreamSettings:
    return StreamSettings(viewers=3, fps=50)


@pytest.fixture
def studio(settings: StreamSettings) -> Iterator[Studio]:
    newest, on, asked = Newest(Upright()), {"RTSP", "MJPEG"}, list[float]()
    proxy = Proxy("ip1", settings, newest, on.__contains__, lambda: not asked.append(time.time()))
    before = threading.active_count()
    yield Studio(newest, proxy, on, asked)
    proxy.close()
    assert threading.active_count() < before


class Look:
    """A viewer: reads part after part as they come."""

    def __init__(self, studio: Studio) -> None:
        self.connection = http.client.HTTPConnection("127.0.0.1", studio.proxy.server_port, timeout=10)
        self.connection.request("GET", "/camera/ip1/stream.mjpg")
        self.answer = self.connection.getresponse()
        if self.answer.status == 200:
            assert self.answer.readline() == f"--{BOUNDARY}\r\n".encode()

    def next(self) -> bytes:
        headers = http.client.parse_headers(self.answer)
        assert headers["Content-Type"] == "image/jpeg"
        data = self.answer.read(int(headers["Content-Length"]))
        assert self.answer.readline() == b"\r\n"
        assert self.answer.readline() == f"--{BOUNDARY}\r\n".encode()
        return data

    def close(self) -> None:
        self.answer.close()
        self.connection.close()


def test_a_viewer_is_sent_each_picture_as_it_comes(studio: Studio) -> None:
    look = Look(studio)
    assert look.answer.headers["Content-Type"] == f"multipart/x-mixed-replace; boundary={BOUNDARY}"
    for _ in range(3):
        wait_until(lambda: studio.newest.wanted, "a viewer")
        number = studio.expose()
        assert np.abs(pictures.decode(look.next()).astype(int) - picture(number)).mean() < 3
    look.close()


def test_one_encoding_serves_all_viewers_and_none_is_made_while_nobody_looks(studio: Studio) -> None:
    for _ in range(5):
        studio.expose(ago=3600)
    assert studio.developed == []
    looks = [Look(studio) for _ in range(3)]
    wait_until(lambda: studio.newest.watchers == 3, "the viewers")
    for _ in range(4):
        studio.expose()
        for look in looks:
            look.next()
    assert studio.developed == [6, 7, 8, 9]
    for look in looks:
        look.close()
    wait_until(lambda: not studio.newest.wanted, "the viewers' end to be noticed")


def test_a_slow_viewer_skips_pictures_and_delays_nobody(studio: Studio) -> None:
    slow, quick = Look(studio), Look(studio)
    longest = 0.0
    for _ in range(60):
        studio.expose((1200, 1600))
        began = time.monotonic()
        quick.next()
        longest = max(longest, time.monotonic() - began)
    assert longest < 5  # a viewer is given up after 10 s
    seen = [slow.next() for _ in range(2)]
    last = studio.expose((1200, 1600))
    while np.abs(pictures.decode(seen[-1]).astype(int) - picture(last, (1200, 1600))).mean() > 1:
        seen.append(slow.next())
    assert len(seen) < 55
    slow.close()
    quick.close()


def test_more_viewers_than_seats_are_turned_away_until_one_leaves(studio: Studio) -> None:
    looks = [Look(studio) for _ in range(3)]
    status, headers, body = studio.get("/camera/ip1/stream.mjpg")
    assert (status, headers["retry-after"], body) == (503, "5", b"503 Service Unavailable: too many viewers\n")
    looks[0].close()
    wait_until(lambda: studio.newest.watchers == 2, "the seat to be free")
    again = Look(studio)
    assert again.answer.status == 200
    for look in (*looks[1:], again):
        look.close()


def test_a_stream_that_is_switched_off_ends_its_viewers_and_is_refused(studio: Studio) -> None:
    look = Look(studio)
    studio.expose()
    look.next()
    studio.on.remove("MJPEG")
    assert look.answer.read() == b""
    status, _, body = studio.get("/camera/ip1/stream.mjpg")
    assert (status, b"the stream is off" in body) == (503, True)
    look.close()


@pytest.mark.parametrize(("path", "key"), [("stream.mjpg", "MJPEG"), ("rtsp.mjpg", "RTSP")])
def test_each_order_switches_a_path_of_its_own(studio: Studio, path: str, key: str) -> None:
    studio.on.clear()
    status, _, body = studio.get(f"/camera/ip1/{path}")
    assert (status, f"order {key}\n".encode() in body) == (503, True)
    studio.on.add(key)
    assert studio.get(f"/camera/ip1/{path}", "HEAD")[0] == 200


@pytest.mark.parametrize(
    "path", ["/", "/camera", "/camera/ip1/", "/camera/ip2/stream.mjpg", "/camera/ip1/../ip1/x", "//"]
)
def test_nothing_else_is_served(studio: Studio, path: str) -> None:
    status, headers, body = studio.get(path)
    assert status == 404
    assert headers["content-type"] == "text/plain; charset=utf-8"
    assert b"/camera/ip1/stream.mjpg" in body


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "CONNECT"])
def test_there_is_nothing_to_do_but_look(studio: Studio, method: str) -> None:
    status, headers, _ = studio.get("/camera/ip1/stream.mjpg", method)
    assert (status, headers["allow"]) == (405, "GET, HEAD")


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:8080", 200),
        ("localhost", 200),
        ("[::1]:80", 200),
        ("evil.example", 403),
        ("ip1.evil.example:80", 403),
    ],
)
def test_a_page_elsewhere_that_calls_our_address_its_own_gets_no_picture(
    studio: Studio, host: str, status: int
) -> None:
    studio.expose()
    assert studio.get("/camera/ip1/snapshot.jpg", host=host)[0] == status


@pytest.mark.parametrize(
    ("allow", "address", "may"),
    [
        ((), "127.0.0.1", True),
        ((), "::1", True),
        ((), "::ffff:127.0.0.1", True),
        ((), "192.0.2.7", False),
        (("192.0.2.7",), "192.0.2.7", True),
        (("192.0.2.0/24",), "192.0.2.200", True),
        (("192.0.2.0/24",), "::ffff:192.0.2.200", True),
        (("192.0.2.0/24",), "198.51.100.1", False),
        (("2001:db8::/32",), "2001:db8::5", True),
        (("2001:db8::/32",), "fe80::1%eth0", False),
    ],
)
def test_loopback_and_the_allowed_networks_may_look(allow: tuple[str, ...], address: str, may: bool) -> None:
    settings = StreamSettings.model_validate({"allow": allow})
    proxy = Proxy("ip1", settings, Newest(Upright()), lambda _: True, lambda: False)
    assert proxy.may_look(address) is may
    proxy.close()


def test_who_may_not_look_is_told_so() -> None:
    class Elsewhere(Proxy):
        def may_look(self, address: str) -> bool:
            return super().may_look("192.0.2.7")

    proxy = Elsewhere("ip1", StreamSettings(), Newest(Upright()), lambda _: True, lambda: False)
    studio = Studio(proxy.newest, proxy, set())
    status, _, body = studio.get("/camera/ip1/snapshot.jpg")
    assert (status, b"stream.allow" in body) == (403, True)
    proxy.close()


def test_answers_are_not_kept_and_not_guessed_at(studio: Studio) -> None:
    studio.expose()
    for path in ("/camera/ip1/snapshot.jpg", "/nothing"):
        headers = studio.get(path)[1]
        assert "no-store" in headers["cache-control"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["connection"] == "close"
        assert "python" not in headers["server"].lower()


def test_a_snapshot_is_the_newest_picture_while_one_is_fresh(studio: Studio) -> None:
    before, number = time.time(), studio.expose()
    status, headers, body = studio.get("/camera/ip1/snapshot.jpg?now=1")
    assert (status, headers["content-type"], int(headers["content-length"])) == (200, "image/jpeg", len(body))
    assert np.abs(pictures.decode(body).astype(int) - picture(number)).mean() < 3
    assert before - 0.001 < float(headers["x-timestamp"]) < time.time()
    assert studio.asked == []
    assert studio.get("/camera/ip1/snapshot.jpg", "HEAD")[2] == b""


def test_what_was_long_ago_is_not_shown_as_how_it_is_now(studio: Studio) -> None:
    studio.expose(ago=3600)
    look = Look(studio)
    wait_until(lambda: studio.newest.wanted, "the viewer")
    number = studio.expose()
    assert np.abs(pictures.decode(look.next()).astype(int) - picture(number)).mean() < 3
    look.close()


def test_a_snapshot_is_asked_for_when_no_picture_is_fresh_also_while_the_stream_is_off(studio: Studio) -> None:
    studio.on.clear()
    answers: list[int] = []
    viewer = threading.Thread(target=lambda: answers.append(studio.get("/camera/ip1/snapshot.jpg")[0]))
    viewer.start()
    wait_until(lambda: bool(studio.asked), "the question")
    studio.expose()
    viewer.join(10)
    assert answers == [200]


def test_nobody_waits_for_a_camera_that_is_away() -> None:
    proxy = Proxy("ip1", StreamSettings(), Newest(Upright()), lambda _: False, lambda: False)
    status, _, body = Studio(proxy.newest, proxy, set()).get("/camera/ip1/snapshot.jpg")
    assert (status, b"no picture" in body) == (504, True)
    proxy.close()


def test_strangers_keep_nobody_out() -> None:
    class Elsewhere(Proxy):
        def may_look(self, address: str) -> bool:
            return address != "127.0.0.2"

    proxy = Elsewhere("ip1", StreamSettings(viewers=1), Newest(Upright()), lambda _: True, lambda: False)
    with closing(proxy), ExitStack() as silent:
        for _ in range(30):
            port = ("127.0.0.1", proxy.server_port)
            silent.enter_context(socket.create_connection(port, source_address=("127.0.0.2", 0)))
        wait_until(lambda: proxy.porch._value == 0, "the porch to be full")
        assert Studio(proxy.newest, proxy, set()).get("/")[0] == 404


def test_broken_pictures_are_counted_and_the_next_good_one_is_sent(studio: Studio) -> None:
    look = Look(studio)
    jpeg = b"\xff\xd8 is not a picture"
    studio.newest.put(lambda: pictures.decode(jpeg), Exposure(0, 0), time.time(), jpeg)
    wait_until(lambda: studio.newest.broken == 1, "the picture to be found broken")
    number = studio.expose()
    assert np.abs(pictures.decode(look.next()).astype(int) - picture(number)).mean() < 3
    look.close()


def test_a_viewer_that_leaves_while_no_picture_comes_is_noticed(studio: Studio) -> None:
    look = Look(studio)
    wait_until(lambda: studio.newest.watchers == 1, "the viewer")
    look.close()
    wait_until(lambda: studio.newest.watchers == 0, "the viewer's end", 10)


def test_the_end_of_the_service_ends_viewers_that_take_nothing() -> None:
    newest, before = Newest(Upright()), threading.active_count()
    proxy = Proxy("ip1", StreamSettings(), newest, lambda _: True, lambda: False)
    port = ("127.0.0.1", proxy.server_port)
    with socket.create_connection(port) as stuck, socket.create_connection(port):
        stuck.sendall(b"GET /camera/ip1/stream.mjpg HTTP/1.1\r\nHost: localhost\r\n\r\n")
        wait_until(lambda: newest.wanted, "the viewer")
        began = time.monotonic()
        proxy.close()
        assert time.monotonic() - began < 5
        assert threading.active_count() <= before


def test_curl_shows_the_stream(studio: Studio) -> None:
    try:
        program = peers.program("curl", "curl")
    except peers.Missing as missing:
        pytest.skip(str(missing))
    curl = subprocess.Popen([program, "-sN", "--max-time", "20", studio.stream], stdout=subprocess.PIPE)
    assert curl.stdout is not None
    wait_until(lambda: studio.newest.wanted, "curl")
    number = studio.expose()
    head = b"".join(curl.stdout.readline() for _ in range(5)).decode()
    assert head.startswith(f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: ")
    length, stamp = re.findall(r"[\d.]+(?=\r\n)", head)
    assert abs(float(stamp) - time.time()) < 60.0, "when the picture was exposed"
    jpeg = curl.stdout.read(int(length))
    assert np.abs(pictures.decode(jpeg).astype(int) - picture(number)).mean() < 3
    curl.kill()
    curl.communicate()
