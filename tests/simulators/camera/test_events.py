"""Events as they go over the wire, byte for byte as captured, and the motion detection behind them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import httpx
import pytest

from services.simulators.camera import Config, events, start
from services.simulators.camera.device import Device
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.messages import read
from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from services.simulators.camera.program import Simulated
from services.simulators.world import World

FORM_A = replace(Profile(), event_form="A")
REGION = {"Id": [0], "RegionName": ["Region1"], "SmartMotionEnable": True}
ATTACH = "/cgi-bin/eventManager.cgi?action=attach&codes=[All]&heartbeat=1"


@pytest.fixture
def device(world: World) -> Device:
    return Device(world.cameras["ip1"], Profile(), now=0.0)


@pytest.fixture
def client(camera: Simulated) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=camera.url, auth=httpx.DigestAuth("ros", "secret123"), timeout=10) as opened:
        yield opened


def _motion(device: Device, begin: float, end: float) -> list[str]:
    """What is told between two times, with the time."""
    heard = device.events.subscribe(frozenset({"VideoMotion"}))
    assert heard is not None
    told = []
    for tenth in range(round(begin * 10), round(end * 10) + 1):
        device.watch(tenth / 10)
        while text := heard.next(0.0):
            told.append(f"{tenth / 10} {text.split(';')[1]}")
    device.events.leave(heard)
    return told


@pytest.mark.parametrize(
    ("profile", "event", "length", "body"),
    [
        (FORM_A, ("VideoMotion", "Start", 0), 78,
         'Code=VideoMotion;action=Start;index=0;data={\n   "SmartMotionEnable" : false\n}\n'),
        (FORM_A, ("VideoMotion", "Stop", 0), 77,
         'Code=VideoMotion;action=Stop;index=0;data={\n   "SmartMotionEnable" : false\n}\n'),
        (FORM_A, ("VideoMotion", "Start", 0, REGION), 127,
         'Code=VideoMotion;action=Start;index=0;data={\n   "Id" : [ 0 ],\n   "RegionName" : [ "Region1" ],\n'
         '   "SmartMotionEnable" : true\n}\n'),
        (FORM_A, ("VideoMotionInfo", "State", 0), 41, "Code=VideoMotionInfo;action=State;index=0"),
        (Profile(), ("VideoMotion", "Start", 0), 37, "Code=VideoMotion;action=Start;index=0"),
    ],
)  # fmt: skip
def test_events_are_those_of_the_captures(profile: Profile, event: tuple, length: int, body: str) -> None:
    text = events.written(profile, *event)
    assert (text, len(text)) == (body, length)
    head = f"--myboundary\r\nContent-Type: text/plain\r\nContent-Length:{length}\r\n\r\n"
    assert events.part(profile, text) == f"{head}{body}\r\n\r\n".encode()


def test_firmware_has_its_quirks() -> None:
    odd = replace(Profile(), event_header_twice=True, event_length_space=True, event_blank_lines=2)
    assert events.head(odd).count(b"HTTP/1.1 200 OK\r\n") == 2
    part = events.part(odd, "Heartbeat")
    assert part == b"--myboundary\r\nContent-Type: text/plain\r\nContent-Length: 9\r\n\r\nHeartbeat\r\n\r\n\r\n\r\n"
    assert PROFILES["2020s-dahua"].event_header_twice


@pytest.mark.parametrize("form", [FORM_A, Profile()], ids=["A", "B"])
@pytest.mark.parametrize(("off", "before"), [(2, False), (-12, False), (0, True), (2, True)])
def test_firmware_counts_wrongly_and_begins_with_an_empty_line(form: Profile, off: int, before: bool) -> None:
    text = events.written(form, "VideoMotion", "Start", 0)
    part = events.part(replace(form, event_length_off=off, event_line_before=before), text).decode()
    top, _, body = part.partition("\r\n\r\n")
    assert top.endswith(f"Content-Length:{len(text) + off}")
    assert body == "\r\n" * before + text + "\r\n\r\n"


@contextmanager
def _attached(config: Config, **switches: Any) -> Iterator[tuple[Simulated, Iterator[bytes]]]:
    """A camera with such firmware, and the chunks that the network gives of its events."""
    with start(config.model_copy(update={"switches": replace(Profile(), **switches)})) as camera:
        auth = httpx.DigestAuth("ros", "secret123")
        with httpx.Client(base_url=camera.url, auth=auth, timeout=10) as client, client.stream("GET", ATTACH) as stream:
            chunks = stream.iter_raw()
            assert b"HTTP" not in next(chunks)  # the first heartbeat: whoever sees it is attached
            yield camera, chunks


def test_a_chunk_holds_less_than_a_part_where_it_is_written_in_pieces(config: Config) -> None:
    with _attached(config, event_writes="pieces", event_form="A") as (camera, chunks):
        camera.server.device.events.tell("VideoMotion", "Start", data=REGION)
        told, whole = b"", b'   "SmartMotionEnable" : true\n}\n\r\n\r\n'
        sizes = []
        while not told.endswith(whole):
            sizes.append(len(chunk := next(chunks)))
            told += chunk
    assert b'   "RegionName" : [ "Region1" ],\n' in told
    assert max(sizes) < 100
    assert len(sizes) >= 4


def test_a_chunk_holds_several_parts_where_they_are_gathered(config: Config) -> None:
    with _attached(config, event_writes="gathered") as (camera, chunks):
        for action in ("Start", "Stop", "Start"):
            camera.server.device.events.tell("VideoMotion", action)
        chunk = next(one for one in chunks if b"VideoMotion" in one)
    assert chunk.count(b"--myboundary") >= 3
    assert chunk.count(b"action=Start") == 2


def test_a_slow_heart_beats_no_faster_than_it_can(config: Config) -> None:
    with _attached(config, heartbeat_least_s=2) as (_, chunks):
        began = time.monotonic()
        assert b"Heartbeat" in next(chunks)
        assert time.monotonic() - began > 1.5


def test_turning_is_taken_for_motion_until_it_has_been_quiet_for_long_enough(device: Device) -> None:
    device.ptz.motors.go(Pose(20.0, 20.0, 0.0), 0.0)
    told = _motion(device, 0.0, 20.0)
    assert [line.split()[1] for line in told] == ["action=Start", "action=Stop"]
    ended = next(t / 10 for t in range(200) if not any(device.ptz.motors.rates(t / 10)) and t > 5)
    began, stopped = (float(line.split()[0]) for line in told)
    assert began <= 0.2
    assert stopped == pytest.approx(ended + 1.0 + 5.0, abs=0.3)  # it settles, and the anti-dither


def test_what_moves_before_the_lens_is_motion_too(device: Device) -> None:
    device.detector.stir(2.0)
    assert _motion(device, 0.0, 12.0) == ["0.0 action=Start", "7.0 action=Stop"]
    assert device.events.active("VideoMotion") == []


def test_a_change_of_the_pictures_mode_is_taken_for_motion(device: Device) -> None:
    assert _motion(device, 0.0, 1.0) == []
    device.answer(read("/cgi-bin/configManager.cgi?action=setConfig&VideoInOptions[0].DayNightColor=2"), 1.0)
    assert _motion(device, 1.0, 3.0) == ["1.0 action=Start"]


def test_no_motion_is_told_while_the_detection_is_off(device: Device) -> None:
    off = "/cgi-bin/configManager.cgi?action=setConfig&MotionDetect[0].Enable=false"
    device.answer(read(off), 0.0)
    device.detector.stir(5.0)
    assert _motion(device, 0.0, 5.0) == []
    device.answer(read(off.replace("false", "true")), 6.0)
    device.detector.stir(8.0)
    assert _motion(device, 6.0, 7.0) == ["6.0 action=Start"]
    device.answer(read(off), 7.5)
    assert _motion(device, 7.5, 8.0) == ["7.5 action=Stop"]


def test_a_reboot_ends_what_goes_on(device: Device) -> None:
    device.detector.stir(50.0)
    device.watch(0.0)
    assert device.events.active("VideoMotion") == [0]
    device.answer(read("/cgi-bin/magicBox.cgi?action=reboot"), 1.0)
    assert device.events.active("VideoMotion") == []
    assert _motion(device, 1.0, 100.0) == []


def test_more_listeners_than_it_can_take_are_refused(camera: Simulated, client: httpx.Client) -> None:
    most = camera.server.device.profile.event_listeners
    kept = [camera.server.device.events.subscribe(frozenset()) for _ in range(most)]
    assert client.get(ATTACH).status_code == 400
    for one in kept:
        assert one is not None
        camera.server.device.events.leave(one)
    with client.stream("GET", ATTACH) as stream:
        assert stream.status_code == 200


def test_silent_events_keep_the_connection_and_say_nothing(camera: Simulated, client: httpx.Client) -> None:
    camera.server.faults.silent_events = True
    with client.stream("GET", ATTACH, timeout=2.5) as stream:
        camera.server.device.events.tell("AlarmLocal", "Start")
        with pytest.raises(httpx.ReadTimeout):  # no heartbeat either
            next(stream.iter_raw())


def test_the_capabilities_name_the_events(device: Device) -> None:
    told = device.answer(read("/cgi-bin/eventManager.cgi?action=getCaps"), 0.0).body.decode()
    assert "=VideoMotion\r\n" in told
