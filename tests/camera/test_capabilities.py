"""What a camera can do: asked without moving it, once for each firmware, and only while it has nothing else to do."""

from __future__ import annotations

import json
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

from services.camera.brands.dahua import capabilities as dahua
from services.camera.capabilities import PARTS, Abilities, Capabilities, GetCapabilities, joined
from services.camera.device import Away, BadLogin, Identity, Locked, Refused, Reply
from services.camera.plan import Until
from services.errors import DeviceError
from tests.camera.bench import bench, simulator

CAPS = (
    "caps.MoveAbsolutely=true\r\ncaps.MoveRelatively=false\r\ncaps.PresetMax=300\r\ncaps.Zoom=false\r\n"
    "caps.PtzMotionRange.VerticalAngle[0]=-15\r\ncaps.PtzMotionRange.VerticalAngle[1]=100\r\n"
)
IDENTITY = Identity("IP3M-941W", "AMC0000000000001", "2.420 2016")


def spoken(dialogue: Generator[str, str, object], answers: list[str | DeviceError]) -> tuple[object, list[str]]:
    """What a dialogue returns, and what it asked."""
    asked = [next(dialogue)]
    for answer in answers:
        try:
            asked.append(dialogue.throw(answer) if isinstance(answer, DeviceError) else dialogue.send(answer))
        except StopIteration as stop:
            return stop.value, asked
    raise AssertionError(f"it asks on: {asked}")


def test_the_cameras_list_is_read() -> None:
    told, asked = spoken(dahua.detect("motors"), [CAPS])
    assert told == Capabilities(presets=300, absolute=True, relative=False, zoom=False, tilt_range=(-15.0, 100.0))
    assert asked == ["/cgi-bin/ptz.cgi?action=getCurrentProtocolCaps&channel=1"]


def test_a_camera_that_refuses_channel_one_is_asked_on_the_other() -> None:
    body = "status.MoveStatus=Idle\r\nstatus.Postion[0]=1\r\nstatus.Postion[1]=2\r\n"
    told, _ = spoken(dahua.detect("status"), [Refused("no"), body])
    assert told == Capabilities(channel=0, status_form="a")


@pytest.mark.parametrize("part", PARTS)
def test_what_a_camera_refuses_it_does_not_have(part: Any) -> None:
    told, asked = spoken(dahua.detect(part), [Refused("no"), Refused("no")])
    assert told == Capabilities()
    assert not [target for target in asked if "action=start" in target or "setConfig" in target]


def test_parts_are_put_together() -> None:
    whole = joined(Capabilities(presets=25, zoom=False), Capabilities(audio_in=1, privacy=True))
    assert whole == Capabilities(presets=25, zoom=False, audio_in=1, privacy=True)
    assert whole.words == "presets 25, microphones 1, privacy"


def answered(abilities: Abilities, identity: Identity | None, answer: Any) -> list[object]:
    """Runs the plan; what it asked for."""
    plan, asked, sent = abilities.meet(identity, 0.0), [], None
    try:
        while True:
            step = plan.send(sent)
            asked.append(step)
            sent = 1.0 if isinstance(step, Until) else reply(step, answer)
    except StopIteration:
        return asked


def reply(request: Any, answer: Any) -> Reply:
    answer = answer(request) if callable(answer) else answer
    error = answer if isinstance(answer, DeviceError) else None
    return Reply(request, 1, None if error else answer, error, 0.0, 0.1)


def test_the_same_firmware_is_asked_once_and_a_new_one_again(tmp_path: Path) -> None:
    file = tmp_path / "state" / "ip1-can.json"
    first = Abilities(file, lambda: True)
    assert answered(first, IDENTITY, Capabilities(presets=25)) == [GetCapabilities(part) for part in PARTS]
    again = Abilities(file, lambda: True)
    assert answered(again, IDENTITY, Capabilities()) == []
    assert again.present == Capabilities(presets=25)
    assert len(answered(again, Identity("IP3M-941W", "AMC0000000000001", "2.800"), Capabilities())) == len(PARTS)


def test_it_waits_while_the_camera_has_something_to_do() -> None:
    busy = iter([False, False, *[True] * 20])
    steps = answered(Abilities(None, lambda: next(busy)), IDENTITY, Capabilities())
    assert [type(step) for step in steps[:3]] == [Until, Until, GetCapabilities]


def test_a_camera_that_goes_away_is_asked_again_when_it_is_back(tmp_path: Path) -> None:
    abilities = Abilities(tmp_path / "can.json", lambda: True)
    assert len(answered(abilities, IDENTITY, Away("gone"))) == 1
    assert abilities.present is None
    assert len(answered(abilities, IDENTITY, Capabilities(presets=8))) == len(PARTS)


@pytest.mark.parametrize("error", [BadLogin("no"), Locked("no")], ids=["bad_login", "locked"])
def test_what_was_asked_with_a_wrong_password_is_asked_again(tmp_path: Path, error: DeviceError) -> None:
    abilities = Abilities(tmp_path / "can.json", lambda: True)
    assert len(answered(abilities, IDENTITY, error)) == 1
    assert not (tmp_path / "can.json").exists()
    assert len(answered(abilities, IDENTITY, Capabilities(presets=8))) == len(PARTS)


def test_what_a_camera_answers_with_a_fault_is_asked_again_in_another_life_only(tmp_path: Path) -> None:
    def answer(request: GetCapabilities) -> object:
        return Away("the camera answered 500", answered=True) if request.part == "privacy" else Capabilities(presets=8)

    abilities = Abilities(tmp_path / "can.json", lambda: True)
    assert len(answered(abilities, IDENTITY, answer)) == len(PARTS)
    assert abilities.present == Capabilities(presets=8)
    assert not (tmp_path / "can.json").exists()


def test_a_file_that_makes_no_sense_is_as_good_as_none(tmp_path: Path) -> None:
    file = tmp_path / "can.json"
    file.write_text('{"x": {"presets": "many"}}')
    assert answered(Abilities(file, lambda: True), IDENTITY, Capabilities())


def test_the_service_finds_out_without_moving_the_camera(tmp_path: Path) -> None:
    with simulator(latency_s=0) as camera, bench(tmp_path, camera, state=tmp_path / "state") as here:
        here.until(lambda: here.service.abilities.present is not None, 60)
        told = here.service.abilities.present
        assert told is not None
        assert (told.channel, told.presets, told.status_form, told.day_night) == (1, 25, "a", "VideoInOptions")
        assert (told.zoom, told.tilt_range) == (True, (-10.0, 108.0))
        assert not [entry for entry in camera.server.log if "action=start" in entry["target"]]
    assert list(json.loads((tmp_path / "state" / "ip1-can.json").read_text())) == [
        "AMC0000000000001 2.420.AC00.15.R 2016-09-08"
    ]
