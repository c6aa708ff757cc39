"""What the camera tells about its motors: status, presets, tours and capabilities, in its firmware's form. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from services.simulators.camera.motors import Pose
from services.simulators.camera.profiles import Profile
from services.simulators.true_camera import WorldCamera

Presets = Mapping[int, tuple[str, Pose]]
TOUR_MAX = 8
LENS = ("Focus.FocusPosition=1053.000000", "Focus.Status=Unknown", "Iris.IrisValue=4.000000", "Iris.Status=Idle")
PROTOCOLS = ("DH-SD1", "PELCO-D", "PELCO-P")


def status(profile: Profile, at: Pose, moves: tuple[bool, bool], preset: int) -> Iterator[str]:
    """The lines of a status: a reading, whether pan or tilt and whether zoom move, the last preset gone to."""
    key, form = profile.position_key, profile.status_form
    if form == "c":
        yield from (f"status.{key}[{axis}]={value:.1f}" for axis, value in enumerate(at))
        yield from (f"status.Zoom={at.zoom:.0f}", f"status.ZoomValue={at.zoom:.0f}")
        return
    turns, zooms = "Moving" if moves[0] else "Idle", "Zooming" if moves[1] else "Idle"
    if profile.move_status == "unknown":
        turns = zooms = "Unknown"
    place = [f"{key}[{axis}]={value:.6f}" for axis, value in enumerate(at)]
    lines = [f"MoveStatus={turns}", "PTS=0", *place, f"PresetID={preset}", "Sequence=0", "UTC=0", f"ZoomStatus={zooms}"]
    lines = [*LENS, *lines, "ZoomValue=170"] if form == "b" else ["Action=Preset", *lines]
    if form == "newest":
        lines = [f"AbsPosition[{axis}]={value * 100:.0f}" for axis, value in enumerate(at)] + ["ActionID=0", *lines]
        lines += [f"PanTiltStatus={turns}", "TaskName=", "TrackStatus=", f"ZoomMapValue={at.zoom * 100:.0f}"]
    yield from (f"status.{line}" for line in lines)


def presets(profile: Profile, stored: Presets) -> Iterator[str]:
    """The lines of the list of presets; the list's index is not the preset's number."""
    for index, (number, (name, pose)) in enumerate(sorted(stored.items())):
        yield f"presets[{index}].Index={number}"
        yield f"presets[{index}].Name={name}"
        if profile.presets_form == "long":
            place = f"[{pose.pan * 10:.0f},{pose.tilt * 10:.0f},{pose.zoom:.0f}]"
            yield from (f"presets[{index}].Position={place}", f"presets[{index}].Type=0")


def tours(stored: Mapping[int, list[int]]) -> Iterator[str]:
    """The lines of the list of tours."""
    for index, (number, stops) in enumerate(sorted(stored.items())):
        yield from (f"tours[{index}].Index={number}", f"tours[{index}].Name=Tour{number}")
        yield from (f"tours[{index}].Presets[{place}]={preset}" for place, preset in enumerate(stops))


def protocols() -> Iterator[str]:
    """The lines of the list of protocols."""
    return (f"protocols[{index}]={name}" for index, name in enumerate(PROTOCOLS))


def capabilities(profile: Profile, camera: WorldCamera) -> Iterator[str]:
    """The lines of what the firmware can do; whether it takes PositionABS is not among them."""
    low, high = camera.tilt_range
    absolute, relative = profile.moves == "readings", profile.moves != "none"
    caps: dict[str, bool | int] = {"AutoPan": profile.auto_scan, "AutoScan": profile.auto_scan, "Aux": False}
    caps |= {"Focus": False, "Iris": False, "MoveAbsolutely": absolute, "MoveRelatively": relative, "Pan": True}
    caps |= {"PanSpeedMax": len(profile.pan_speeds), "PanSpeedMin": 1, "Pattern": False, "Preset": True}
    caps |= {"PresetMax": profile.preset_max, "PresetMin": 1}
    caps |= {"PtzMotionRange.HorizontalAngle[0]": 0, "PtzMotionRange.HorizontalAngle[1]": 360}
    caps |= {"PtzMotionRange.VerticalAngle[0]": round(low), "PtzMotionRange.VerticalAngle[1]": round(high)}
    caps |= {"Tile": True, "TileSpeedMax": len(profile.pan_speeds), "TileSpeedMin": 1}  # the firmware's spelling
    caps |= {"Tour": profile.tours, **({"TourMax": TOUR_MAX, "TourMin": 1} if profile.tours else {}), "Zoom": True}
    return (f"caps.{key}={str(value).lower()}" for key, value in caps.items())
