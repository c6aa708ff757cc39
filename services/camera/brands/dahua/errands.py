"""The clock, alarms, privacy, contrast and storage of a camera, as dialogues: targets out, bodies in. Pure.

What is written is read back: firmware says OK to keys that it does not have.
"""

from __future__ import annotations

import re
from collections.abc import Generator
from datetime import datetime

from services.camera.brands.dahua import capabilities, events, picture
from services.camera.brands.dahua.replies import is_ok, read_table
from services.camera.capabilities import GetCapabilities
from services.camera.device import Away, Errand, Refused
from services.camera.errands import (
    GetClock,
    GetContrast,
    GetMotion,
    GetMotionHold,
    GetPrivacy,
    GetStorage,
    SetClock,
    SetContrast,
    SetPrivacy,
    Storage,
)

Dialogue = Generator[str, str, object]  # yields request targets, is sent the bodies of good answers

CLOCK_FORM = "%Y-%m-%d %H:%M:%S"
CLOCK = "/cgi-bin/global.cgi?action=getCurrentTime"
STORAGE = "/cgi-bin/storageDevice.cgi?action=getDeviceAllInfo"
DETECTED = ("VideoMotion", "SmartMotion")  # the codes of the motion detection begin so
_CONTRAST = re.compile(r"table\.VideoColor\[0\]\[(\d+)\]\.Contrast")


def dialogue(errand: Errand) -> Dialogue:
    """What to send for an errand; its return value is the answer. Refused where the camera has no such thing."""
    match errand:
        case GetMotion(code):
            return _motion(code)
        case GetMotionHold(code):
            return _motion_hold(code)
        case GetClock():
            return _clock()
        case SetClock(shown):
            return _set_clock(shown)
        case GetPrivacy():
            return _privacy()
        case SetPrivacy(on):
            return _set_privacy(on)
        case GetContrast():
            return _contrast()
        case SetContrast(values):
            return _set_contrast(values)
        case GetStorage():
            return _storage()
        case GetCapabilities(part):
            return capabilities.detect(part)
    raise Refused(f"this brand knows no {type(errand).__name__}")


def table(name: str) -> str:
    """Asks for a table of the configuration."""
    return f"/cgi-bin/configManager.cgi?action=getConfig&name={name}"


def _written(pairs: dict[str, str]) -> Dialogue:
    body = yield picture.written(pairs)
    if not is_ok(body):
        raise Refused(f"expected OK from the camera, got {' '.join(body.split())[:80]!r}")
    return None


def _motion(code: str) -> Dialogue:
    try:
        body = yield events.indexes(code)
    except Refused:
        return False  # `Error: No Events`, which older firmware answers too when there is nothing
    return events.read_indexes(body)


def _motion_hold(code: str) -> Dialogue:
    if not code.startswith(DETECTED):
        raise Refused(f"it is not known how long the camera holds {code}")
    held = read_table((yield table("MotionDetect"))).get("table.MotionDetect[0].EventHandler.Dejitter", "")
    if not held.isdecimal():
        raise Refused("the camera does not tell how long it holds a motion (MotionDetect)")
    return float(held)


def _clock() -> Dialogue:
    return read_clock((yield CLOCK))


def _set_clock(shown: datetime) -> Dialogue:
    body = yield set_clock(shown)
    if not is_ok(body):
        raise Refused(f"the camera does not take the time: {' '.join(body.split())[:80]!r}")
    return read_clock((yield CLOCK))


def set_clock(shown: datetime) -> str:
    """Sets the clock; a `+` for the space would be ignored although the answer is fine."""
    time = shown.strftime(CLOCK_FORM).replace(" ", "%20")
    return f"/cgi-bin/global.cgi?action=setCurrentTime&time={time}"


def read_clock(body: str) -> datetime:
    """What the clock shows."""
    shown = read_table(body).get("result", "")
    try:
        return datetime.strptime(shown, CLOCK_FORM)
    except ValueError as error:
        raise Away(f"expected a time, got {body[:80]!r}", answered=True) from error


def _privacy() -> Dialogue:
    on = read_table((yield table("LeLensMask"))).get("table.LeLensMask[0].Enable")
    if on is None:
        raise Refused("this camera has no privacy mode (LeLensMask)")
    return on == "true"


def _set_privacy(on: bool) -> Dialogue:
    try:
        yield from _privacy()
    except Refused as error:
        raise Refused("this camera has no privacy mode (LeLensMask)") from error
    yield from _written({"LeLensMask[0].Enable": str(on).lower()})
    return (yield from _privacy())


def _contrast() -> Dialogue:
    found = {
        int(match[1]): int(value)
        for key, value in read_table((yield table("VideoColor"))).items()
        if (match := _CONTRAST.fullmatch(key)) and value.isdigit()
    }
    if not found:
        raise Refused("the camera does not tell its contrast")
    return tuple(found[profile] for profile in sorted(found))


def _set_contrast(values: tuple[int, ...]) -> Dialogue:
    yield from _written(picture.contrasts(values))
    return (yield from _contrast())


def _storage() -> Dialogue:
    return read_storage((yield STORAGE))


def read_storage(body: str) -> Storage:
    """The first card; "none" where the camera lists none."""
    values = read_table(body)
    state = next((value for key, value in values.items() if key.endswith("].State")), "none")
    total, used = (
        sum(float(value) for key, value in values.items() if key.endswith(f".{name}") and _is_number(value))
        for name in ("TotalBytes", "UsedBytes")
    )
    return Storage(state, total, used)


def _is_number(text: str) -> bool:
    return re.fullmatch(r"\d+(\.\d+)?", text) is not None
