"""A stream during a scan, while the service is busy with something else for a moment."""

from __future__ import annotations

from functools import partial
from threading import Event
from threading import enumerate as threads
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.camera.scan.footage import Visit
from services.camera.scan.live import Live
from services.camera.video import pictures
from services.camera.video.channel import Channel
from services.camera.video.likeness import likeness, thumb
from services.camera.video.newest import Newest, Upright
from services.camera.video.settings import StreamSettings
from services.camera.video.timing import Exposure
from services.peers import wait_until

Picture = NDArray[np.uint8]
PERIOD_S = 0.05
TURN_PX = 6  # from one picture to the next


class Streamed:
    """A wall that a camera pans along; the pictures come as they are exposed."""

    def __init__(self) -> None:
        noise = np.random.default_rng(1).uniform(0, 255, (180, 1600, 3))
        self.wall = np.asarray(cv2.GaussianBlur(noise, (0, 0), 3) * 4 % 255, np.uint8)
        self.newest, self.now, self.at = Newest(Upright()), 100.0, 0
        settings = StreamSettings(source="main")
        channel = SimpleNamespace(
            newest=self.newest, timed=True, settings=settings, camera="ip1", clock=lambda: self.now
        )
        self.live = Live(cast(Channel, channel), aspect=None)

    def picture(self) -> Picture:
        """What it sees now."""
        return np.ascontiguousarray(self.wall[:, self.at : self.at + 320])

    def show(self, pictures: int, turn: int = 0) -> None:
        """So many pictures, turning between them."""
        for _ in range(pictures):
            self.now += PERIOD_S
            self.at += turn
            develop: Any = partial(np.copy, self.picture())
            self.newest.put(develop, Exposure(self.now, 0.02), self.now)


def test_a_turn_that_nobody_looked_at_ends_what_was_seen_before() -> None:
    stream = Streamed()
    stream.live.begin(None)
    first = Visit(wanted=30, since=stream.now)
    stream.live.footage.open(first)
    here = thumb(stream.picture())
    given = []
    for _ in range(8):
        stream.show(1)
        given += stream.live.collect()
    stream.live.footage.leave(stream.now, stream.now + PERIOD_S)
    stream.show(20, TURN_PX)
    stream.show(30)  # more than are kept for a service that does not look
    there = thumb(stream.picture())
    second = Visit(wanted=5, since=stream.now)
    stream.live.footage.open(second)
    for _ in range(10):
        given += stream.live.collect()
        stream.show(1)

    def developed() -> bool:
        given.extend(stream.live.collect())
        return sum(visit is second for visit, _, _ in given) == second.wanted

    wait_until(developed, "the second visit's pictures", 10)
    stream.live.close()
    assert any(visit is first for visit, _, _ in given)
    for visit, _, jpeg in given:
        assert likeness(here if visit is first else there, thumb(pictures.decode(jpeg))) == "same"


def test_a_picture_that_is_developed_late_is_none_of_the_next_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    stream, begun, may, made = Streamed(), Event(), Event(), Event()
    encode = pictures.encode

    def slowly(image: Picture, quality: int) -> bytes:
        begun.set()
        assert may.wait(10)
        try:
            return encode(image, quality)
        finally:
            made.set()

    monkeypatch.setattr(pictures, "encode", slowly)
    stream.live.begin(None)
    visit = Visit(wanted=3, since=stream.now)
    stream.live.footage.open(visit)
    for _ in range(8):
        stream.show(1)
        assert stream.live.collect() == []
    assert begun.wait(10)
    assert visit.over
    assert stream.live.pending(stream.now), "what is in the darkroom is waited for"
    stream.live.begin(None)
    assert not stream.live.pending(stream.now)
    may.set()
    assert made.wait(10)
    wait_until(lambda: not [one for one in threads() if one.name.startswith("scan pictures")], "the darkroom's end", 10)
    assert stream.live.collect() == []
    stream.live.close()
