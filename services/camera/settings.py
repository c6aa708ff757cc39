"""A camera's section of the configuration (`cameras.<cam>`): what can be set, and its defaults."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Literal
from zoneinfo import available_timezones

from pydantic import Field, SecretStr, ValidationInfo, field_validator, model_validator

from services.camera import parameters
from services.camera.address import Address
from services.camera.ptz.goal import Limits
from services.camera.video.settings import SnapshotSettings, StreamSettings
from services.section import Section
from services.vision.frames import Mount
from services.vision.prior import Faces, Prior

Pair = tuple[float, float]
LOW = {"diagnostics": False, "alarm": False, "frames": 1}  # for a small computer, as the report ran its Raspberry Pi


class MarkerSizes(Section):
    """Side of the black square in metres, how it faces, and where some are: of every marker, and by id."""

    size: float = Field(default=0.14, gt=0.005, lt=2)
    sizes: dict[int, float] = {}
    faces: Faces | None = None  # "up": lies flat; "wall": hangs upright; None: anyhow
    facing: dict[int, Faces | None] = {}
    known: dict[int, tuple[float, float, float]] = {}  # centres that somebody measured (m, apartment), for the mount

    def of(self, marker: int) -> float:
        """The side of that marker, metres."""
        return self.sizes.get(marker, self.size)

    def prior(self, marker: int) -> Prior | None:
        """What is known of how that marker is turned."""
        faces = self.facing.get(marker, self.faces)
        return Prior(faces) if faces else None


class PictureOptions(Section):
    """How the camera is set to deliver its picture; what it says itself counts, where it says it."""

    flip: bool = True
    mirror: bool = True


class MotionSettings(Section):
    """What counts as motion, and for how long."""

    codes: tuple[str, ...] = ("VideoMotion",)  # the camera's words; SmartMotionHuman and others where it has them
    hold_s: float = Field(default=15.0, gt=0, le=600)
    heartbeat_s: Literal[1, 2, 3, 4] = 3  # silence of 3.25 of them has to be noticed within 15 s

    @field_validator("codes")
    @classmethod
    def are_names(cls, codes: tuple[str, ...]) -> tuple[str, ...]:
        for code in codes or ("",):  # All would be the clock and the memory card, too
            if code.lower() == "all" or re.fullmatch(r"\w+", code) is None:
                raise ValueError(f"expected names of what is motion, such as VideoMotion, got {code[:80]!r}")
        return codes


class ClockSettings(Section):
    """The camera's clock shows local time; its own time zone is an index that nobody can read."""

    set: bool = True  # when it is wrong by more than `drift_s`
    drift_s: float = Field(default=5.0, ge=2)
    every_s: float = Field(default=3600.0, ge=1)  # between two looks at it
    timezone: str | None = None  # such as Europe/Paris; None: this computer's

    @field_validator("timezone")
    @classmethod
    def is_a_zone(cls, name: str | None) -> str | None:
        if name is not None and name not in available_timezones():
            raise ValueError(f"expected a time zone such as Europe/Paris, got {name[:80]!r}")
        return name


class MountSettings(Section):
    """How the camera is fixed; frames and signs are those of `vision/frames.py`."""

    position: tuple[float, float, float]  # m, apartment: where the pan axis leaves the mounting plate
    kind: Literal["ceiling", "shelf"] = "ceiling"
    yaw_deg: float = 0.0  # azimuth of the optical axis at pan reading 0
    lean_deg: Pair = (0.0, 0.0)  # about the base's x, y
    pan_to_tilt_m: Pair = (0.0, 0.0)  # forward, along the pan axis away from the plate
    tilt_to_lens_m: Pair = (0.0, 0.0)  # along the optical axis, up in the picture
    sensor_roll_deg: float = 0.0
    tilt_zero_deg: float = 0.0  # the tilt reading at which the optical axis is level

    def mount(self) -> Mount:
        """The same for the formulas."""
        return Mount(**self.model_dump())


