"""The camera's clock, its privacy mode, its picture modes, and what it says of itself."""

from __future__ import annotations

import time

import cv2
import numpy as np
import pytest

from services.simulators.camera import Config
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.messages import read
from services.simulators.camera.program import Inside, inside

NOON = time.mktime((2026, 7, 16, 12, 0, 0, 0, 0, -1))
WRITE = "configManager.cgi?action=setConfig&"


@pytest.fixture
def camera(config: Config) -> Inside:
    return inside(config, NOON)


def _ask(camera: Inside, target: str, now: float = NOON) -> str:
    return camera.device.answer(read(f"/cgi-bin/{target}"), now).body.decode()


def _brightness(camera: Inside, now: float) -> float:
    data = np.frombuffer(camera.pictures.jpeg("ExtraFormat", now), np.uint8)
    return float(np.mean(cv2.imdecode(data, cv2.IMREAD_COLOR)))


def test_the_clock_is_set_and_tells_so(camera: Inside) -> None:
    heard = camera.device.events.subscribe(frozenset({"TimeChange"}))
    assert heard is not None
    assert _ask(camera, "global.cgi?action=getCurrentTime") == "result=2026-07-16 12:00:00\r\n"
    assert _ask(camera, "global.cgi?action=setCurrentTime&time=2026-07-16%2011:54:26") == "OK\r\n"
    assert _ask(camera, "global.cgi?action=getCurrentTime", NOON + 2) == "result=2026-07-16 11:54:28\r\n"
    assert (heard.next(0) or "").startswith("Code=TimeChange;action=Pulse;index=0")


@pytest.mark.parametrize("time_", ["2026-07-16+11:54:26", "yesterday", ""])
def test_a_time_that_it_does_not_understand_is_answered_well_and_changes_nothing(camera: Inside, time_: str) -> None:
    assert _ask(camera, f"global.cgi?action=setCurrentTime&time={time_}") == "OK\r\n"
    assert _ask(camera, "global.cgi?action=getCurrentTime") == "result=2026-07-16 12:00:00\r\n"


def test_a_clock_that_drifts_gains_more_and_more(camera: Inside) -> None:
    camera.device.clock.set_off(NOON, 3.0, 1000.0)
    assert _ask(camera, "global.cgi?action=getCurrentTime") == "result=2026-07-16 12:00:03\r\n"
    assert _ask(camera, "global.cgi?action=getCurrentTime", NOON + 10_000) == "result=2026-07-16 14:46:53\r\n"


def test_privacy_covers_the_lens_and_tells_so(camera: Inside) -> None:
    heard = camera.device.events.subscribe(frozenset({"LensMaskOpen", "LensMaskClose"}))
    assert heard is not None
    assert _ask(camera, WRITE + "LeLensMask[0].Enable=true") == "OK\r\n"
    assert _brightness(camera, NOON + 5) < 2
    assert _ask(camera, WRITE + "LeLensMask[0].Enable=false", NOON + 10) == "OK\r\n"
    assert _brightness(camera, NOON + 15) > 50
    assert [(heard.next(0) or "").split(";")[0] for _ in range(2)] == ["Code=LensMaskOpen", "Code=LensMaskClose"]


def test_a_model_without_privacy_refuses_it(config: Config) -> None:
    plain = inside(config.model_copy(update={"switches": PROFILES["ip2m-841b-strict"]}), NOON)
    assert _ask(plain, "configManager.cgi?action=getConfig&name=LeLensMask").startswith("Error")
    assert _ask(plain, WRITE + "LeLensMask[0].Enable=true").startswith("Error")


def test_a_change_of_mode_exposes_anew(camera: Inside) -> None:
    before = _brightness(camera, NOON)
    _ask(camera, WRITE + "VideoInOptions[0].DayNightColor=2", NOON + 1)
    after = [_brightness(camera, NOON + 1 + seconds) for seconds in (0.1, 0.8, 2.0)]
    assert after[0] < 0.5 * before < after[1] < after[2]
    assert after[2] == pytest.approx(before, rel=0.1)
    _ask(camera, WRITE + "VideoInOptions[0].DayNightColor=2", NOON + 5)
    assert _brightness(camera, NOON + 5.1) == pytest.approx(after[2], rel=0.05)  # it was in that mode already


def test_contrast_is_seen_in_the_picture(camera: Inside) -> None:
    def spread(now: float) -> float:
        data = np.frombuffer(camera.pictures.jpeg("ExtraFormat", now), np.uint8)
        return float(np.std(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)))

    plain = spread(NOON)
    _ask(camera, WRITE + "VideoColor[0][0].Contrast=80", NOON + 1)
    assert spread(NOON + 5) > 1.2 * plain


@pytest.mark.parametrize(
    ("target", "body"),
    [
        ("magicBox.cgi?action=getHardwareVersion", "version=1.00\r\n"),
        ("magicBox.cgi?action=getDeviceClass", "deviceClass=IPC\r\n"),
        ("magicBox.cgi?action=getProductDefinition&name=MaxExtraStream", "table.MaxExtraStream=2\r\n"),
        ("IntervideoManager.cgi?action=getVersion&Name=CGI", "version=1.40\r\n"),
        ("IntervideoManager.cgi?action=getVersion&Name=Nonsense", "Error\r\n"),
        ("devAudioInput.cgi?action=getCollect", "result=1\r\n"),
        ("devAudioOutput.cgi?action=getCollect", "result=1\r\n"),
        ("configManager.cgi?action=getConfig&name=AudioOutputVolume", "table.AudioOutputVolume[0]=80\r\n"),
        ("configManager.cgi?action=getConfig&name=T2UServer", "table.T2UServer.Enable=true\r\n"),
        ("configManager.cgi?action=getConfig&name=LightGlobal[0]", "table.LightGlobal[0].Enable=true\r\n"),
    ],
)
def test_what_it_says_of_itself(camera: Inside, target: str, body: str) -> None:
    assert _ask(camera, target) == body


def test_the_card_is_told_when_there_is_one(camera: Inside) -> None:
    told = _ask(camera, "storageDevice.cgi?action=getDeviceAllInfo")
    assert "list.info[0].Detail[0].TotalBytes=31902400512.0\r\n" in told
    camera.device.identity.card = False
    assert _ask(camera, "storageDevice.cgi?action=getDeviceAllInfo") == "Error\r\n"


@pytest.mark.parametrize("action", ["reboot", "shutdown"])
def test_it_is_gone_for_a_while_after_reboot_and_shutdown(camera: Inside, action: str) -> None:
    assert _ask(camera, f"magicBox.cgi?action={action}") == "OK\r\n"
    assert camera.device.booting(NOON + 59)
    assert not camera.device.booting(NOON + 61)
