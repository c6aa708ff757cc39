"""The camera's frames: from pan and tilt readings to where the lens is and where it looks.

Right-handed, metres; degrees at the edge, radians inside. Frames (`contract.md` sections 4 and 7):

* **apartment** A: z up.
* **base** B: origin where the pan axis leaves the mounting plate, z out of the plate (down from a ceiling, up
  from a shelf), x where the camera faces at pan reading 0.
* **head**: after pan and tilt; x along the optical axis. The mechanism is the same on ceiling and shelf: a
  growing pan reading turns by the right-hand rule about z of the base, a growing tilt reading turns the
  optical axis from level towards z of the base. From a ceiling that is clockwise seen from above, and down.
* **camera** C, as in OpenCV: x right and y down in the *upright* picture, z along the optical axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kind = Literal["ceiling", "shelf"]


@dataclass(frozen=True)
class Transform:
    """A rigid motion: `rotation` 3x3 and `translation` (3,) in metres; maps points of B to A for `T_AB`."""

    rotation: Array
    translation: Array

    def __matmul__(self, other: Transform) -> Transform:
        return Transform(self.rotation @ other.rotation, self.apply(other.translation))

    def apply(self, points: Array) -> Array:
        """Maps points of shape (3,) or (n, 3)."""
        return np.asarray(points, float) @ self.rotation.T + self.translation

    def inverse(self) -> Transform:
        """The motion that undoes this one."""
        return Transform(self.rotation.T, -self.rotation.T @ self.translation)


@dataclass(frozen=True)
class Mount:
    """How a camera is fixed; the fields and units are those of `cameras.<cam>.mount` in the configuration."""

    position: tuple[float, float, float]
    kind: Kind = "ceiling"
    yaw_deg: float = 0.0
    lean_deg: tuple[float, float] = (0.0, 0.0)
    pan_to_tilt_m: tuple[float, float] = (0.0, 0.0)
    tilt_to_lens_m: tuple[float, float] = (0.0, 0.0)
    sensor_roll_deg: float = 0.0
    tilt_zero_deg: float = 0.0  # the tilt reading at which the optical axis is level, the base being so


def rotation_x(angle_deg: float) -> Array:
    """Right-handed rotation about x, 3x3."""
    c, s = cos(radians(angle_deg)), sin(radians(angle_deg))
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


def rotation_y(angle_deg: float) -> Array:
    """Right-handed rotation about y, 3x3."""
    c, s = cos(radians(angle_deg)), sin(radians(angle_deg))
    return np.array([[c, 0, s], [0, 1.0, 0], [-s, 0, c]])


def rotation_z(angle_deg: float) -> Array:
    """Right-handed rotation about z, 3x3."""
    c, s = cos(radians(angle_deg)), sin(radians(angle_deg))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def base_in_apartment(mount: Mount) -> Transform:
    """`T_AB`: the base frame in the apartment."""
    upright = rotation_z(mount.yaw_deg)
    if mount.kind == "ceiling":
        upright = upright @ rotation_x(180.0)
    lean_x, lean_y = mount.lean_deg
    return Transform(upright @ rotation_x(lean_x) @ rotation_y(lean_y), np.array(mount.position, float))


def camera_in_base(mount: Mount, pan_deg: float, tilt_deg: float) -> Transform:
    """`T_BC`: the camera (OpenCV axes of the upright picture) at these readings, in the base frame."""
    up = -1.0 if mount.kind == "ceiling" else 1.0  # z of the head that is up in the upright picture
    pan = Transform(rotation_z(pan_deg), np.zeros(3))
    forward, away = mount.pan_to_tilt_m
    tilt = Transform(rotation_y(mount.tilt_zero_deg - tilt_deg), np.array([forward, 0.0, away]))
    along, above = mount.tilt_to_lens_m
    axes = np.array([[0.0, 0.0, 1.0], [-up, 0.0, 0.0], [0.0, -up, 0.0]])  # columns: right, down, forward
    lens = Transform(axes @ rotation_z(mount.sensor_roll_deg), np.array([along, 0.0, up * above]))
    return pan @ tilt @ lens


def camera_in_apartment(mount: Mount, pan_deg: float, tilt_deg: float) -> Transform:
    """`T_AC`: the camera at these readings, in the apartment frame."""
    return base_in_apartment(mount) @ camera_in_base(mount, pan_deg, tilt_deg)


def axes_in_apartment(mount: Mount, pan_deg: float, tilt_deg: float) -> Array:
    """The axes that pan and tilt turn the camera about at these readings: two unit vectors, rows, in the apartment."""
    base = base_in_apartment(mount).rotation
    return np.array([base[:, 2], base @ rotation_z(pan_deg)[:, 1]])


def quaternion(rotation: Array) -> tuple[float, float, float, float]:
    """The unit quaternion (x, y, z, w), w >= 0, of a 3x3 rotation (largest-component method, Shepperd 1978)."""
    r = rotation
    products = np.array(
        [
            [1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
            [r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
            [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1 + r[0, 0] + r[1, 1] + r[2, 2]],
        ]
    )
    row = products[int(np.argmax(np.diag(products)))]
    q = row / np.linalg.norm(row)
    q = -q if q[3] < 0 else q
    return float(q[0]), float(q[1]), float(q[2]), float(q[3])
