"""Which of a camera's replies tell how it fares, in virtual time."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.bus import Message
from services.camera.device import Away, Reply
from services.camera.errands import Play, Record, Recorded
from services.camera.lanes import REPLY
from tests.camera.flat import Flat


def states(flat: Flat) -> list[str]:
    return [one["state"] for one in flat.payloads("status")]


@pytest.mark.parametrize(("key", "value"), [("AudioRec", "60"), ("AudioPlay", "bell.wav")])
def test_sound_that_breaks_off_leaves_the_camera_online(tmp_path: Path, key: str, value: str) -> None:
    flat = Flat(tmp_path, places=Path()).online()
    (tmp_path / "audio").mkdir()
    (tmp_path / "audio" / "bell.wav").touch()
    flat.camera.answers |= dict.fromkeys((Record, Play), lambda request: Away("the camera ended its sound"))
    flat.order(key, value)
    flat.until(flat.ended, 20)
    flat.run(20)
    assert flat.last()["state"] == "failed"
    assert states(flat) == ["offline", "online"]
    assert flat.camera.met == 1


def test_how_long_a_recording_takes_is_no_latency(tmp_path: Path) -> None:
    flat = Flat(tmp_path, places=Path()).online()
    before = flat.service.health.latency
    reply = Reply(Record(60.0, tmp_path / "one.wav"), 999, Recorded(60.0, 1), None, flat.now - 60.0, flat.now)
    flat.service.handle(Message(REPLY, value=reply), flat.now)
    assert flat.service.health.latency == before
