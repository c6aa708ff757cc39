"""Snapshots on occasion, as plans: no camera and no clock."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from services.bus import Message
from services.camera.device import Away, Picture, Reply, Snapshot
from services.camera.health import Health
from services.camera.plan import Until
from services.camera.settings import Config
from services.camera.upkeep import Facts
from services.camera.video import pictures
from services.camera.video.feed import Feed

BROKEN = "expected a whole JPEG"
IMAGE = np.tile(np.linspace(0, 255, 320, dtype=np.uint8)[None, :, None], (240, 1, 3))
JPEG = pictures.encode(IMAGE)


def feed(said: list[Message], **snapshot: Any) -> Feed:
    config = Config.model_validate({"url": "http://192.0.2.9", "folder": Path(), "snapshot": snapshot})
    health = Health("ip1")
    health.state = "online"
    return Feed(config, health, Facts(), None, said.append)


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
