"""What the camera's programs answer, without a network."""

from __future__ import annotations

from dataclasses import replace

import pytest

from services.simulators.camera.device import Device
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.messages import read
from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from services.simulators.world import World


@pytest.fixture
def device(world: World) -> Device:
    return Device(world.cameras["ip1"], Profile(), now=0.0)


def _ask(device: Device, target: str, now: float = 0.0) -> str:
    return device.answer(read(f"/cgi-bin/{target}"), now).body.decode()


@pytest.mark.parametrize(
    ("target", "body"),
    [
        ("magicBox.cgi?action=getDeviceType", "type=IP3M-941W\r\n"),
        ("magicBox.cgi?action=getSerialNo", "sn=AMC0000000000001\r\n"),
        ("magicBox.cgi?action=getSoftwareVersion", "version=2.420.AC00.15.R\r\nBuildDate=2016-09-08\r\n"),
        ("magicBox.cgi?action=getMachineName", "name=Camera1\r\n"),
        ("magicBox.cgi?action=getNonsense", "Error\r\n"),
        ("configManager.cgi?action=getConfig&name=RTSP", "table.RTSP.Enable=true\r\ntable.RTSP.Port=554\r\n"),
        ("configManager.cgi?action=getConfig&name=Nonsense", "Error\r\n"),
        ("eventManager.cgi?action=getEventIndexes&code=VideoMotion", "Error: No Events\r\n"),
        ("ptz.cgi?action=start&channel=7&code=Up&arg1=0&arg2=1&arg3=0", "Error\r\n"),
        ("ptz.cgi?action=start&channel=0&code=Up&arg1=0&arg2=fast&arg3=0", "Error\r\n"),
        ("ptz.cgi?action=start&channel=0&code=PositionABS&arg1=10&arg2=20&arg3=0", "Error\r\n"),
        ("ptz.cgi?action=start&channel=0&code=GotoPreset&arg1=0&arg2=25&arg3=0", "Error\r\n"),
        ("ptz.cgi?action=start&channel=1&code=GotoPreset&arg1=0&arg2=3&arg3=0", "OK\r\n"),
    ],
)
def test_requests_and_their_answers(device: Device, target: str, body: str) -> None:
    assert _ask(device, target) == body


@pytest.mark.parametrize(
    ("style", "status", "body"),
    [
        ("400-body", 400, b"Error\r\nBad Request!\r\n"),
        ("200-error", 200, b"Error\r\n"),
        ("501", 501, b"Error\r\nNot Implemented!\r\n"),
    ],
)
def test_firmware_says_no_in_its_own_way(world: World, style: str, status: int, body: bytes) -> None:
    profile = replace(Profile(), error_style=style)  # type: ignore[arg-type]
    answer = Device(world.cameras["ip1"], profile, 0.0).answer(read("/cgi-bin/magicBox.cgi?action=x"), 0.0)
    assert (answer.status, answer.body) == (status, body)


def test_the_status_has_the_misspelt_key_and_tenths(device: Device) -> None:
    device.place(Pose(91.63, -2.57, 0.0), 0.0)
    assert _ask(device, "ptz.cgi?action=getStatus").split("\r\n") == [
        "status.Action=Preset",
        "status.MoveStatus=Idle",
        "status.PTS=0",
        "status.Postion[0]=91.600000",
        "status.Postion[1]=-2.600000",
        "status.Postion[2]=0.000000",
        "status.PresetID=0",
        "status.Sequence=0",
        "status.UTC=0",
        "status.ZoomStatus=Idle",
        "",
    ]


@pytest.mark.parametrize("form", ["a", "b", "c"])
def test_every_status_form_tells_the_position(world: World, form: str) -> None:
    device = Device(world.cameras["ip1"], replace(Profile(), status_form=form), 0.0)  # type: ignore[arg-type]
    told = _ask(device, "ptz.cgi?action=getStatus&channel=1")
    assert f"status.Postion[1]={'20.0' if form == 'c' else '20.000000'}\r\n" in told


def test_a_preset_is_reached_and_told(device: Device, world: World) -> None:
    pan, tilt = world.cameras["ip1"].aim(world.cameras["ip1"].places["Living room"].looks_at)
    assert _ask(device, "ptz.cgi?action=start&channel=0&code=GotoPreset&arg1=0&arg2=4&arg3=0") == "OK\r\n"
    assert "MoveStatus=Moving" in _ask(device, "ptz.cgi?action=getStatus", 0.5)
    status = _ask(device, "ptz.cgi?action=getStatus", 20.0)
    assert "MoveStatus=Idle" in status
    assert f"Postion[0]={pan:.1f}00000" in status
    assert f"Postion[1]={tilt:.1f}00000" in status
    assert "PresetID=4" in status


