"""Which pictures of the stream a scan takes: none from before the end of a move, none twice, none of another shape."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pydantic import SecretStr

from services.camera.address import Address
from services.camera.plan import Plan, Until
from services.camera.requests import Away, Reply, Snapshot
from services.camera.scan.streamed import Streamed
from services.camera.video import pictures
from services.camera.video.channel import Channel
from services.camera.video.settings import StreamSettings
from services.camera.video.timing import Exposure
from services.camera.web.gate import Gate

SNAPSHOT = b"\xff\xd8 a snapshot"


class Film:
    """A channel whose pictures the test exposes; `run` lets a plan go on while time passes."""

    def __init__(self, channel: Channel) -> None:
        self.channel, self.now, self.exposed_at = channel, 1000.0, 0.0
        channel.clock = lambda: self.now
        channel.rtsp, channel.reader.flow.name = True, "rtsp"

    def expose(self, grey: int, at: float, unsure: float = 0.1, shape: tuple[int, int] = (90, 160)) -> None:
        image = np.full((*shape, 3), grey, np.uint8)
        self.channel.newest.put(lambda: image, Exposure(at, unsure), at + 0.3)
        self.channel.reader.flow.last = at + 0.3

    def run(self, plan: Plan[tuple[bytes, float, float]], live: bool) -> tuple[bytes, float, float]:
        """Exposes a picture at every look, grey as its time says; snapshots come when asked for."""
        answer: Any = None
        while True:
            try:
                step = plan.send(answer)
            except StopIteration as stop:
                return stop.value  # type: ignore[no-any-return]
            if isinstance(step, Until):
                self.now = answer = step.at
                if live:
                    self.expose(int(100 + 100 * (self.now - 1000)) % 256, self.now - 0.3)
            else:
                assert step == Snapshot()
                answer = Reply(step, 1, SNAPSHOT, None, self.now, self.now + 1)


@pytest.fixture
def film() -> Iterator[Film]:
    address = Address("http://192.0.2.9", "ros", SecretStr("secret"))
    channel = Channel("ip1", StreamSettings(), address, "ceiling", lambda message: None, Gate())
    yield Film(channel)
    channel.close()


def test_a_picture_from_before_the_end_of_a_move_is_refused(film: Film) -> None:
    film.expose(20, at=1000.05)  # exposed after the end as far as one can tell, but not surely
    data, at, now = film.run(Streamed(film.channel, None)(1000.0, 1000.0), live=True)
    assert at - 0.1 > 1000.0
    assert now < 1000.6
    assert pictures.decode(data)[0, 0, 0] > 100


def test_every_frame_of_a_scan_is_another_picture(film: Film) -> None:
    take = Streamed(film.channel, 160 / 90)
    film.run(take(1000.0, 1000.0), live=True)
    first = film.channel.newest.frame
    film.run(take(1000.0, film.now), live=True)
    second = film.channel.newest.frame
    assert first is not None
    assert second is not None
    assert second.number > first.number


@pytest.mark.parametrize("fault", ["stands still", "another shape", "broken", "off"])
def test_a_snapshot_is_taken_where_the_stream_is_of_no_use(film: Film, fault: str) -> None:
    film.expose(
        90, at=999.0 if fault == "stands still" else 1001.0, shape=(120, 160) if fault == "another shape" else (90, 160)
    )
    if fault == "broken":
        film.channel.newest.put(lambda: pictures.decode(b"no"), Exposure(1001.0, 0.1), 1001.3)
        with pytest.raises(Away):
            pictures.decode(b"no")
    if fault == "off":
        film.channel.rtsp = False
    data, _, _ = film.run(Streamed(film.channel, 160 / 90)(1000.0, 1000.0), live=False)
    assert data == SNAPSHOT
    assert not film.channel.newest.wanted
