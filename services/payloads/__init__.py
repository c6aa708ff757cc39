"""The payloads that travel as JSON: one frozen model each. Which topic carries which is in `topics/`.

Times are ISO 8601 in UTC with milliseconds and `Z`; angles are degrees as the camera reads them; lengths metres.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, RootModel, field_validator, model_validator

OrderState = Literal["accepted", "running", "done", "failed", "refused", "cancelled"]
FINAL: tuple[OrderState, ...] = ("done", "failed", "refused", "cancelled")  # an order has one of them once
Who = Literal["human", "mission", "scan"]
LONGEST_ID = 64  # of an order
RTSP_PICTURE = "rtsp.mjpg"  # see `Stream`
LARGEST = 1e300  # so that whoever takes a number may make a float of it


def stamp(seconds: float) -> str:
    """Seconds since 1970 as the text that our payloads carry, `2026-01-31T07:05:00.123Z`."""
    text = datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")
    return text.replace("+00:00", "Z")


def seconds(text: str) -> float:
    """The reverse of `stamp`; any ISO 8601 text with an offset. ValueError when it is not one, or none for `stamp`."""
    when = datetime.fromisoformat(text)
    if when.tzinfo is None:
        raise ValueError(f"expected a time with an offset, such as Z, got {text!r}")
    stamp(when.timestamp())  # the first and the last hours of all years are those of others in UTC
    return when.timestamp()


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_finite(part) for part in value]
    if isinstance(value, (int, float)) and not -LARGEST <= value <= LARGEST:
        raise ValueError("expected finite numbers")
    return value


Free = Annotated[
    Any, AfterValidator(_finite)
]  # whatever JSON can say; pydantic's parser lets NaN and 1e999 into an Any


Real = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]  # a quantity; what comes back in an answer is `Free`


Three = Field(min_length=3, max_length=3)
Axis = Annotated[list[Real], Three]  # one line of a covariance


class Payload(BaseModel):
    """The base of all: frozen, and a key that nobody knows is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ServiceInfo(Payload):
    """`service/<service>/info`: what runs, since when, and what it has counted."""

    version: str
    started: str
    counters: dict[str, float] = {}
    aside: list[str] = []  # files of messages that crashed the service twice


class Diagnostic(Payload):
    """`diagnostics/<component>`: levels as in diagnostic_msgs/DiagnosticStatus, 0 OK, 1 WARN, 2 ERROR, 3 STALE."""

    level: int = Field(ge=0, le=3)
    message: str
    values: dict[str, str] = {}
    hardware_id: str = ""


class CameraStatus(Payload):
    """`camera/<cam>/status`."""

    state: Literal["online", "offline", "bad_login", "locked", "rebooting", "degraded"]
    reason: str = ""


class Order(Payload):
    """`camera/<cam>/order/<Key>`: the value, and whose order it is; plain text is a human's.

    A JSON object without a `value` is itself the value (`{"targets": [582]}` for Scan).
    """

    value: Free = ""
    id: str | None = Field(default=None, max_length=LONGEST_ID)
    by: Who = "human"

    @model_validator(mode="before")
    @classmethod
    def bare_object_is_the_value(cls, data: Any) -> Any:
        if isinstance(data, dict) and "value" not in data:
            return {"value": data}
        return data


class Position(Payload):
    """`camera/<cam>/position`: readings in degrees, zoom as a level; `place` when one is under the lens.

    `place_name` is the same as a text that may be empty, for those who drop what is null, as OpenHAB does.
    """

    pan: Real
    tilt: Real
    zoom: Real
    moving: bool = False
    place: str | None = None
    place_name: str = ""


class PositionSet(Payload):
    """`camera/<cam>/position/set`: what is left out stays."""

    pan: Real | None = None
    tilt: Real | None = None
    zoom: Real | None = None
    id: str | None = Field(default=None, max_length=LONGEST_ID)
    by: Who = "human"

    @model_validator(mode="after")
    def names_an_axis(self) -> Self:
        if self.pan is None and self.tilt is None and self.zoom is None:
            raise ValueError("expected at least one of pan, tilt, zoom")
        return self


