"""Snapshots on occasion and orders for the streams, as plans: no camera and no clock."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from services.bus import Message
from services.camera.device import Away, Picture, Reply, Request, Snapshot, StreamAddress
from services.camera.health import Health
from services.camera.orders import Broadcast
from services.camera.plan import Run, Stage, Until
from services.camera.settings import Config
from services.camera.upkeep import Facts
from services.camera.video import pictures
from services.camera.video.channel import Channel
from services.camera.video.feed import START_S, Feed
from services.camera.web.gate import Gate

BROKEN = "expected a whole JPEG"
IMAGE = np.tile(np.linspace(0, 255, 320, dtype=np.uint8)[None, :, None], (240, 1, 3))
JPEG = pictures.encode(IMAGE)


CONFIG = Config.model_validate({"url": "http://192.0.2.9", "folder": Path()})


def feed(said: list[Message], channel: Channel | None = None, **snapshot: Any) -> Feed:
    config = Config.model_validate({**dict(CONFIG), "snapshot": snapshot})
    health = Health("ip1")
    health.state = "online"
    return Feed(config, health, Facts(), channel, said.append)


def reply(error: Away | None = None, at: float = 101.0, data: bytes = JPEG) -> Reply:
    return Reply(Snapshot(), 1, None if error else data, error, at - 1.0, at)


def ask(here: Feed, answer: Reply) -> None:
    """Somebody wants a snapshot, and that comes of it."""
    plan = here.published()
    next(plan)
    with suppress(StopIteration, Away):
        plan.send(answer)


def test_a_snapshot_is_published_every_so_often() -> None:
    said: list[Message] = []
    plan = feed(said, every_s=60).every_so_often(1000.0)
    assert next(plan) == Until(1060.0)
    assert plan.send(1060.0) == Snapshot()
    assert plan.send(reply()) == Until(1120.0)
    assert [message.topic for message in said] == ["camera/ip1/snapshot"]


def test_a_snapshot_that_fails_does_not_end_the_others() -> None:
    said: list[Message] = []
    plan = feed(said, every_s=60).every_so_often(1000.0)
    next(plan)
    plan.send(1060.0)
    assert plan.send(reply(Away("busy"))) == Until(1120.0)
    assert plan.send(1120.0) == Snapshot()
    assert said == []


@pytest.mark.parametrize(("state", "moving"), [("offline", False), ("online", True)])
def test_none_is_taken_of_a_camera_that_is_away_or_turns(state: Any, moving: bool) -> None:
    here = feed([], every_s=60)
    here.health.state, here.health.moving = state, moving
    plan = here.every_so_often(1000.0)
    next(plan)
    assert plan.send(1060.0) == Until(1120.0)


@pytest.mark.parametrize("wanted", [True, False])
def test_motion_brings_a_snapshot_when_it_begins_where_that_is_configured(wanted: bool) -> None:
    here = feed([], at_motion=wanted)
    asked = [next(here.at_motion(value), None) is not None for value in (0, 1, 1, 0, 1, -1, 1)]
    assert asked == [wanted and rising for rising in (False, True, False, False, True, False, True)]


@pytest.mark.parametrize(
    ("spoilt", "why"),
    [
        (reply(Away("500")), "500"),
        (reply(data=JPEG[: len(JPEG) // 2]), BROKEN),
        (reply(data=b"Error\r\n"), BROKEN),
        (reply(data=b"\xff\xd8 no picture \xff\xd9"), BROKEN),
    ],
)
def test_snapshots_that_are_none_are_told_once_and_counted_and_good_ones_are_told_too(
    caplog: pytest.LogCaptureFixture, spoilt: Reply, why: str
) -> None:
    here = feed([])
    caplog.set_level("INFO")
    for _ in range(3):
        ask(here, spoilt)
    assert why in here.spoilt.facts.complaints["snapshot"]
    assert here.spoilt.count == 3
    ask(here, reply())
    assert here.spoilt.facts.complaints == {}
    assert [record.levelname for record in caplog.records] == ["WARNING", "INFO"]
    assert why in caplog.messages[0]


def test_good_and_bad_snapshots_in_turn_are_one_line_a_minute(caplog: pytest.LogCaptureFixture) -> None:
    here = feed([])
    for second in range(0, 120, 2):
        ask(here, reply(Away("busy"), 1000.0 + second))
        ask(here, reply(at=1001.0 + second))
    assert [record.levelname for record in caplog.records] == ["WARNING"] * 2
    assert here.spoilt.count == 60


def test_another_snapshot_is_asked_for_until_they_are_good_again() -> None:
    here = feed([])
    plan = here.mended(1000.0)
    assert next(plan) == Until(1010.0)
    assert plan.send(1010.0) == Until(1020.0), "none is bad"
    ask(here, reply(Away("busy")))
    assert plan.send(1020.0) == Snapshot()
    assert plan.send(reply(Away("busy"))) == Until(1030.0)
    assert plan.send(1030.0) == Snapshot()
    assert plan.send(reply()) == Until(1040.0)
    assert plan.send(1040.0) == Until(1050.0)


def test_who_asks_while_a_snapshot_is_under_way_gets_that_one() -> None:
    said: list[Message] = []
    here = feed(said)
    for _ in range(2):
        first, others = here.on_request(), [here.on_request() for _ in range(3)]
        assert next(first) == Snapshot()
        assert [next(other, None) for other in others] == [None] * 3
        with pytest.raises(StopIteration):
            first.send(reply())
    assert len(said) == 2
    failed = here.on_request()
    next(failed)
    with pytest.raises(Away):
        failed.send(reply(Away("busy")))
    assert next(here.on_request()) == Snapshot(), "it was not to be had; the next one is asked for again"


def test_snapshots_are_upright() -> None:
    said: list[Message] = []
    here = feed(said)
    here.turned(Picture(False, False, "color"))
    plan = here.published()
    next(plan)
    with pytest.raises(StopIteration):
        plan.send(reply())
    shown = pictures.decode(said[0].payload)
    assert shown[0, 0, 0] > 200
    assert shown[0, -1, 0] < 50


class Switchboard:
    """Orders for the streams of a camera that is slow to say where they are, and then has none and no picture."""

    def __init__(self, channel: Channel) -> None:
        self.now = 1000.0
        self.channel = channel
        self.feed = feed([], channel)
        self.asked: list[tuple[Request, int]] = []
        self.stage = Stage(lambda request, ticket: self.asked.append((request, ticket)))
        self.runs: list[Run] = []

    def order(self, **on: bool) -> None:
        self.runs.append(self.stage.begin(self.feed.switch(Broadcast(**on), self.now), self.now, lambda run, now: None))

    def run(self, seconds: float, picture: bytes | None = None) -> None:
        for _ in range(round(seconds * 10)):
            self.now += 0.1
            asked, self.asked = self.asked, []
            for request, ticket in asked:
                good = isinstance(request, Snapshot) and picture is not None
                error = None if good else Away("no answer")
                self.stage.reply(Reply(request, ticket, picture, error, self.now, self.now), self.now)
            self.stage.tick(self.now)

    @property
    def ends(self) -> list[str]:
        return ["runs" if not run.done else str(run.error or "done") for run in self.runs]


@pytest.fixture(params=[False, True])
def switchboard(request: pytest.FixtureRequest) -> Iterator[Switchboard]:
    """The stream was off, or on from the start, before anything is ordered."""
    stream = CONFIG.stream.model_copy(update={"rtsp": request.param})
    with closing(Channel("ip1", stream, CONFIG.address, CONFIG.kind, lambda message: None, Gate())) as channel:
        yield Switchboard(channel)


def test_a_stream_that_is_switched_off_stays_off_however_often_it_was_switched_on(switchboard: Switchboard) -> None:
    switchboard.order(rtsp=True)
    switchboard.order(rtsp=True)
    switchboard.order(rtsp=False)
    switchboard.run(2 * START_S)
    assert switchboard.ends == ["it was switched off again"] * 2 + ["done"]
    assert not switchboard.channel.rtsp


def test_a_stream_that_gives_no_picture_is_as_it_was_before_however_often_it_was_switched_on(
    switchboard: Switchboard,
) -> None:
    before = switchboard.channel.rtsp
    switchboard.order(rtsp=True)
    switchboard.run(5)
    switchboard.order(rtsp=True)
    switchboard.run(START_S - 4)
    assert switchboard.ends[1] == "runs", "the second one has its own time"
    assert switchboard.channel.rtsp
    switchboard.run(START_S)
    assert all("no picture" in end for end in switchboard.ends)
    assert switchboard.channel.rtsp is before


def test_an_order_that_fails_leaves_the_stream_to_the_one_that_came_after_off(switchboard: Switchboard) -> None:
    switchboard.order(rtsp=True)
    switchboard.run(5)
    switchboard.order(rtsp=False)
    switchboard.order(rtsp=True)
    switchboard.run(START_S - 4)
    assert switchboard.channel.rtsp
    switchboard.run(START_S)
    assert "no picture" in switchboard.ends[2]
    assert not switchboard.channel.rtsp


def test_a_stream_that_has_given_a_picture_stays_on(switchboard: Switchboard) -> None:
    switchboard.channel.begin(StreamAddress(None))
    switchboard.order(rtsp=True)
    switchboard.run(3, JPEG)
    assert switchboard.ends == ["done"]
    switchboard.order(rtsp=True)
    switchboard.run(2 * START_S)
    assert "no picture" in switchboard.ends[1]
    assert switchboard.channel.rtsp
    switchboard.order(mjpeg=True)
    switchboard.run(2 * START_S)
    assert (switchboard.channel.rtsp, switchboard.channel.mjpeg) == (True, False)