def test_presets_are_stored_named_listed_and_cleared(device: Device) -> None:
    assert _ask(device, "ptz.cgi?action=getPresets&channel=0").startswith(
        "presets[0].Index=1\r\npresets[0].Name=Dining"
    )
    _ask(device, "ptz.cgi?action=start&channel=0&code=SetPreset&arg1=0&arg2=12&arg3=0")
    _ask(device, "ptz.cgi?action=setPreset&channel=0&arg1=13&arg2=My%20place")
    listed = _ask(device, "ptz.cgi?action=getPresets&channel=0")
    assert "Index=12\r\npresets[9].Name=Preset12" in listed
    assert "Name=My place" in listed
    _ask(device, "ptz.cgi?action=start&channel=0&code=ClearPreset&arg1=0&arg2=12&arg3=0")
    assert "Index=12" not in _ask(device, "ptz.cgi?action=getPresets&channel=0")


def test_absolute_positions_take_the_travel_where_the_firmware_can(world: World) -> None:
    device = Device(world.cameras["ip1"], PROFILES["2020s-dahua"], 0.0)
    assert _ask(device, "ptz.cgi?action=start&channel=1&code=PositionABS&arg1=170&arg2=20&arg3=0") == "OK\r\n"
    assert device.motion(30.0)[0] == pytest.approx(Pose(10.0, 20.0, 0.0))


def test_written_settings_are_read_back_and_unknown_ones_are_passed_over(device: Device) -> None:
    write = "configManager.cgi?action=setConfig&"
    assert _ask(device, write + "VideoInOptions[0].Flip=false&VideoInOptions[0].Nonsense=1") == "OK\r\n"
    table = _ask(device, "configManager.cgi?action=getConfig&name=VideoInOptions[0].Flip")
    assert table == "table.VideoInOptions[0].Flip=false\r\n"
    assert _ask(device, write + "Nonsense.Key=1") == "Error\r\n"
    _ask(device, write + "VideoColor[0][0].Contrast=170")
    assert device.tables.number("VideoColor[0][0].Contrast") == 100


def test_a_plus_is_not_a_space_and_brackets_may_be_encoded(device: Device) -> None:
    _ask(device, "configManager.cgi?action=setConfig&General.MachineName=Living%20room+error")
    assert _ask(device, "magicBox.cgi?action=getMachineName") == "name=Living room+error\r\n"
    _ask(device, "configManager.cgi?action=setConfig&VideoInOptions%5B0%5D.Mirror=false")
    assert not device.tables.flag("VideoInOptions[0].Mirror")


@pytest.mark.parametrize(
    ("profile", "key", "value"),
    [
        ("ip3m-941w-2019", "VideoInOptions[0].DayNightColor", "2"),
        ("2020s-dahua", "VideoInDayNight[0][0].Mode", "BlackWhite"),
    ],
)
def test_black_and_white_is_where_the_firmware_has_it(world: World, profile: str, key: str, value: str) -> None:
    device = Device(world.cameras["ip1"], PROFILES[profile], 0.0)
    assert device.tables.colour == "auto"
    assert _ask(device, f"configManager.cgi?action=setConfig&{key}={value}") == "OK\r\n"
    assert device.tables.colour == "bw"


@pytest.mark.parametrize("profile", ["ip3m-941w-2019", "2020s-dahua"])
def test_each_profile_has_a_colour_and_contrast_of_its_own_and_the_active_one_counts(
    world: World, profile: str
) -> None:
    device = Device(world.cameras["ip1"], PROFILES[profile], 0.0)
    assert _ask(device, "configManager.cgi?action=setConfig&VideoColor[0][1].Contrast=70") == "OK\r\n"
    seen = []
    for active in ("0", "1", "2", "7"):
        _ask(device, f"configManager.cgi?action=setConfig&VideoInMode[0].Config[0]={active}")
        seen.append((device.tables.colour, device.tables.tone("Contrast")))
    assert seen == [("auto", 50), ("bw", 70), ("auto", 50), ("auto", 50)]


def test_a_reboot_returns_to_the_start_and_takes_its_time(device: Device) -> None:
    device.place(Pose(91.6, 40.0, 0.0), 0.0)
    assert _ask(device, "magicBox.cgi?action=reboot", 1.0) == "OK\r\n"
    assert device.booting(60.0)
    assert not device.booting(61.5)
    assert device.motion(61.5)[0] == pytest.approx(Pose(0.0, 20.0, 0.0))
