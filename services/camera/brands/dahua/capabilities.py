"""What the camera can do, by questions that move nothing (`getCurrentProtocolCaps` and its kind). Pure."""

from __future__ import annotations

from collections.abc import Callable, Generator

from services.camera.brands.dahua import picture, ptz
from services.camera.brands.dahua.replies import read_table
from services.camera.capabilities import Capabilities, Part
from services.camera.device import Away, Refused

Dialogue = Generator[str, str, object]  # as in `errands`

CAPS = "/cgi-bin/ptz.cgi?action=getCurrentProtocolCaps&channel="
MASK = "/cgi-bin/configManager.cgi?action=getConfig&name=LeLensMask"
COUNT = "/cgi-bin/devAudio{}.cgi?action=getCollect"
EVENTS = "/cgi-bin/eventManager.cgi?action=getCaps"


def detect(part: Part) -> Dialogue:
    """Asks for one part; what the camera refuses is what it does not have."""
    match part:
        case "status":
            return _status()
        case "motors":
            return _motors()
        case "picture":
            return _told(picture.PICTURE_TABLE, lambda body: Capabilities(day_night=_old_table(body)))
        case "day_night":
            return _told(picture.MODE_TABLE, lambda body: Capabilities(day_night=_new_table(body)))
        case "privacy":
            return _told(MASK, lambda body: Capabilities(privacy="LeLensMask" in body))
        case "audio_in":
            return _told(COUNT.format("Input"), lambda body: Capabilities(audio_in=_count(body)))
        case "audio_out":
            return _told(COUNT.format("Output"), lambda body: Capabilities(audio_out=_count(body)))
        case "events":
            return _told(EVENTS, lambda body: Capabilities(events=_events(body)))


def _told(target: str, read: Callable[[str], Capabilities]) -> Dialogue:
    return read((yield from _optional(target)))


def _status() -> Dialogue:
    for channel in (1, 0):
        body = yield from _optional(ptz.status(channel))
        try:
            ptz.read_status(body)
        except Away:
            continue
        return Capabilities(channel=channel, status_form=status_form(body))
    return Capabilities()


def _motors() -> Dialogue:
    table: dict[str, str] = {}
    for channel in (1, 0):
        table = table or read_table((yield from _optional(f"{CAPS}{channel}")))
    return Capabilities(
        presets=_number(table.get("caps.PresetMax", "")),
        absolute=_flag(table, "MoveAbsolutely"),
        relative=_flag(table, "MoveRelatively"),
        timed=_flag(table, "MoveContinuously"),
        zoom=_flag(table, "Zoom"),
        pan_range=_range(table, "Horizontal"),
        tilt_range=_range(table, "Vertical"),
    )


def status_form(body: str) -> str:
    """a: with presets; b: with lens fields; c: short; newest: with the angles once more."""
    if "status.AbsPosition" in body or "status.PanTiltStatus" in body:
        return "newest"
    if "status.Focus." in body:
        return "b"
    return "a" if "status.MoveStatus" in body else "c"


def _optional(target: str) -> Generator[str, str, str]:
    """The body, or nothing where the camera refuses."""
    try:
        return (yield target)
    except Refused:
        return ""


def _flag(table: dict[str, str], name: str) -> bool | None:
    return {"true": True, "false": False}.get(table.get(f"caps.{name}", ""))


def _number(text: str) -> int:
    return int(text) if text.isdigit() else 0


def _count(body: str) -> int:
    return _number(read_table(body).get("result", ""))


def _events(body: str) -> tuple[str, ...]:
    return tuple(sorted({code for code in read_table(body).values() if code.isalpha() and code[0].isupper()}))


def _range(table: dict[str, str], axis: str) -> tuple[float, float] | None:
    try:
        low, high = (float(table[f"caps.PtzMotionRange.{axis}Angle[{end}]"]) for end in (0, 1))
    except (KeyError, ValueError):
        return None
    return low, high


def _old_table(body: str) -> str | None:
    return "VideoInOptions" if "DayNightColor" in body else None


def _new_table(body: str) -> str | None:
    return "VideoInDayNight" if "table.VideoInDayNight" in body else None
