"""Snapshots that nobody asks for, on real parts: a broker, a camera over HTTP, `apartment run`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from services import peers
from services.bus import Message
from services.camera.video import pictures
from services.client import Client
from tests.small_flat import SmallFlat, small_flat

pytestmark = pytest.mark.mosquitto
TOPIC = "camera/ip1/snapshot"
SHAPE = (1296, 2304, 3)  # of the camera's own


@contextmanager
def flat(folder: Path, **snapshot: Any) -> Iterator[tuple[SmallFlat, Client]]:
    try:
        with small_flat(folder, camera={"snapshot": snapshot}) as running, running.client("camera/ip1/#") as bus:
            yield running, bus
    except peers.Missing as missing:
        pytest.skip(str(missing))


def taken(bus: Client) -> list[Message]:
    """The snapshots that were heard."""
    return [message for message in bus.seen if message.topic == TOPIC]


def test_motion_before_the_camera_brings_one_snapshot(tmp_path: Path) -> None:
    with flat(tmp_path, at_motion=True) as (running, bus):
        bus.payload("camera/ip1/motion", lambda motion: motion.value == 0, 20.0)
        assert taken(bus) == []
        running.doors["ip1"].tell("event", code="VideoMotion", action="Start")
        bus.payload("camera/ip1/motion", lambda motion: motion.value == 1)
        picture = bus.until(lambda message: message.topic == TOPIC, 20.0, "the snapshot")
        assert pictures.decode(picture.payload).shape == SHAPE
        assert not picture.retain
        bus.collect(3.0)
        assert len(taken(bus)) == 1, "the motion goes on, and has its picture"


def test_snapshots_come_by_themselves_every_so_often(tmp_path: Path) -> None:
    with flat(tmp_path, every_s=1) as (_, bus):
        peers.wait_until(lambda: bool(bus.pump()) and len(taken(bus)) >= 5, "five snapshots", 60.0)
        came = taken(bus)
        assert {pictures.decode(message.payload).shape for message in came} == {SHAPE}
        assert came[-1].received - came[0].received > len(came) - 2, "a second apart; on a busy machine one comes late"
