"""What can be ordered about calibration, and how the orders' values are read. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Self, TypeVar

from pydantic import Field, ValidationError

from services.section import Section
from services.vision.board import Board
from services.vision.calibrate_lens import Model
from services.vision.lens import Lens

S = TypeVar("S", bound=Section)
XYZ = tuple[float, float, float]


class _Lens(Section):
    """The value of CalibrateLens."""

    board: Literal["charuco", "chessboard"] = "charuco"
    columns: int = 9
    rows: int = 6
    square_mm: float = 30.0
    marker_mm: float | None = None  # 70 % of a square
    dictionary: str = "DICT_4X4_50"
    model: Literal["auto", "plumb_bob", "rational_polynomial"] = "auto"
    seconds: float = Field(default=600.0, gt=0, le=3600)


class _Mount(Section):
    """The value of CalibrateMount: where markers are, by id; metres."""

    markers: dict[int, XYZ] = {}
    doubt_m: float = Field(default=0.01, gt=0.0005, lt=0.5)


class _Info(Section):
    """The value of SetCameraInfo: the fields of sensor_msgs/CameraInfo that tell the lens."""

    width: int = Field(gt=0)
    height: int = Field(gt=0)
    distortion_model: str = "plumb_bob"
    D: list[float]
    K: list[float]
    R: list[float] | None = None
    P: list[float] | None = None


@dataclass(frozen=True)
class CalibrateLens:
    """Learn the lens from a board that somebody shows; at most so many seconds."""

    board: Board
    model: Model | Literal["auto"]
    seconds: float

    @classmethod
    def read(cls, value: Any) -> Self:
        """The order's value: True, or an object with what differs. ValueError when it is neither."""
        wanted = _read(_Lens, value)
        marker_mm = 0.7 * wanted.square_mm if wanted.marker_mm is None else wanted.marker_mm
        board = Board(
            wanted.board, wanted.columns, wanted.rows, wanted.square_mm / 1000, marker_mm / 1000, wanted.dictionary
        )
        return cls(board, wanted.model, wanted.seconds)


@dataclass(frozen=True)
class CalibrateMount:
    """Learn how the camera hangs from markers; those of the order besides those of the configuration."""

    markers: tuple[tuple[int, XYZ], ...]
    doubt_m: float

    @classmethod
    def read(cls, value: Any) -> Self:
        """The order's value: True, or an object with markers. ValueError when it is neither."""
        wanted = _read(_Mount, value)
        return cls(tuple(wanted.markers.items()), wanted.doubt_m)


@dataclass(frozen=True)
class CalibrateZoom:
    """Learn what each level of zoom magnifies by, from what the camera looks at."""

    @classmethod
    def read(cls, value: Any) -> Self:
        """The order's value: True. ValueError when it is something else."""
        _read(Section, value)
        return cls()


@dataclass(frozen=True, eq=False)
class TakeLens:
    """Take over a lens that somebody else has calibrated, such as ROS's camera_calibration."""

    lens: Lens

    @classmethod
    def read(cls, value: Any) -> Self:
        """The order's value, an object as sensor_msgs/CameraInfo. ValueError when it is none."""
        if not isinstance(value, dict):
            raise ValueError(f"expected width, height, distortion_model, D and K, got {str(value)[:80]!r}")
        info = _read(_Info, value)
        distortion = [*info.D, 0.0] if info.distortion_model == "plumb_bob" and len(info.D) == 4 else info.D
        content = {
            "image_width": info.width,
            "image_height": info.height,
            "distortion_model": info.distortion_model,
            "camera_matrix": {"data": info.K},
            "distortion_coefficients": {"data": distortion},
        }
        return cls(Lens.from_camera_info(content))


def _read(kind: type[S], value: Any) -> S:
    if not isinstance(value, dict):
        if str(value).strip().lower() not in ("true", "on", "1"):
            raise ValueError(f"expected True, or an object with {', '.join(kind.model_fields)}; Move Stop ends it")
        value = {}
    try:
        return kind.model_validate(value)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        where = ".".join(map(str, fault["loc"]))
        raise ValueError(f"{where}: {fault['msg']}, got {str(fault['input'])[:80]!r}") from error