class OrderResult(Payload):
    """`camera/<cam>/order_result`: one step in the life of an order."""

    id: str
    key: str
    value: Free
    state: OrderState
    error: str | None = None
    position: Position | None = None
    clamped: bool = False

    @property
    def final(self) -> bool:
        """Whether this is the order's end."""
        return self.state in FINAL


class Place(Payload):
    """One named place: readings, and the camera's own preset where it has one."""

    pan: Real
    tilt: Real
    zoom: Real = 0.0
    preset: int | None = None


class Places(RootModel[dict[str, Place]]):
    """`camera/<cam>/places`."""

    model_config = ConfigDict(frozen=True)


class Motion(Payload):
    """`camera/<cam>/motion`: 1 for 15 s after motion, 0 otherwise, -1 when the alarm is in trouble.

    `seen`: whether it is 1, for a switch, which cannot be in trouble.
    """

    value: Literal[0, 1, -1]
    since: str
    seen: bool = False


class Audio(Payload):
    """`camera/<cam>/audio`: a recording is done; `file` is its name in the audio folder."""

    file: str
    seconds: Real
    bytes: int


class ScanState(Payload):
    """`camera/<cam>/scan/state`: `progress` goes from 0 to 1; `running` is the state as a switch shows it."""

    state: Literal["idle", "running", "done", "cancelled", "failed"]
    running: bool = False
    scan: str | None = None
    targets: list[int] = []
    found: list[int] = []
    turn: int = 0
    place: str | None = None
    progress: float = Field(default=0.0, ge=0.0, le=1.0)
    frames_taken: int = 0
    frames_analysed: int = 0
    elapsed_s: Real = 0.0
    reason: str = ""


class Point(Payload):
    """Metres, in the frame that the message names."""

    x: Real
    y: Real
    z: Real


class Quaternion(Payload):
    """A unit quaternion."""

    x: Real
    y: Real
    z: Real
    w: Real


class WeightedQuaternion(Quaternion):
    """One of several orientations that are possible; the weights of one list add up to 1."""

    weight: Real


class ScanResult(Payload):
    """`camera/<cam>/scan/result`: one marker, where it is in the apartment, and how sure that is."""

    camera: str
    marker: int
    dictionary: str
    place: str
    position: Point | None
    why: str | None = None
    covariance: Annotated[list[Axis], Three] | None = None  # x, y, z
    orientation: Quaternion | None = None
    orientations: list[WeightedQuaternion] = []
    frame: str = "apartment"
    distance: Real | None = None
    zoom: Real = 0.0
    frames: int = Field(default=1, ge=0)
    mode: str = "color"
    first_seen: str
    stamp: str
    scan: str

    @field_validator("first_seen", "stamp")
    @classmethod
    def is_a_time(cls, text: str) -> str:
        seconds(text)
        return text


class Calibration(Payload):
    """`camera/<cam>/calibration`: how far it is, what to show next, and at its end what came out.

    `regions`: whether the board was shown there, rows from the top. `values`: each number with its standard deviation,
    of a zoom the focal length of each level in pixels; of a mount also `mount`, as the configuration writes it.
    `report` is a page with pictures, where the service runs.
    """

    what: Literal["lens", "mount", "zoom"]
    state: Literal["running", "done", "failed", "cancelled"]
    progress: float = Field(default=0.0, ge=0.0, le=1.0)
    views: int = 0
    said: str = ""
    regions: list[list[bool]] = []
    values: dict[str, tuple[Real, Real]] = {}
    mount: dict[str, Free] | None = None
    file: str | None = None
    report: str | None = None


class Stream(Payload):
    """`camera/<cam>/stream`: which streams are on, and where the picture can be had without a password.

    At `url` while `mjpeg` is on; for ROS and the dashboard, while `rtsp` is on, at RTSP_PICTURE beside it.
    """

    rtsp: bool
    mjpeg: bool
    url: str

    def beside(self, name: str) -> str:
        """The address of another picture of that camera; empty while there is none."""
        return f"{self.url.rpartition('/')[0]}/{name}" if self.url else ""
