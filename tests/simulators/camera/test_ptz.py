"""Commands of `ptz.cgi` that name a position, a time or a round, and what is told about them, without a network."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import atan, degrees

import pytest

from services.simulators.camera.device import Device
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.messages import Answer, read
from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from services.simulators.world import World

NEWEST = replace(PROFILES["sd2a-2023"], ptz_channels=(0, 1))
REST_S = 60.0


def _device(world: World, profile: Profile, *, mirrored: bool = True, at: Pose | None = None) -> Device:
    device = Device(world.cameras["ip1"], profile, 0.0)
    for key in ("Flip", "Mirror"):
        device.tables.write([(f"VideoInOptions[0].{key}", str(mirrored).lower())])
    device.place(at or Pose(0.0, 20.0, 0.0), 0.0)
    return device


def _ask(device: Device, target: str, now: float = 0.0, cgi: str = "ptz") -> Answer:
    return device.answer(read(f"/cgi-bin/{cgi}.cgi?{target}"), now)


def _code(device: Device, code: str, *arguments: object, now: float = 0.0, action: str = "start") -> str:
    numbers = "".join(f"&arg{index}={value}" for index, value in enumerate(arguments, start=1))
    return _ask(device, f"action={action}&channel=1&code={code}{numbers}", now).body.decode()


def _lines(answer: Answer) -> list[str]:
    return answer.body.decode().split("\r\n")[:-1]


def _rests(device: Device, now: float = REST_S) -> Pose:
    pose, rates = device.motion(now)
    assert not any(rates)
    return pose


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (("180", "30.5", "0"), Pose(0.0, 30.5, 0.0)),  # the travel, not the reading
        (("170", "30.5", "4"), Pose(10.0, 30.5, 4.0)),
        (("0", "20", "0"), Pose(179.0, 20.0, 0.0)),  # at the end stops
        (("360", "20", "0"), Pose(186.0, 20.0, 0.0)),
        (("180", "-90", "0"), Pose(0.0, -10.0, 0.0)),
    ],
)
def test_an_absolute_position_is_gone_to(world: World, given: tuple[str, ...], expected: Pose) -> None:
    device = _device(world, replace(Profile(), position_abs="full"))
    assert _code(device, "PositionABS", *given) == "OK\r\n"
    assert _rests(device) == pytest.approx(expected)


def test_an_absolute_position_takes_a_speed(world: World) -> None:
    device = _device(world, replace(Profile(), position_abs="full"))
    _code(device, "PositionABS", 120, 20, 0, 4)  # 60 degrees at 10 degrees/s: 6 s and 1/12 s of acceleration
    assert any(device.motion(6.07)[1])
    assert not any(device.motion(6.09)[1])


def test_some_firmware_is_off_in_tilt_and_some_ignores_it(world: World) -> None:
    off = _device(world, replace(Profile(), position_abs="full", position_abs_tilt_off=-2.0))
    _code(off, "PositionABS", 170, 40, 0)
    assert _rests(off) == pytest.approx(Pose(10.0, 38.0, 0.0))
    deaf = _device(world, replace(Profile(), position_abs="pan-only"))
    _code(deaf, "PositionABS", 170, 40, 2)
    assert _rests(deaf) == pytest.approx(Pose(10.0, 20.0, 2.0))


@pytest.mark.parametrize(
    "target",
    [
        "action=start&code=PositionABS&arg1=nan&arg2=20&arg3=0",
        "action=start&code=PositionABS&arg1=1000&arg2=20&arg3=0",
        "action=start&code=Position&arg1=8192&arg2=0&arg3=0",
        "action=start&code=Position&arg1=x&arg2=0&arg3=0",
        "action=start&code=Continuously&arg1=10&arg2=0&arg3=0&arg4=-1",
        "action=start&code=Continuously&arg1=101&arg2=0&arg3=0&arg4=1",
        "action=moveAbsolutely&arg1=1.1&arg2=0&arg3=0",
        "action=moveRelatively&arg1=inf&arg2=0&arg3=0",
        "action=start&code=AddTour&arg1=9&arg2=1&arg3=0",
        "action=start&code=AddTour&arg1=1&arg2=301&arg3=0",
        "action=start&code=StartTour&arg1=1&arg2=0&arg3=0",
        "action=start&code=DelTour&arg1=1&arg2=3&arg3=0",
        "action=start&code=Nonsense&arg1=1&arg2=3&arg3=0",
    ],
)
def test_nonsense_is_refused_and_nothing_moves(world: World, target: str) -> None:
    device = _device(world, replace(NEWEST, position_abs="full"))
    assert _ask(device, f"{target}&channel=1").body == b"Error\r\nNot Implemented!\r\n"
    assert device.motion(1.0)[0] == device.motion(0.0)[0]


@pytest.mark.parametrize(
    "target",
    [
        "action=start&code=PositionABS&arg1=100&arg2=20&arg3=0",
        "action=start&code=Position&arg1=100&arg2=0&arg3=0",
        "action=start&code=Continuously&arg1=50&arg2=0&arg3=0&arg4=1",
        "action=start&code=AddTour&arg1=1&arg2=1&arg3=0",
        "action=moveAbsolutely&arg1=0.5&arg2=0&arg3=0",
        "action=moveRelatively&arg1=0.5&arg2=0&arg3=0",
        "action=moveDirectly&startPoint[0]=0&startPoint[1]=0&endPoint[0]=10&endPoint[1]=10",
    ],
)
def test_the_oldest_firmware_takes_none_of_the_newer_commands(world: World, target: str) -> None:
    device = _device(world, Profile())
    assert _ask(device, f"{target}&channel=1").body == b"Error\r\n"
    assert device.motion(1.0)[0] == device.motion(0.0)[0]


@pytest.mark.parametrize(("mirrored", "sign"), [(False, 1.0), (True, -1.0)])
@pytest.mark.parametrize("zoom", [0.0, 4.0])
def test_a_relative_step_brings_the_edge_of_the_picture_to_its_middle(
    world: World, zoom: float, mirrored: bool, sign: float
) -> None:
    lens, larger = world.cameras["ip1"].lens, 1.0 + zoom / 4.0
    half_width = degrees(atan(lens.width / 2 / lens.fx / larger))
    half_height = degrees(atan(lens.height / 2 / lens.fy / larger))
    device = _device(world, NEWEST, mirrored=mirrored, at=Pose(100.0, 50.0, zoom))
    assert _code(device, "Position", 8191, 8191, 0) == "OK\r\n"
    # not mirrored, what is to the right has a smaller reading, and what is below too
    assert _rests(device) == pytest.approx(Pose(100.0 - sign * half_width, 50.0 - sign * half_height, zoom))


def test_a_rectangle_of_the_picture_is_brought_to_its_middle_and_enlarged(world: World) -> None:
    lens = world.cameras["ip1"].lens
    device = _device(world, NEWEST, at=Pose(40.0, 50.0, 0.0))
    corners = "startPoint[0]=4096&startPoint[1]=2048&endPoint[0]=8192&endPoint[1]=6144"
    assert _ask(device, f"action=moveDirectly&channel=1&{corners}", cgi="ptzBase").body == b"OK\r\n"
    pan = 40.0 + degrees(atan(lens.width / 4 / lens.fx))
    assert _rests(device) == pytest.approx(Pose(pan, 50.0, 4.0))  # twice as large


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [(0.5, -0.25, Pose(90.0, 45.0, 4.0)), (-0.5, 0.0, Pose(270.0, 0.0, 4.0)), (0.0, -1.0, Pose(0.0, 108.0, 4.0))],
)
def test_shares_of_half_a_turn_are_readings(world: World, x: float, y: float, expected: Pose) -> None:
    device = _device(world, NEWEST)
    assert _ask(device, f"action=moveAbsolutely&channel=1&arg1={x}&arg2={y}&arg3=0.5").body == b"OK\r\n"
    assert _rests(device) == pytest.approx(expected)


def test_relative_shares_are_of_half_a_turn(world: World) -> None:
    device = _device(world, NEWEST)
    assert _ask(device, "action=moveRelatively&channel=1&arg1=0.1&arg2=0.05&arg3=0.25").body == b"OK\r\n"
    assert _rests(device) == pytest.approx(Pose(18.0, 29.0, 2.0))


def test_a_timed_move_ends_by_itself_after_its_seconds(world: World) -> None:
    device = _device(world, NEWEST)
    assert _code(device, "Continuously", 20, -50, 0, 2) == "OK\r\n"  # to the right and down
    assert _rests(device, 3.0) == pytest.approx(Pose(0.2 * 45.0 * 2, 20.0 + 0.5 * 27.0 * 2, 0.0))


def test_a_timed_move_can_be_stopped_and_slow_ones_are_ignored(world: World) -> None:
    device = _device(world, NEWEST)
    _code(device, "Continuously", 3, -3, 3, 2)
    assert device.motion(1.0)[0] == device.motion(0.0)[0]
    _code(device, "Continuously", 20, 0, 0, 2)
    _code(device, "Continuously", 0, 0, 0, now=1.0, action="stop")
    assert _rests(device, 5.0).pan == pytest.approx(9.0)


def test_a_preset_that_is_not_stored_is_an_error_or_nothing(world: World) -> None:
    strict, lax = (_device(world, replace(Profile(), unset_preset=how)) for how in ("error", "ok"))  # type: ignore[arg-type]
    assert _code(strict, "GotoPreset", 0, 25, 0) == "Error\r\n"
    assert _code(lax, "GotoPreset", 0, 25, 0) == "OK\r\n"
    assert lax.motion(1.0)[0] == lax.motion(0.0)[0]
    assert _code(lax, "GotoPreset", 0, 26, 0) == "Error\r\n"  # there is no such number


def test_a_stop_of_another_code_does_not_end_the_way_to_a_preset(world: World) -> None:
    device = _device(world, Profile())
    _code(device, "GotoPreset", 0, 4, 0)
    _code(device, "Right", 0, 0, 0, now=0.5, action="stop")
    assert any(device.motion(1.0)[1])
    _code(device, "GotoPreset", 0, 0, 0, now=1.0, action="stop")
    assert not any(device.motion(2.0)[1])


def test_newer_firmware_tells_where_a_preset_is(world: World) -> None:
    device = _device(world, NEWEST, at=Pose(90.0, 12.5, 2.0))
    device.ptz.presets.clear()
    assert _ask(device, "action=getPresets&channel=1").body == b""
    _ask(device, "action=setPreset&channel=1&arg1=7&arg2=Sofa")
    assert _lines(_ask(device, "action=getPresets&channel=1")) == [
        "presets[0].Index=7", "presets[0].Name=Sofa", "presets[0].Position=[900,125,2]", "presets[0].Type=0",
    ]  # fmt: skip


def test_a_tour_goes_round_its_presets_until_it_is_stopped(world: World) -> None:
    device = _device(world, NEWEST)
    for number, pan in ((1, 45.0), (2, 0.0)):
        device.ptz.presets[number] = (f"Preset{number}", Pose(pan, 20.0, 0.0))
        assert _code(device, "AddTour", 3, number, 0) == "OK\r\n"
    listed = _ask(device, "action=getTours&channel=1", cgi="configManager")
    assert _lines(listed) == [
        "tours[0].Index=3",
        "tours[0].Name=Tour3",
        "tours[0].Presets[0]=1",
        "tours[0].Presets[1]=2",
    ]
    assert _code(device, "StartTour", 3, 0, 0) == "OK\r\n"
    one_way_s, dwell_s = 45.0 / 45.0 + 0.375, 10.0
    assert [device.motion(at)[0].pan for at in (5.0, 15.0, 25.0)] == pytest.approx([45.0, 0.0, 45.0])
    later = 2 * (one_way_s + dwell_s) + 0.5
    assert device.motion(later)[1].pan > 0
    _code(device, "StopTour", 3, 0, 0, now=later)
    assert 0.0 < _rests(device, later + 30.0).pan < 45.0


def test_a_tour_ends_when_the_camera_is_told_to_move(world: World) -> None:
    device = _device(world, NEWEST)
    device.ptz.presets[1] = ("Preset1", Pose(45.0, 20.0, 0.0))
    _code(device, "AddTour", 1, 1, 0)
    _code(device, "StartTour", 1, 0, 0)
    _code(device, "Left", 0, 4, 0, now=5.0)
    _code(device, "Left", 0, 0, 0, now=6.0, action="stop")
    assert _rests(device, 100.0).pan == pytest.approx(35.0)


def test_stops_of_a_tour_can_be_taken_out(world: World) -> None:
    device = _device(world, NEWEST)
    for number in (1, 2, 3):
        _code(device, "AddTour", 1, number, 0)
    _code(device, "DelTour", 1, 2, 0)
    assert device.ptz.tours == {1: [1, 3]}
    _code(device, "ClearTour", 1, 0, 0)
    assert device.ptz.tours == {}


def test_a_scan_goes_to_and_fro_between_the_limits(world: World) -> None:
    device = _device(world, NEWEST)
    for code, pan in (("SetLeftLimit", 350.0), ("SetRightLimit", 20.0)):
        device.place(Pose(pan, 20.0, 0.0), 0.0)
        assert _code(device, code, 0, 0, 0) == "OK\r\n"
    _code(device, "AutoScanOn", 0, 0, 0)
    seen = [round((device.motion(at / 10)[0].pan + 180.0) % 360.0 - 180.0, 1) for at in range(600)]
    assert (min(seen), max(seen)) == pytest.approx((-10.0, 20.0), abs=0.2)
    assert sum(before > 0.0 >= after for before, after in pairwise(seen)) >= 2
    _code(device, "AutoScanOff", 0, 0, 0, now=60.0)
    _rests(device, 61.0)


def test_firmware_without_scans_accepts_them_and_stays(world: World) -> None:
    device = _device(world, Profile())
    for code in ("AutoPanOn", "AutoScanOn", "SetLeftLimit", "AutoPanOff", "AutoScanOff", "FocusNear"):
        assert _code(device, code, 0, 0, 0) == "OK\r\n"
    assert device.motion(9.0)[0] == device.motion(0.0)[0]


@pytest.mark.parametrize("name", PROFILES)
def test_the_capabilities_are_those_that_the_firmware_has(world: World, name: str) -> None:
    profile = PROFILES[name]
    device = _device(world, profile)
    channel = profile.ptz_channels[0]
    told = dict(line.split("=") for line in _lines(_ask(device, f"action=getCurrentProtocolCaps&channel={channel}")))
    for cap, target in (("Tour", "action=start&code=AddTour&arg1=1&arg2=1&arg3=0"),
                        ("MoveAbsolutely", "action=moveAbsolutely&arg1=0.1&arg2=0&arg3=0"),
                        ("MoveRelatively", "action=moveRelatively&arg1=0.1&arg2=0&arg3=0")):  # fmt: skip
        assert (_ask(device, f"{target}&channel={channel}").body == b"OK\r\n") is (told[f"caps.{cap}"] == "true")
    most = int(told["caps.PresetMax"])
    for number, fits in ((most, True), (most + 1, False)):
        set_preset = f"action=start&code=SetPreset&channel={channel}&arg1=0&arg2={number}&arg3=0"
        assert (_ask(device, set_preset).body == b"OK\r\n") is fits
    assert told["caps.Tile"] == "true"


def test_the_newest_status_has_every_field(world: World) -> None:
    device = _device(world, NEWEST, at=Pose(91.6, -2.6, 2.0))
    assert _lines(_ask(device, "action=getStatus&channel=1")) == [
        "status.AbsPosition[0]=9160", "status.AbsPosition[1]=-260", "status.AbsPosition[2]=200",
        "status.ActionID=0", "status.Action=Preset", "status.MoveStatus=Idle", "status.PTS=0",
        "status.Position[0]=91.600000", "status.Position[1]=-2.600000", "status.Position[2]=2.000000",
        "status.PresetID=0", "status.Sequence=0", "status.UTC=0", "status.ZoomStatus=Idle",
        "status.PanTiltStatus=Idle", "status.TaskName=", "status.TrackStatus=", "status.ZoomMapValue=200",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("how", "before", "moving", "after"),
    [
        ("honest", "Idle", "Moving", "Idle"),
        ("always-idle", "Idle", "Idle", "Idle"),
        ("stuck", "Idle", "Moving", "Moving"),
        ("unknown", "Unknown", "Unknown", "Unknown"),
    ],
)
def test_what_a_status_says_of_motion_cannot_be_relied_on(
    world: World, how: str, before: str, moving: str, after: str
) -> None:
    device = _device(world, replace(Profile(), move_status=how))  # type: ignore[arg-type]

    def said(now: float) -> str:
        return next(line for line in _lines(_ask(device, "action=getStatus", now)) if "MoveStatus" in line)

    assert said(0.0) == f"status.MoveStatus={before}"
    _code(device, "Right", 0, 4, 0, now=1.0)
    assert said(2.0) == f"status.MoveStatus={moving}"
    _code(device, "Right", 0, 0, 0, now=2.0, action="stop")
    assert said(5.0) == f"status.MoveStatus={after}"


def test_a_dithering_camera_at_rest_is_a_tenth_off_at_times(world: World) -> None:
    device = _device(world, replace(Profile(), status_dither=True), at=Pose(0.0, 20.0, 0.0))
    seen = {line for _ in range(50) for line in _lines(_ask(device, "action=getStatus")) if "Postion[0]" in line}
    assert seen == {f"status.Postion[0]={pan}00000" for pan in ("0.0", "0.1", "359.9")}


def test_protocols_are_listed(world: World) -> None:
    assert _lines(_ask(_device(world, Profile()), "action=getProtocolList"))[0] == "protocols[0]=DH-SD1"
