"""Pictures as ROS's messages want them: JPEG to pixels, the size of a JPEG, and the lens as CameraInfo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.bridge.rules import Fields
from services.errors import BadMessage
from services.vision.lens import Lens
from services.vision.zoom import WIDEST, Level, at_level

SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # segments of a JPEG that begin with its size (SOF)
ZOOMED = 0.01  # a zoom level above this shows another part than the lens was calibrated with
VIEWS = 100  # sizes and zooms whose lens is remembered


def one_thread() -> None:
    """For OpenCV: a picture is decoded in one anyway, and the machine has other things to do."""
    cv2.setNumThreads(1)


def pixels(jpeg: bytes) -> NDArray[np.uint8]:
    """BGR (h, w, 3) of a JPEG or PNG; BadMessage when the data make no picture."""
    try:
        found = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR) if jpeg else None
    except cv2.error as error:  # it says that it has thousands of millions of pixels
        raise BadMessage(f"expected a JPEG: {error.err}") from error
    if found is None:
        raise BadMessage("expected a JPEG")
    return np.asarray(found, np.uint8)


def image(jpeg: bytes, header: Fields) -> Fields:
    """A sensor_msgs/Image, bgr8; BadMessage when the data make no picture."""
    decoded = pixels(jpeg)
    height, width = decoded.shape[:2]
    return {
        "header": header, "height": height, "width": width, "encoding": "bgr8", "is_bigendian": 0, "step": 3 * width,
        "data": decoded.tobytes(),
    }  # fmt: skip


def size(jpeg: bytes) -> tuple[int, int]:
    """Width and height, read from the file's segments without decoding it; BadMessage when it is no JPEG."""
    at = 2
    while jpeg[:2] == b"\xff\xd8" and at + 9 <= len(jpeg) and jpeg[at] == 0xFF:
        if jpeg[at + 1] in SIZES:
            return int.from_bytes(jpeg[at + 7 : at + 9], "big"), int.from_bytes(jpeg[at + 5 : at + 7], "big")
        at += 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
    raise BadMessage("expected a JPEG")


class Intrinsics:
    """The lens of one camera, from what camera_calibration writes; scaled and zoomed as the pictures that come."""

    def __init__(self, content: Mapping[str, Any] | None, levels: Sequence[Level] = ()) -> None:
        """ValueError when it is no calibration; None: there is none. `levels`: the calibrated zoom."""
        self._content, self._levels = content, levels
        self._lens = None if content is None else Lens.from_camera_info(content)
        self._scaled = lru_cache(VIEWS)(self._at)

    def info(self, width: int, height: int, zoom: float, header: Fields) -> Fields:
        """A sensor_msgs/CameraInfo. As ROS has it, an uncalibrated one is all zeros: without a calibration, for a
        picture of another shape, and at a zoom of which is not known how much it magnifies."""
        return {"header": header, "width": width, "height": height, **self._scaled(width, height, zoom)}

    def _at(self, width: int, height: int, zoom: float) -> Fields:
        magnification = WIDEST if zoom <= ZOOMED else at_level(self._levels, zoom)
        if self._lens is None or self._content is None or magnification is None:
            return {}
        try:
            lens = magnification.through(self._lens.scaled(width, height))
        except ValueError:
            return {}
        matrix = [float(number) for number in lens.matrix.ravel()]
        return {
            "distortion_model": str(self._content.get("distortion_model", "plumb_bob")),
            "D": [float(number) for number in lens.distortion],
            "K": matrix,
            "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            "P": [*matrix[:3], 0.0, *matrix[3:6], 0.0, *matrix[6:], 0.0],
        }
