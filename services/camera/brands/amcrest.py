"""Amcrest and Dahua cameras over their HTTP API: requests and replies as functions, and the client that sends them.

Firmware differs much: both spellings of Position, several forms of status, version and error, channel 0 or 1.
"""

from __future__ import annotations

from collections.abc import Mapping

import httpx

from services.camera.address import Address
from services.camera.digest import Login
from services.camera.requests import (
    Away,
    BadLogin,
    Camera,
    ClearPreset,
    Direction,
    GetPicture,
    GotoPreset,
    Identify,
    Identity,
    Locked,
    Mode,
    Picture,
    Reading,
    Reboot,
    Refused,
    Request,
    SavePreset,
    SetPicture,
    Snapshot,
    Start,
    Status,
    Stop,
)
from services.camera.web import COMMAND, SNAPSHOT, connection, fetch

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
MODES: dict[Mode, int] = {"color": 0, "auto": 1, "bw": 2}
PICTURE_TABLE = "/cgi-bin/configManager.cgi?action=getConfig&name=VideoInOptions"
MODE_TABLE = "/cgi-bin/configManager.cgi?action=getConfig&name=VideoInDayNight"
PROFILES = ("", "NightOptions.", "NormalOptions.")
NEW_MODES: dict[Mode, str] = {"color": "Color", "auto": "Brightness", "bw": "BlackWhite"}


def ptz(action: str, code: str, channel: int, arguments: tuple[int, int, int] = (0, 0, 0)) -> str:
    """The request target of a command to the motors."""
    args = "".join(f"&arg{index}={value}" for index, value in enumerate(arguments, start=1))
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


def stop(direction: Direction, channel: int) -> str:
    """Stops the motion of that code."""
    return ptz("stop", CODES[direction], channel)


def preset(code: str, number: int, channel: int) -> str:
    """GotoPreset, SetPreset or ClearPreset."""
    return ptz("start", code, channel, (0, number, 0))


def status(channel: int) -> str:
    """Asks where the camera looks."""
    return f"/cgi-bin/ptz.cgi?action=getStatus&channel={channel}"


def magic(action: str) -> str:
    """Asks for a fact about the device."""
    return f"/cgi-bin/magicBox.cgi?action={action}"


def set_picture(request: SetPicture) -> str:
    """Writes the picture's options in all profiles, brackets as they are."""
    wanted: list[tuple[str, str]] = []
    for option, flag in (("Flip", request.flip), ("Mirror", request.mirror)):
        if flag is not None:
            wanted += [(f"{profile}{option}", str(flag).lower()) for profile in PROFILES]
    if request.mode is not None:
        wanted += [(f"{profile}DayNightColor", str(MODES[request.mode])) for profile in PROFILES]
    pairs = "&".join(f"VideoInOptions[0].{key}={value}" for key, value in wanted)
    return f"/cgi-bin/configManager.cgi?action=setConfig&{pairs}"


def set_mode(mode: Mode) -> str:
    """Writes the mode where newer firmware has it."""
    pairs = "&".join(f"VideoInDayNight[0][{profile}].Mode={NEW_MODES[mode]}" for profile in range(3))
    return f"/cgi-bin/configManager.cgi?action=setConfig&{pairs}"


def read_table(body: str) -> dict[str, str]:
    """`key=value` lines, split at the first `=`."""
    pairs = (line.partition("=") for line in body.splitlines())
    return {key.strip(): value.strip() for key, found, value in pairs if found}


def is_ok(body: str) -> bool:
    """Success is a body whose first word is exactly OK."""
    return body.split()[:1] == ["OK"]


def read_status(body: str) -> Reading:
    """The pose, from any form of status; Away when there is none in it."""
    table = read_table(body)
    values = [
        next((table[key] for key in (f"status.Postion[{axis}]", f"status.Position[{axis}]") if key in table), None)
        for axis in range(3)
    ]
    try:
        pan, tilt = float(values[0] or ""), float(values[1] or "")
        zoom = float(values[2] or table.get("status.Zoom", "0"))
    except ValueError as error:
        raise Away(f"expected a position in the status, got {body[:80]!r}") from error
    return Reading(pan, tilt, zoom, _moving(table))


def _moving(table: Mapping[str, str]) -> bool | None:
    words = {table.get(f"status.{key}", "") for key in ("MoveStatus", "ZoomStatus", "PanTiltStatus")}
    if words & {"Moving", "Zooming"}:
        return True
    return False if "Idle" in words else None


def read_picture(options: str, modes: str = "") -> Picture:
    """The picture's options; `modes` is the table of newer firmware, which wins."""
    table = read_table(options)
    prefix = "table.VideoInOptions[0]."
    if f"{prefix}Flip" not in table or f"{prefix}Mirror" not in table:
        raise Refused("the camera does not tell how its picture is flipped")
    by_number = {str(number): mode for mode, number in MODES.items()}
    by_word = {word: mode for mode, word in NEW_MODES.items()}
    mode = by_number.get(table.get(f"{prefix}DayNightColor", ""), "auto")
    mode = by_word.get(read_table(modes).get("table.VideoInDayNight[0][0].Mode", ""), mode)
    return Picture(table[f"{prefix}Flip"] == "true", table[f"{prefix}Mirror"] == "true", mode)


