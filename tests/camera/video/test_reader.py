"""The reader's decisions with sessions of the test's own: queues, pauses, the second way."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from services.camera.device import Away, BadLogin
from services.camera.video.newest import Frame, Newest, Upright
from services.camera.video.reader import Reader
from services.camera.video.session import Arrival, Session
from services.camera.web.motion_jpeg import split
from services.peers import wait_until

JPEG = b"\xff\xd8\xff\xe0" + bytes(range(256)) + b"\xff\xd9"


class Made(Session):
    """A session that gives what it is told to, ten times as fast as in truth."""

    def __init__(self, name: str, delays: Iterator[float], opened: list[str]) -> None:
        self.name, self.delays, self.number = name, delays, 0
        opened.append(name)

    def read(self, *, decode: bool) -> Arrival:
        threading.Event().wait(0.005)
        delay = next(self.delays, None)
        if delay is None:
            raise Away("it has ended")
        self.number += 1
        stream_s = self.number * 0.05
        return Arrival(time.time() + stream_s + delay, 1000, stream_s, lambda: np.zeros((2, 2, 3), np.uint8))

    def close(self) -> None:
        pass


@pytest.fixture
def reader() -> Iterator[Reader]:
    made = Reader("ip1", Newest(Upright()), (0.3, 0.1), login_retry_s=60.0)
    yield made
    made.close()
    assert threading.active_count() == 1 or not any(one.name == "camera video" for one in threading.enumerate())


def way(name: str, opened: list[str], delays: Callable[[], Iterator[float]]) -> Callable[[], Session]:
    return lambda: Made(name, delays(), opened)


def test_a_hopeless_queue_is_thrown_away_with_its_connection(reader: Reader) -> None:
    opened: list[str] = []
    late = iter([iter(n * 0.3 for n in range(10**6)), iter(0.0 for n in range(10**6))])
    reader.switch((way("rtsp", opened, lambda: next(late)),))
    wait_until(lambda: reader.flow.queueing, "the queue to be seen")
    wait_until(lambda: len(opened) == 2 and not reader.flow.queueing, "a new connection")
    assert reader.flow.failures == 0


def test_a_second_way_is_tried_after_two_failures_of_the_first(reader: Reader) -> None:
    opened: list[str] = []

    def refuse() -> Session:
        opened.append("refused")
        raise Away("refused")

    reader.switch((refuse, way("mjpeg", opened, lambda: iter([0.0] * 10**6))))
    wait_until(lambda: reader.flow.name == "mjpeg", "the second way", 20)
    assert opened[:2] == ["refused", "refused"]
    assert opened[-1] == "mjpeg"


def test_a_refused_login_is_not_tried_again_soon(reader: Reader) -> None:
    opened: list[str] = []

    def refuse() -> Session:
        opened.append("refused")
        raise BadLogin("wrong", 0.0)

    reader.switch((refuse,))
    with pytest.raises(TimeoutError):
        wait_until(lambda: len(opened) > 1, "a second attempt", 3)
    assert reader.flow.trouble == "wrong"


class Clocked(Session):
    """Forty seconds of pictures that arrive as they are exposed, by clocks of its own; ours is set in between.

    `late`: that happens after the picture's arrival was noted, while it is decoded.
    """

    name = "rtsp"

    def __init__(self, step_s: float, *, late: bool) -> None:
        self.step_s, self.late = step_s, late
        self.wall, self.steady = 1.7e9, 50.0
        self.number = 0
        self.ended = threading.Event()

    def read(self, *, decode: bool) -> Arrival:
        self.number += 1
        if self.number > 600:
            self.ended.set()
            raise Away("it has ended")
        self.wall, self.steady = self.wall + 1 / 15, self.steady + 1 / 15
        noted = self.wall
        if self.number == 300:
            self.wall += self.step_s
            noted = noted if self.late else self.wall
        return Arrival(noted, 1000, self.number / 15, lambda: np.zeros((2, 2, 3), np.uint8))

    def close(self) -> None:
        pass


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("step_s", [3.0, 0.4, -0.4, -3.0, -3600.0])
def test_when_our_clock_is_set_pictures_keep_their_time_of_exposure(step_s: float, late: bool) -> None:
    film = Clocked(step_s, late=late)
    reader = Reader("ip1", Newest(Upright()), (0.3, 0.1), clock=lambda: film.wall, steady=lambda: film.steady)
    seen: list[tuple[Frame, float]] = []
    with reader.newest.tapped(lambda frame: seen.append((frame, film.wall))):
        reader.switch((lambda: film,))
        assert film.ended.wait(20)
        reader.close()
    wrong = [(frame.number, frame.exposure.at - (now - 0.3)) for frame, now in seen]
    assert [one for one in wrong if abs(one[1]) > 0.01] == []
    assert len(seen) >= 599, "the one that came as the clock was set is in doubt"
    assert seen[-1][0].exposure.uncertainty == 0.1
    assert not reader.flow.queueing


def parts(*jpegs: bytes, length: Callable[[bytes], str] = lambda jpeg: f"Content-Length: {len(jpeg)}\r\n") -> bytes:
    head = "--myboundary\r\nContent-Type: image/jpeg\r\n"
    return b"".join(f"{head}{length(jpeg)}\r\n".encode() + jpeg + b"\r\n" for jpeg in jpegs)


@pytest.mark.parametrize("size", [1, 7, 100, 100000])
def test_pictures_are_found_however_the_network_cuts_them(size: int) -> None:
    body = parts(JPEG, JPEG + b"", JPEG)
    chunks = (body[start : start + size] for start in range(0, len(body), size))
    assert list(split(chunks)) == [JPEG] * 3


@pytest.mark.parametrize(
    "length", [lambda jpeg: "", lambda jpeg: "content-length:5\r\n", lambda jpeg: "Content-Length: x\r\n"]
)
def test_lengths_that_lie_are_not_believed(length: Callable[[bytes], str]) -> None:
    with_thumbnail = b"\xff\xd8\xff\xe1" + JPEG + b"more" + JPEG[4:]
    body = parts(with_thumbnail, JPEG, length=length) + b"--myboundary"
    assert list(split(iter([body]))) == [with_thumbnail, JPEG]


def test_a_picture_is_there_as_soon_as_it_is_whole() -> None:
    body = parts(JPEG)
    pictures = split(iter([body[:-3], b"", b"never"]))
    assert next(pictures, None) is None  # one byte is missing
    assert next(split(iter([body[:-2]]))) == JPEG


def test_endless_rubbish_is_forgotten() -> None:
    chunks = [b"\xff\xd8\xff" + b"x" * 5_000_000, b"x" * 5_000_000, b"\r\n" + parts(JPEG)]
    assert list(split(iter(chunks))) == [JPEG]