def _under(given: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """Both together; where both say something, `values` count."""
    parts = {
        key: _under(inner, values[key]) for key, inner in given.items()
        if isinstance(inner, dict) and isinstance(values.get(key), dict)
    }  # fmt: skip
    return {**given, **values, **parts}


class Config(Section):
    """One camera. `name`, `folder` and `state` are given by the program."""

    name: str = "ip1"
    folder: Path = Path()
    state: Path | None = None  # where what is learnt of the camera is kept; None: nowhere
    profile: Literal["full", "low"] = "full"  # "low": what is not given is as in LOW
    parameters: Path | None = None  # a ROS node's parameters.yaml: what is not given is as there
    brand: str = "amcrest"  # a module of `camera/brands/`
    url: str
    certificate: Path | None = None  # PEM: the camera's own, or its signer's; None: the system's authorities
    rtsp_port: int = Field(default=554, ge=1, le=65535)
    user: str = ""
    password: SecretStr = SecretStr("")
    login_retry_s: float = Field(default=120.0, ge=1)  # after a wrong password; doubles each time, up to 30 minutes
    channel: Literal[0, 1] | None = None  # of the motors; None: found out
    camera_info: Path | None = None  # of the upright picture at the widest zoom
    places: Path = Path("places")  # folder of the report's two files
    dictionary: str = "DICT_5X5_1000"
    markers: MarkerSizes = MarkerSizes()
    targets: tuple[int, ...] = ()
    diagnostics: bool = True  # say how it fares, once a second
    alarm: bool = True  # listen to the camera's own motion alarm
    motion: MotionSettings = MotionSettings()
    clock: ClockSettings = ClockSettings()
    audio: Path = Path("audio")  # folder of recordings, and of what can be played
    discovery: bool = False  # tell Home Assistant and openHAB what there is (`homeassistant/#`)
    picture: PictureOptions = PictureOptions()
    pan_dead_arc: Pair = (179.0, 186.0)  # readings that the camera cannot reach, degrees
    tilt_range: Pair = (-10.0, 108.0)
    zoom_range: Pair = (0.0, 8.0)
    mount: MountSettings | None = None
    mount_doubt: Pair = (0.0, 0.0)  # m and degrees, each axis, one standard deviation: as a calibration tells them
    reading_noise_deg: float = Field(default=0.05, ge=0, le=2)  # of pan and tilt, one standard deviation
    routine: tuple[str, ...] | None = None  # places that a scan visits, in order; None: all, on the shortest way
    frames: int = Field(default=4, ge=1, le=50)  # at each place of a scan
    settle_s: float | None = Field(
        default=None, ge=0, le=10
    )  # from rest to the first frame; None: as the picture shows
    stop_early: bool = True  # a scan ends when every target was seen where it shows best
    second_turn: Literal["missed", "always", "never"] = "missed"  # in black and white with high contrast
    move_timeout_s: float = Field(default=60.0, gt=1, le=600)
    stream: StreamSettings = StreamSettings()
    snapshot: SnapshotSettings = SnapshotSettings()
    scan_pictures: Literal["stream", "snapshot"] = "stream"  # what a scan looks at, where the camera has a stream
    hits: int = Field(default=100, ge=0, le=10000)  # pictures of what scans have seen that are kept; 0: none
    workers: int = Field(default=1, ge=1, le=8)  # processes that look for markers during a scan

    @model_validator(mode="before")
    @classmethod
    def others_give_what_is_not_said(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        if isinstance(values.get("parameters"), str | Path):
            values = _under(parameters.read(Path(values.get("folder", "")) / values["parameters"]), values)
        return {**LOW, **values} if values.get("profile") == "low" else values

    @field_validator("url")
    @classmethod
    def is_an_address(cls, text: str) -> str:
        if not text.startswith(("http://", "https://")) or "@" in text:
            raise ValueError(f"expected http://host or https://host without a password in it, got {text[:80]!r}")
        return text

    @field_validator("certificate")
    @classmethod
    def is_for_tls(cls, file: Path | None, info: ValidationInfo) -> Path | None:
        url = info.data.get("url", "")
        if file is not None and url.startswith("http://"):
            raise ValueError(f"expected an https:// address in url beside it, got {url[:80]!r}")
        return file

    @field_validator("brand")
    @classmethod
    def is_a_brand(cls, text: str) -> str:
        known = sorted(file.stem for file in (Path(__file__).parent / "brands").glob("[a-z]*.py"))
        if text not in known:
            raise ValueError(f"expected one of {', '.join(known)}, got {text!r}")
        return text

    @field_validator("pan_dead_arc", "tilt_range", "zoom_range")
    @classmethod
    def is_a_range(cls, pair: Pair) -> Pair:
        if pair[0] >= pair[1]:
            raise ValueError(f"expected [low, high], got {list(pair)}")
        return pair

    @property
    def address(self) -> Address:
        """What every brand is given."""
        return Address(
            self.url, self.user, self.password, self.rtsp_port, self.channel,
            self.pan_dead_arc, self.tilt_range, self.zoom_range,
            None if self.certificate is None else self.folder / self.certificate,
        )  # fmt: skip

    @property
    def limits(self) -> Limits:
        """Where this camera can look."""
        return Limits(self.pan_dead_arc, self.tilt_range, self.zoom_range)

    @property
    def kind(self) -> Literal["ceiling", "shelf"]:
        """How the camera is mounted."""
        return self.mount.kind if self.mount else "ceiling"
