"""The orders of a camera: from a key and a value to a command, and who wins. Pure.

Keys are matched without regard to case. What cannot be done is Refused with the reason, which is the answer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from services.camera.calibration.wishes import CalibrateLens, CalibrateMount, CalibrateZoom, TakeLens
from services.camera.commands import HideLens, PlaySound, RecordSound, VideoMode
from services.camera.device import Direction, Refused, SetPicture
from services.camera.places import name_of
from services.camera.scan.wish import ScanFor
from services.payloads import Who

RANKS: dict[Who, int] = {"scan": 0, "mission": 1, "human": 2}
LONGEST_S = 30.0  # of one Move order: it can be prolonged
TURNS = {tuple(one.name.lower().split("_")): one for one in Direction if not one.name.startswith("Z")}
DIRECTIONS = {"".join(words[::way]): one for way in (1, -1) for words, one in TURNS.items()}  # leftup and upleft
YES, NO = ("true", "on", "1"), ("false", "off", "0")


@dataclass(frozen=True)
class GotoPlace:
    """Move to a place."""

    place: str


@dataclass(frozen=True)
class LookAt:
    """Move to readings; None: as it is."""

    pan: float | None = None
    tilt: float | None = None
    zoom: float | None = None


@dataclass(frozen=True)
class MoveBy:
    """Turn or zoom for some seconds."""

    direction: Direction
    speed: int
    seconds: float


@dataclass(frozen=True)
class Halt:
    """Stand still, whatever is going on."""


@dataclass(frozen=True)
class EndScan:
    """Give up the scan that runs."""


@dataclass(frozen=True)
class SavePlace:
    """Keep where the camera looks."""

    place: str


@dataclass(frozen=True)
class RemovePlace:
    """Forget a place."""

    place: str


@dataclass(frozen=True)
class ShowScan:
    """Publish the analysed frames or not."""

    on: bool


@dataclass(frozen=True)
class Targets:
    """Look for these from now on."""

    how: str  # "set", "add" or "remove"
    markers: tuple[int, ...]


@dataclass(frozen=True)
class Routine:
    """Visit these places in a scan; None: all, on the shortest way."""

    places: tuple[str, ...] | None


@dataclass(frozen=True)
class Options:
    """Change how the picture is delivered."""

    request: SetPicture


@dataclass(frozen=True)
class Broadcast:
    """Switch a stream; None leaves as it is."""

    rtsp: bool | None = None
    mjpeg: bool | None = None


@dataclass(frozen=True)
class Restart:
    """Reboot the camera."""


@dataclass(frozen=True)
class Calibrate:
    """Learn the motors: turn with every speed."""


Calibration = Calibrate | CalibrateLens | CalibrateMount | CalibrateZoom
Motor = GotoPlace | LookAt | MoveBy | ScanFor | Calibration
Itself = Options | VideoMode | HideLens | RecordSound | PlaySound | Broadcast | Restart | TakeLens  # all but its motors
Command = Motor | Halt | EndScan | SavePlace | RemovePlace | ShowScan | Targets | Routine | Itself


def read(key: str, value: Any) -> Command:
    """The command; Refused when it is none."""
    known = KEYS.get(key.lower())
    if known is None:
        raise Refused(f"no order {key[:40]!r}; there are {', '.join(sorted(name for name, _ in KEYS.values()))}")
    _, reader = known
    try:
        return reader(value)
    except ValueError as error:
        raise Refused(str(error)) from error


def canonical(key: str) -> str:
    """The key as the contract writes it, as far as it is known."""
    known = KEYS.get(key.lower())
    return known[0] if known else key


def wins(new: Who, running: Who) -> bool:
    """Whether a new order takes the motors from the one that has them."""
    return RANKS[new] >= RANKS[running]


def holder(by: Who, command: Command) -> Who:
    """As whose the motors count while a command runs: a scan gives way to everybody."""
    return "scan" if isinstance(command, ScanFor) else by


def _text(value: Any) -> str:
    if isinstance(value, dict | list):
        raise ValueError(f"expected a text, got {str(value)[:80]!r}")
    return str(value).strip()


def _flag(value: Any) -> bool:
    text = _text(value).lower()
    if text not in YES + NO:
        raise ValueError(f"expected True or False, ON or OFF, 1 or 0, got {text[:80]!r}")
    return text in YES


def _names(value: Any) -> tuple[str, ...]:
    parts = value if isinstance(value, list) else [part for part in _text(value).split(",") if part.strip()]
    if not parts:
        raise ValueError("expected at least one place")
    return tuple(name_of(str(part)) for part in parts)


def _markers(value: Any) -> tuple[int, ...]:
    parts = value if isinstance(value, list) else _text(value).split(",")
    markers = tuple(int(part) for part in map(str, parts) if part.strip().isascii() and part.strip().isdigit())
    if len(markers) != len(parts) or not all(marker <= 9999 for marker in markers):
        raise ValueError(f"expected marker ids such as 582, got {str(value)[:80]!r}")
    return tuple(dict.fromkeys(markers))


def _move(value: Any) -> Command:
    words = _text(value).split()
    direction = words[0].lower().replace("_", "").replace("-", "") if words else ""
    if direction == "stop" and len(words) == 1:
        return Halt()
    if direction not in DIRECTIONS or len(words) > 3:
        raise ValueError(
            f"expected Stop, or {', '.join(map(''.join, TURNS))} with speed and seconds, got {_text(value)[:80]!r}"
        )
    speed, seconds = [*words[1:], "4", "1"][0], words[2] if len(words) > 2 else "1"
    return MoveBy(DIRECTIONS[direction], _speed(speed), _seconds(seconds))


def _speed(text: str) -> int:
    if text not in "12345678" or len(text) != 1:
        raise ValueError(f"expected a speed from 1 to 8, got {text[:80]!r}")
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = float("nan")
    if not 0 < seconds <= LONGEST_S:
        raise ValueError(f"expected seconds from 0 to {LONGEST_S:g}, got {text[:80]!r}")
    return seconds


def _zoom(value: Any) -> Command:
    word = _text(value).lower()
    if word in ("in", "out"):
        return MoveBy(Direction.ZOOM_IN if word == "in" else Direction.ZOOM_OUT, 1, 1.0)
    try:
        return LookAt(zoom=float(word))
    except ValueError as error:
        raise ValueError(f"expected In, Out or a level from 0 to 8, got {word[:80]!r}") from error


def _scan(value: Any) -> Command:
    if not isinstance(value, dict):
        return ScanFor() if _flag(value) else EndScan()
    if unknown := set(value) - {"targets", "places", "full", "frames"}:
        raise ValueError(f"expected targets, places, full, frames, got {', '.join(sorted(map(str, unknown)))[:80]!r}")
    if (frames := value.get("frames")) not in (None, *range(1, 51)):
        raise ValueError(f"expected 1 to 50 frames, got {str(frames)[:80]!r}")
    told: dict[str, Any] = {
        k: read(value[k])
        for k, read in (("targets", _markers), ("places", _names))
        if value.get(k) not in (None, [], "")
    }
    return ScanFor(**told, full=_flag(value.get("full", "off")), frames=frames)


def _routine(value: Any) -> Command:
    return Routine(None if isinstance(value, str) and value.strip().lower() == "auto" else _names(value))


def _calibrate(value: Any) -> Command:
    if not _flag(value):
        raise ValueError("expected True; Move Stop ends it")
    return Calibrate()


def _restart(value: Any) -> Command:
    if not _flag(value):
        raise ValueError("expected True: a reboot cannot be taken back")
    return Restart()


READERS: dict[str, Callable[[Any], Command]] = {
    "Goto": lambda value: GotoPlace(name_of(_text(value))),
    "SaveAs": lambda value: SavePlace(name_of(_text(value))),
    "Remove": lambda value: RemovePlace(name_of(_text(value))),
    "Move": _move,
    "Zoom": _zoom,
    "Scan": _scan,
    "ScanImgPub": lambda value: ShowScan(_flag(value)),
    "SetTarget": lambda value: Targets("set", _markers(value)),
    "AddTarget": lambda value: Targets("add", _markers(value)),
    "RemoveTarget": lambda value: Targets("remove", _markers(value)),
    "SetRoutine": _routine,
    "RTSP": lambda value: Broadcast(rtsp=_flag(value)),
    "MJPEG": lambda value: Broadcast(mjpeg=_flag(value)),
    "Mirror": lambda value: Options(SetPicture(mirror=_flag(value))),
    "Flip": lambda value: Options(SetPicture(flip=_flag(value))),
    "VideoMode": lambda value: VideoMode.read(_text(value)),
    "Privacy": lambda value: HideLens(_flag(value)),
    "AudioRec": lambda value: RecordSound.read(_text(value)),
    "AudioPlay": lambda value: PlaySound.read(_text(value)),
    "Reboot": _restart,
    "CalibratePtz": _calibrate,
    "CalibrateLens": CalibrateLens.read,
    "CalibrateMount": CalibrateMount.read,
    "CalibrateZoom": CalibrateZoom.read,
    "SetCameraInfo": TakeLens.read,
}
KEYS = {name.lower(): (name, reader) for name, reader in READERS.items()}


def changed(targets: Iterable[int], order: Targets) -> tuple[int, ...]:
    """The targets after such an order."""
    if order.how == "set":
        return order.markers
    if order.how == "add":
        return tuple(dict.fromkeys((*targets, *order.markers)))
    return tuple(marker for marker in targets if marker not in order.markers)


def prolongs(new: Command, running: Command) -> bool:
    """Whether a Move is the one that runs already, given again."""
    if not isinstance(new, MoveBy) or not isinstance(running, MoveBy):
        return False
    return (new.direction, new.speed) == (running.direction, running.speed)
