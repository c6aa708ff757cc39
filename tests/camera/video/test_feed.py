"""Snapshots on occasion, as plans: no camera and no clock."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from services.bus import Message
from services.camera.health import Health
from services.camera.plan import Until
from services.camera.requests import Away, Picture, Reply, Snapshot
from services.camera.settings import Config
from services.camera.video import pictures
from services.camera.video.feed import Feed

IMAGE = np.tile(np.linspace(0, 255, 320, dtype=np.uint8)[None, :, None], (240, 1, 3))


def feed(said: list[Message], **snapshot: Any) -> Feed:
    config = Config.model_validate({"url": "http://192.0.2.9", "folder": Path(), "snapshot": snapshot})
    health = Health("ip1")
    health.state = "online"
    return Feed(config, health, None, said.append)


def reply(error: Away | None = None) -> Reply:
    return Reply(Snapshot(), 1, None if error else pictures.encode(IMAGE), error, 100.0, 101.0)


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
