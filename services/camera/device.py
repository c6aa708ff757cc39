"""What can be asked of any camera, and what it answers: values without a brand, a socket or a clock.

The requests become a brand's own words in `brands/`; who may send them, and in which order, is `lanes.py`.

    DeviceError
    ├── Refused     the camera answered, and said no
    ├── BadLogin    the camera does not know this user and password
    │   └── Locked  too many wrong passwords: the account is closed for a while
    └── Away        no answer, or one that makes no sense
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Literal, Protocol

from services.errors import DeviceError

Mode = Literal["color", "bw", "auto"]


class Refused(DeviceError):
    """The camera answered, and said no."""


class BadLogin(DeviceError):
    """The camera does not know this user and password; nobody tries again for `again_s`."""

    def __init__(self, text: str, again_s: float = 120.0) -> None:
        super().__init__(text)
        self.again_s = again_s


class Locked(BadLogin):
    """Too many wrong passwords: the account is closed for a while."""


class Away(DeviceError):
    """No answer in time (`turned_away`: nobody serves at its address), or a fault or nonsense (`answered`)."""

    def __init__(self, text: str, *, answered: bool = False) -> None:
        super().__init__(text)
        self.answered, self.turned_away = answered, False


class Rank(IntEnum):
    """What goes first when several requests wait; pictures have a lane of their own, and tell nothing of its health."""

    STOP = 0
    MOVE = 1
    STATUS = 2
    CONFIG = 3
    PICTURE = 4


class Direction(Enum):
    """Where a camera can be told to turn, as its picture shows it: (right, down, in) each -1, 0 or 1."""

    LEFT = (-1, 0, 0)
    RIGHT = (1, 0, 0)
    UP = (0, -1, 0)
    DOWN = (0, 1, 0)
    LEFT_UP = (-1, -1, 0)
    RIGHT_UP = (1, -1, 0)
    LEFT_DOWN = (-1, 1, 0)
    RIGHT_DOWN = (1, 1, 0)
    ZOOM_IN = (0, 0, 1)
    ZOOM_OUT = (0, 0, -1)


@dataclass(frozen=True)
class Start:
    """Turn until Stop; speeds 1 to 8, `tilt_speed` for the vertical part of a diagonal (None: the same)."""

    direction: Direction
    speed: int = 1
    tilt_speed: int | None = None
    rank = Rank.MOVE


@dataclass(frozen=True)
class TurnFor:
    """Turn for some seconds and end by itself; percent of the top speed, -100 to 100. Newer firmware only."""

    right: int
    down: int
    zoom: int
    seconds: float
    rank = Rank.MOVE


@dataclass(frozen=True)
class MoveTo:
    """Let the firmware drive to readings. `form`: it has one of two ways to say that, or none."""

    pan: float
    tilt: float
    zoom: float
    form: Literal["PositionABS", "moveAbsolutely"] = "PositionABS"
    rank = Rank.MOVE


@dataclass(frozen=True)
class MoveOver:
    """Let the firmware drive on by parts of its whole scale, -1 to 1 (that is learnt), and by levels of zoom."""

    right: float
    down: float
    zoom: float = 0.0
    form: Literal["Position", "moveRelatively"] = "Position"
    rank = Rank.MOVE


@dataclass(frozen=True)
class Stop:
    """End all motion. `every`: whatever may be running, also what somebody else started; `direction`: this one."""

    every: bool = False
    direction: Direction | None = None
    rank = Rank.STOP


@dataclass(frozen=True)
class Status:
    """Where it looks; the answer is a Reading."""

    rank = Rank.STATUS


@dataclass(frozen=True)
class GotoPreset:
    """Let the camera's firmware drive to one of its presets."""

    number: int
    rank = Rank.MOVE


@dataclass(frozen=True)
class SavePreset:
    """Keep the present pose as a preset of the camera."""

    number: int
    rank = Rank.CONFIG


@dataclass(frozen=True)
class ClearPreset:
    """Forget a preset of the camera."""

    number: int
    rank = Rank.CONFIG


@dataclass(frozen=True)
class Snapshot:
    """A full-size picture; the answer is the bytes of a JPEG."""

    rank = Rank.PICTURE


@dataclass(frozen=True)
class GetPicture:
    """How the picture is delivered; the answer is a Picture."""

    rank = Rank.CONFIG


@dataclass(frozen=True)
class SetPicture:
    """Changes how the picture is delivered; None leaves as it is. The answer is the Picture read back.

    `mode` is for all profiles, `modes` are those of each, and so is `contrast` (0 to 100), which is not in the answer.
    """

    flip: bool | None = None
    mirror: bool | None = None
    mode: Mode | None = None
    modes: tuple[str, ...] = ()
    contrast: tuple[int, ...] = ()
    rank = Rank.CONFIG


@dataclass(frozen=True)
class FindStream:
    """Where the moving picture is; the answer is a StreamAddress, or None when the camera has none."""

    source: Literal["main", "sub"]
    rank = Rank.CONFIG


@dataclass(frozen=True)
class Identify:
    """Who are you; the answer is an Identity."""

    rank = Rank.CONFIG


@dataclass(frozen=True)
class Reboot:
    """Start again."""

    rank = Rank.CONFIG


class Errand:
    """Base of the requests about the device itself (`errands.py`); a brand may refuse any of them."""

    rank = Rank.CONFIG


Request = (
    Start
    | TurnFor
    | MoveTo
    | MoveOver
    | Stop
    | Status
    | GotoPreset
    | SavePreset
    | ClearPreset
    | Snapshot
    | GetPicture
    | SetPicture
    | FindStream
    | Identify
    | Reboot
    | Errand
)


@dataclass(frozen=True)
class Reading:
    """Pan and tilt in degrees and zoom in levels, as the camera tells them. `moving` None: it does not say."""

    pan: float
    tilt: float
    zoom: float
    moving: bool | None = None


@dataclass(frozen=True)
class Picture:
    """How the picture is delivered; `mode` by day, `modes` in each profile where the camera tells them apart."""

    flip: bool
    mirror: bool
    mode: Mode
    modes: tuple[str, ...] = ()  # day, night, general: our word, or the camera's where we have none; "" untold


@dataclass(frozen=True)
class Identity:
    """Which camera this is. `remembers`: whether it knew our login after it had been away; None: nothing tells."""

    model: str
    serial: str
    version: str
    remembers: bool | None = field(default=None, compare=False)


@dataclass(frozen=True)
class StreamAddress:
    """Addresses of a camera's moving picture, never with a password in them; `mjpeg` is a path of its HTTP server."""

    rtsp: str | None
    mjpeg: str | None = None


@dataclass(frozen=True)
class Event:
    """Something that the camera noticed by itself: `action` Start, Stop, Pulse or State; no code: it is alive."""

    code: str
    action: str
    index: int = 0


@dataclass(frozen=True)
class Reply:
    """What became of a request: `result`, or the `error`; `sent` and `received` in seconds since 1970."""

    request: Request
    ticket: int
    result: object
    error: DeviceError | None
    sent: float
    received: float


class Camera(Protocol):
    """What a brand offers: one request at a time, from one thread."""

    def send(self, request: Request) -> object:
        """Sends and waits for the answer; DeviceError when there is none or it is no."""
        ...

    def close(self) -> None:
        """Ends the connection."""
        ...
