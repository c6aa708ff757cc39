"""The motors: start and stop, presets, and where the camera looks (`ptz.cgi`). Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import isfinite, nan

from services.camera.brands.dahua.replies import read_table
from services.camera.device import Away, Direction, MoveOver, MoveTo, Reading, Refused, Start, TurnFor

CODES = {
    Direction.LEFT: "Left",
    Direction.RIGHT: "Right",
    Direction.UP: "Up",
    Direction.DOWN: "Down",
    Direction.LEFT_UP: "LeftUp",
    Direction.RIGHT_UP: "RightUp",
    Direction.LEFT_DOWN: "LeftDown",
    Direction.RIGHT_DOWN: "RightDown",
    Direction.ZOOM_IN: "ZoomTele",
    Direction.ZOOM_OUT: "ZoomWide",
}


UNSTOPPABLE = ("moveAbsolutely", "moveRelatively")  # these have no code that a stop could name
PLANE = 8191  # the whole scale of the code Position, in units of the picture's plane
ZOOM_LEVELS = 8.0


def ptz(action: str, code: str, channel: int, arguments: tuple[float, ...] = (0, 0, 0)) -> str:
    """The request target of a command to the motors."""
    args = "".join(f"&arg{index}={value:.12g}" for index, value in enumerate(arguments, start=1))
    return f"/cgi-bin/ptz.cgi?action={action}&channel={channel}&code={code}{args}"


def start(request: Start, channel: int) -> str:
    """Starts a motion; a diagonal with a speed of 0 would be ignored, so speeds are 1 to 8."""
    right, down, zoom = request.direction.value
    speed = min(8, max(1, request.speed))
    if zoom:
        return ptz("start", CODES[request.direction], channel)
    if right and down:
        vertical = min(8, max(1, request.tilt_speed or speed))
        return ptz("start", CODES[request.direction], channel, (vertical, speed, 0))
    return ptz("start", CODES[request.direction], channel, (0, speed, 0))


def turn_for(request: TurnFor, channel: int) -> str:
    """Turns for some seconds; up is positive here."""
    arguments = (request.right, -request.down, request.zoom, round(request.seconds, 2))
    return ptz("start", "Continuously", channel, arguments)


def move_to(request: MoveTo, channel: int) -> str:
    """Drives to readings; PositionABS counts pan from its end stop, against the reading."""
    if request.form == "PositionABS":
        travel = round((180.0 - request.pan) % 360.0, 2)
        return ptz("start", "PositionABS", channel, (travel, round(request.tilt, 2), round(request.zoom, 2), 8))
    pan = (request.pan if request.pan <= 180.0 else request.pan - 360.0) / 180.0
    shares = (round(pan, 6), round(-request.tilt / 180.0, 6), round(request.zoom / ZOOM_LEVELS, 6))
    return _plain("moveAbsolutely", channel, shares)


def move_over(request: MoveOver, channel: int) -> str:
    """Drives on by parts of the whole scale."""
    if request.form == "Position":
        over = (round(request.right * PLANE), round(request.down * PLANE), round(request.zoom, 2))
        return ptz("start", "Position", channel, over)
    shares = (request.right, request.down, request.zoom / ZOOM_LEVELS)  # the camera refuses more than the whole
    return _plain("moveRelatively", channel, tuple(round(min(1.0, max(-1.0, share)), 6) for share in shares))


def _plain(action: str, channel: int, arguments: tuple[float, ...]) -> str:
    args = "".join(f"&arg{index}={value:.12g}" for index, value in enumerate(arguments, start=1))
    return f"/cgi-bin/ptz.cgi?action={action}&channel={channel}{args}"


def code_of(direction: Direction) -> str:
    """What the firmware calls it."""
    return CODES[direction]


def stop(code: str | Direction, channel: int) -> str:
    """Stops the motion of that code."""
    return ptz("stop", code if isinstance(code, str) else CODES[code], channel)


def preset(code: str, number: int, channel: int) -> str:
    """GotoPreset, SetPreset or ClearPreset."""
    return ptz("start", code, channel, (0, number, 0))


def presets(channel: int) -> str:
    """Asks which presets there are."""
    return f"/cgi-bin/ptz.cgi?action=getPresets&channel={channel}"


def read_presets(body: str) -> frozenset[int]:
    """Their numbers, which are not those of the list; of none at all it says nothing. Refused when it is no such list.

    An entry without its number makes it none: what it keeps there would be overwritten.
    """
    table = read_table(body)
    entries = {key.partition(".")[0] for key in table}
    numbers = [table.get(f"{entry}.Index", "") for entry in entries if re.fullmatch(r"presets\[[0-9]+\]", entry)]
    if not all(re.fullmatch(r"[0-9]{1,9}", number) for number in numbers) or bool(numbers) != bool(body.strip()):
        raise Refused(f"the camera does not tell its presets: {' '.join(body.split())[:80]!r}")
    return frozenset(map(int, numbers))


def status(channel: int) -> str:
    """Asks where the camera looks."""
    return f"/cgi-bin/ptz.cgi?action=getStatus&channel={channel}"


def read_status(body: str) -> Reading:
    """The pose, from any form of status; Away when there is none in it."""
    table = read_table(body)
    values = [
        next((table[key] for key in (f"status.Postion[{axis}]", f"status.Position[{axis}]") if key in table), None)
        for axis in range(3)
    ]
    try:
        pan, tilt, zoom = (float(one or "") for one in (*values[:2], values[2] or table.get("status.Zoom", "0")))
    except ValueError:
        pan = tilt = zoom = nan
    if not all(map(isfinite, (pan, tilt, zoom))):
        raise Away(f"expected a position in the status, got {body[:80]!r}")
    return Reading(pan, tilt, zoom, _moving(table))


def _moving(table: Mapping[str, str]) -> bool | None:
    words = {table.get(f"status.{key}", "") for key in ("MoveStatus", "ZoomStatus", "PanTiltStatus")}
    if words & {"Moving", "Zooming"}:
        return True
    return False if "Idle" in words else None
