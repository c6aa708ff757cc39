"""Which of a camera's replies tell how it fares, in virtual time."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.bus import Message
from services.camera.brands.dahua import errands as dahua
from services.camera.device import (
    Away,
    Direction,
    Errand,
    Identify,
    Reading,
    Reply,
    Request,
    Start,
    Status,
    Stop,
)
from services.camera.errands import GetClock, GetContrast, GetPrivacy, GetStorage, Play, Record, Recorded
from services.camera.health import Health
from services.camera.lanes import REPLY
from tests.camera.flat import Flat

BUSY = Away("the camera answered 503", answered=True)


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


@pytest.mark.parametrize("question", [GetClock, GetStorage, GetPrivacy, GetContrast])
def test_a_question_that_the_camera_answers_with_a_fault_is_asked_again_in_peace(
    tmp_path: Path, question: type[Errand]
) -> None:
    flat = Flat(tmp_path, places=Path())
    flat.camera.answers[question] = lambda request: BUSY
    flat.online().run(600)
    asked = sum(isinstance(errand, question) for errand in flat.camera.errands)
    assert states(flat) == ["offline", "online"]
    assert flat.camera.met == 1
    assert 2 <= asked <= 11


@pytest.mark.parametrize(
    "request_", [Status(), Identify(), Start(Direction.LEFT), Stop()], ids=lambda one: type(one).__name__
)
def test_a_fault_where_the_camera_looks_who_it_is_and_of_its_motors_counts(request_: Request) -> None:
    health = Health("ip1")
    health.take(Reply(Status(), 1, Reading(1.0, 2.0, 0.0), None, 0.0, 0.1))
    health.take(Reply(request_, 2, None, BUSY, 1.0, 1.1))
    assert (health.state, health.met) == ("offline", False)


def test_no_answer_to_any_question_is_a_lost_camera() -> None:
    health = Health("ip1")
    health.take(Reply(Status(), 1, Reading(1.0, 2.0, 0.0), None, 0.0, 0.1))
    health.take(Reply(GetClock(), 2, None, Away("no answer"), 1.0, 7.1))
    assert health.state == "offline"


def test_a_clock_that_nobody_can_read_was_told_nevertheless() -> None:
    with pytest.raises(Away, match="expected a time") as error:
        dahua.read_clock("result=noon\r\n")
    assert error.value.answered