def read_version(body: str) -> str:
    """`version=...` with the build date on its own line, or after a comma."""
    table = read_table(body)
    version, _, build = table.get("version", "").partition(",build:")
    date = build or table.get("BuildDate", "")
    return f"{version} {date}".strip()


def check(response: httpx.Response) -> httpx.Response:
    """The answer when it is a good one; else the error that says what to do about it."""
    text = response.text[:200] if response.headers.get("content-type", "text/").startswith("text/") else ""
    if "User Locked" in text:
        raise Locked("the camera has locked this account after wrong passwords")
    if response.status_code == 401:
        if "Invalid Authority" in text:
            raise Refused("the account has no right to do that")
        raise BadLogin("the camera does not accept this user and password")
    if response.status_code >= 500 and response.status_code != 501:
        raise Away(f"the camera answered {response.status_code}")
    if response.status_code != 200 or text.split()[:1] == ["Error"]:
        raise Refused(f"the camera answered {response.status_code} {' '.join(text.split())[:80]}".strip())
    return response


class Amcrest:
    """A Camera; `channel` None: found out by asking for the status with 1, then 0."""

    def __init__(self, address: Address, transport: httpx.BaseTransport | None = None) -> None:
        self.login = Login(address.user, address.password)
        self.http = connection(address, self.login, transport)
        self.channel = address.channel
        self.running: Direction | None = None
        self._in_day_night = False  # the firmware keeps the mode in VideoInDayNight

    def close(self) -> None:
        """Ends the connection."""
        self.http.close()

    def send(self, request: Request) -> object:
        """One request of ours, mostly one of the camera's; DeviceError as in `requests.py`."""
        match request:
            case Start():
                return self._start(request)
            case Stop():
                return self._stop(request)
            case Status():
                return read_status(self._status())
            case GotoPreset(number) | SavePreset(number) | ClearPreset(number):
                code = {GotoPreset: "GotoPreset", SavePreset: "SetPreset", ClearPreset: "ClearPreset"}[type(request)]
                return self._command(preset(code, number, self._known_channel()))
            case Snapshot():
                return self._snapshot()
            case GetPicture():
                return self._picture()
            case SetPicture():
                return self._set_picture(request)
            case Identify():
                return self._identify()
            case Reboot():
                return self._command(magic("reboot"))

    def _get(self, target: str, timeout: httpx.Timeout = COMMAND) -> httpx.Response:
        return check(fetch(self.http, target, timeout))

    def _command(self, target: str) -> object:
        body = self._get(target).text
        if not is_ok(body):
            raise Refused(f"expected OK from the camera, got {' '.join(body.split())[:80]!r}")
        return None

    def _start(self, request: Start) -> object:
        channel = self._known_channel()
        self.running = request.direction
        return self._command(start(request, channel))

    def _stop(self, request: Stop) -> object:
        channel = self._known_channel()
        refused: list[Refused] = []
        known = request.direction or self.running
        directions = [known] if known is not None and not request.every else list(Direction)
        for direction in directions:
            try:
                self._command(stop(direction, channel))
            except Refused as error:  # firmware that refuses to stop what does not run
                refused.append(error)
        if len(refused) == len(directions):
            raise refused[0]
        return None

    def _known_channel(self) -> int:
        if self.channel is None:
            self._status()
        return self.channel or 0

    def _status(self) -> str:
        if self.channel is not None:
            return self._get(status(self.channel)).text
        for channel in (1, 0):
            try:
                body = self._get(status(channel)).text
                read_status(body)
            except Refused:
                continue
            self.channel = channel
            return body
        raise Refused("the camera tells its position on neither channel 1 nor 0")

    def _snapshot(self) -> bytes:
        body = self._get("/cgi-bin/snapshot.cgi", SNAPSHOT).content
        if not body.startswith(b"\xff\xd8"):
            raise Away(f"expected a JPEG, got {body[:40]!r}")
        return body

    def _picture(self) -> Picture:
        options = self._get(PICTURE_TABLE).text
        if "DayNightColor" in options:
            return read_picture(options)
        try:
            modes = self._get(MODE_TABLE).text
        except Refused:
            return read_picture(options)
        self._in_day_night = "VideoInDayNight" in modes
        return read_picture(options, modes)

    def _set_picture(self, request: SetPicture) -> Picture:
        if request.flip is not None or request.mirror is not None or not self._in_day_night:
            self._command(set_picture(request))
        if request.mode is not None and self._in_day_night:
            self._command(set_mode(request.mode))
        return self._picture()

    def _identify(self) -> Identity:
        model = read_table(self._get(magic("getDeviceType")).text).get("type", "")
        serial = read_table(self._get(magic("getSerialNo")).text).get("sn", "")
        return Identity(model, serial, read_version(self._get(magic("getSoftwareVersion")).text))


def connect(address: Address) -> Camera:
    """A client for the camera there; nothing is sent yet."""
    return Amcrest(address)
