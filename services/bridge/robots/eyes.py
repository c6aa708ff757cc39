"""What a robot's camera sees: markers in its pictures by our own detector, or as aruco_detect of ROS tells them.

Places are in the robot's map frame, in metres, where the camera's pose and lens are known. Not here: from where
pictures and frames come (`senses.py`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from services.bridge import images
from services.bridge.robots import chain
from services.bridge.rules import Fields
from services.errors import BadMessage
from services.payloads import Point
from services.payloads.robot import SeenMarker
from services.vision.detect import Detection, Picture, detect
from services.vision.frames import Array, Transform
from services.vision.lens import Lens
from services.vision.pose import View, locate

MOST = 1e9  # of a lens; what is larger overflows
PIXELS = {"bgr8": 3, "rgb8": 3, "8UC3": 3, "bgra8": 4, "rgba8": 4, "mono8": 1, "8UC1": 1}  # bytes, by encoding


def picture(fields: Fields) -> Picture:
    """The pixels of a sensor_msgs/Image or CompressedImage, grey or in three colours; BadMessage for another kind."""
    if "encoding" not in fields:
        return images.pixels(fields["data"])
    encoding = str(fields["encoding"])
    if encoding not in PIXELS:
        raise BadMessage(f"expected an encoding of {', '.join(PIXELS)}, got {encoding!r:.80}")
    height, width, step, size = int(fields["height"]), int(fields["width"]), int(fields["step"]), PIXELS[encoding]
    data = np.frombuffer(fields["data"], np.uint8)
    if data.size != height * step or step < width * size or not width * height:
        raise BadMessage(f"expected {height} rows of {step} bytes, {width} pixels in each, got {data.size} bytes")
    rows = data.reshape(height, step)[:, : width * size].reshape(height, width, size)
    if size == 1:
        return np.ascontiguousarray(rows[..., 0])
    return np.ascontiguousarray(rows[..., 2::-1] if encoding.startswith("rgb") else rows[..., :3])


def lens(info: Fields) -> Lens | None:
    """Of a sensor_msgs/CameraInfo; None for a camera that is not calibrated (all zeros, as ROS has it), or to NaN."""
    matrix = np.array([float(number) for number in info["K"]]).reshape(3, 3)
    bends = [float(number) for number in info["D"]]
    if matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or len(bends) > 8 or not (np.abs([*matrix.flat, *bends]) <= MOST).all():
        return None
    bends += [0.0] * ((8 if len(bends) > 5 else 5) - len(bends))
    return Lens(int(info["width"]), int(info["height"]), matrix, np.array(bends))


def look(
    pixels: Picture,
    dictionary: str,
    seen_by: Lens | None,
    camera: Transform | None,
    sizes: Mapping[int, float],
    size: float,
) -> list[SeenMarker]:
    """The markers of the dictionary in a picture; `camera` in the map, `sizes` of markers that are not of `size`, m."""
    return [
        _placed(one, seen_by, camera, sizes.get(one.marker, size)) for one in detect(pixels, dictionary, None)
    ]  # fmt: skip


def _placed(one: Detection, seen_by: Lens | None, camera: Transform | None, size: float) -> SeenMarker:
    if seen_by is None or camera is None or not one.whole(seen_by.width, seen_by.height):
        return SeenMarker(marker=one.marker)
    try:
        found = locate([View(seen_by, camera, one.corners, size, sides=one.sides)])
    except ValueError:  # corners that no square explains: it is there, but not where
        return SeenMarker(marker=one.marker)
    return SeenMarker(marker=one.marker, position=_point(found.position), distance=round(found.distance, 3))


def told(fields: Fields, camera: Transform | None) -> list[SeenMarker]:
    """The markers of a fiducial_msgs/FiducialTransformArray: markers in the camera; BadMessage when it is none."""
    try:
        found = [(int(one["fiducial_id"]), chain.transform(one["transform"])) for one in fields["transforms"]]
    except (KeyError, TypeError, ValueError) as error:
        raise BadMessage(f"expected a fiducial_msgs/FiducialTransformArray, without {error}") from error
    return [
        SeenMarker(
            marker=marker,
            position=None if camera is None else _point(camera.apply(there.translation)),
            distance=round(float(np.linalg.norm(there.translation)), 3),
        )
        for marker, there in found
    ]


def _point(at: Array) -> Point:
    x, y, z = (round(float(part), 3) for part in at)
    return Point(x=x, y=y, z=z)
