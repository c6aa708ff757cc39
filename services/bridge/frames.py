"""The tree of frames as fields of TF messages: apartment, cameras, markers; and the cameras' joints. Pure.

    map -> apartment -> <cam>_base -> <cam> (moving) -> <cam>_optical_frame
                     -> aruco_<id>

`<cam>` is at the lens, x along the optical axis, y left, z up in the upright picture; the optical frame is that of
the pictures, z forward, x right, y down. Markers hang on the apartment: the camera that saw them moves on.
"""

from __future__ import annotations

from math import radians

import numpy as np

from services.bridge.rules import Fields
from services.payloads import Position, ScanResult, seconds
from services.vision.frames import Mount, Transform, base_in_apartment, camera_in_base, quaternion, rotation_z

MAP, APARTMENT = "map", "apartment"
OPTICAL_IN_BODY = Transform(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.zeros(3))


def apartment_in_map(x: float, y: float, yaw_deg: float, stamp: float) -> Fields:
    """Where the apartment's origin is on the robot's map: metres, degrees counter-clockwise."""
    return _said(MAP, APARTMENT, Transform(rotation_z(yaw_deg), np.array([x, y, 0.0])), stamp)


def fixed(cam: str, mount: Mount, stamp: float) -> list[Fields]:
    """The frames of a camera that do not move."""
    return [
        _said(APARTMENT, f"{cam}_base", base_in_apartment(mount), stamp),
        _said(cam, f"{cam}_optical_frame", OPTICAL_IN_BODY, stamp),
    ]


def moving(cam: str, mount: Mount, position: Position, stamp: float) -> Fields:
    """The camera in its base, as its motors stand."""
    lens = camera_in_base(mount, position.pan, position.tilt)
    return _said(f"{cam}_base", cam, lens @ OPTICAL_IN_BODY.inverse(), stamp)


def marker(seen: ScanResult) -> Fields | None:
    """A marker in the apartment; None when it is not known where it is or how it stands."""
    likely = max(seen.orientations, key=lambda one: one.weight, default=None)
    turned = seen.orientation or likely
    if seen.position is None or turned is None:
        return None
    return {
        "header": {"stamp": seconds(seen.stamp), "frame_id": seen.frame},
        "child_frame_id": f"aruco_{seen.marker}",
        "transform": {
            "translation": {"x": seen.position.x, "y": seen.position.y, "z": seen.position.z},
            "rotation": {"x": turned.x, "y": turned.y, "z": turned.z, "w": turned.w},
        },
    }


def joints(cam: str, position: Position, stamp: float) -> Fields:
    """A JointState: pan and tilt in radians."""
    return {
        "header": {"stamp": stamp, "frame_id": f"{cam}_base"},
        "name": [f"{cam}_pan", f"{cam}_tilt"],
        "position": [radians(position.pan), radians(position.tilt)],
    }


def _said(parent: str, child: str, where: Transform, stamp: float) -> Fields:
    x, y, z, w = quaternion(where.rotation)
    at = [float(part) for part in where.translation]
    return {
        "header": {"stamp": stamp, "frame_id": parent},
        "child_frame_id": child,
        "transform": {
            "translation": {"x": at[0], "y": at[1], "z": at[2]},
            "rotation": {"x": x, "y": y, "z": z, "w": w},
        },
    }
