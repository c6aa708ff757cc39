"""The lens: which ray a pixel looks along, and which pixel a point falls on. Where the camera stands is in `frames`.

The model is OpenCV's and ROS's: a pinhole with radial and tangential distortion, the centre of the first pixel at
(0, 0). ROS calls it `plumb_bob` with five coefficients (k1, k2, p1, p2, k3) and `rational_polynomial` with eight
(k4, k5, k6 in addition): https://docs.opencv.org/4.x/d9/d0c/group__calib3d.html.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COEFFICIENTS = {"plumb_bob": 5, "rational_polynomial": 8}
ASPECT_TOLERANCE = 0.01  # 1920x1080 for 2304x1296 is exact; streams rounded to whole macroblocks are within this
NEWTON_STEPS = 12  # four are enough inside the picture, the rest is for rays at the edge of a strong barrel
STEP = 1e-6  # of the difference quotient, in normalised coordinates
MISS = 1e-6  # a ray that does not lead back to its pixel to within this (a thousandth of a pixel) is none


@dataclass(frozen=True, eq=False)
class Lens:
    """Intrinsics of an upright picture of `width` x `height` pixels: `matrix` 3x3 and `distortion` (5,) or (8,)."""

    width: int
    height: int
    matrix: Array
    distortion: Array

    @classmethod
    def from_camera_info(cls, content: Mapping[str, Any]) -> Lens:
        """Reads what ROS's camera_calibration writes as `ost.yaml`; ValueError names the key that is wrong."""
        model = content.get("distortion_model", "plumb_bob")
        if model not in COEFFICIENTS:
            raise ValueError(f"distortion_model: expected one of {', '.join(COEFFICIENTS)}, got {model!r}")
        matrix = _numbers(content, "camera_matrix", 9).reshape(3, 3)
        if matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or matrix[2].tolist() != [0, 0, 1]:
            raise ValueError("camera_matrix: expected [fx, 0, cx, 0, fy, cy, 0, 0, 1] with fx and fy above 0")
        distortion = _numbers(content, "distortion_coefficients", COEFFICIENTS[model])
        return cls(_size(content, "image_width"), _size(content, "image_height"), matrix, distortion)

    @property
    def focal(self) -> float:
        """Pixels per radian in the middle of the picture, the mean of both directions."""
        return float(self.matrix[0, 0] + self.matrix[1, 1]) / 2

    def scaled(self, width: int, height: int) -> Lens:
        """The same lens for the picture resized to this size; ValueError when the aspect differs by over 1 %."""
        across, down = width / self.width, height / self.height
        if abs(across / down - 1) > ASPECT_TOLERANCE:
            raise ValueError(f"expected the aspect of {self.width}x{self.height}, got {width}x{height}")
        resize = np.array([[across, 0, across / 2 - 0.5], [0, down, down / 2 - 0.5], [0, 0, 1]])
        return Lens(width, height, resize @ self.matrix, self.distortion)

    def zoomed(self, magnification: float) -> Lens:
        """The same lens under digital zoom: the middle of the picture cut out and enlarged to the full size."""
        m = magnification
        middle_x, middle_y = (self.width - 1) / 2, (self.height - 1) / 2
        crop = np.array([[m, 0, (1 - m) * middle_x], [0, m, (1 - m) * middle_y], [0, 0, 1]])
        return replace(self, matrix=crop @ self.matrix)

    def rays(self, pixels: Array) -> Array:
        """Pixels (n, 2) to undistorted normalised coordinates (n, 2): x/z and y/z in the camera frame.

        NaN for a pixel that no ray reaches, as far outside the picture under a strong barrel distortion.
        """
        goal = (np.asarray(pixels, float) - self.matrix[:2, 2]) @ np.linalg.inv(self.matrix[:2, :2]).T
        rays = goal.copy()
        with np.errstate(all="ignore"):
            for _ in range(NEWTON_STEPS):
                rays = rays - self._newton_step(rays, goal)
            reached = np.abs(self._distort(rays) - goal).max(axis=1) < MISS
        return np.where(reached[:, None], rays, np.nan)

    def project(self, points_c: Array) -> Array:
        """Points (n, 3) in the camera frame to pixels (n, 2); NaN for points that are not in front of the lens."""
        points = np.asarray(points_c, float)
        depth = np.where(points[:, 2] > 0, points[:, 2], np.nan)
        return self._distort(points[:, :2] / depth[:, None]) @ self.matrix[:2, :2].T + self.matrix[:2, 2]

    def _distort(self, rays: Array) -> Array:
        k1, k2, p1, p2, k3, k4, k5, k6 = np.pad(self.distortion, (0, 8 - len(self.distortion)))
        x, y = rays[:, 0], rays[:, 1]
        r2 = x * x + y * y
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        across = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        down = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return np.column_stack((across, down))

    def _newton_step(self, rays: Array, goal: Array) -> Array:
        here = self._distort(rays)
        a, c = ((self._distort(rays + (STEP, 0)) - here) / STEP).T
        b, d = ((self._distort(rays + (0, STEP)) - here) / STEP).T
        x, y = (here - goal).T
        return np.column_stack((d * x - b * y, a * y - c * x)) / (a * d - b * c)[:, None]


def _numbers(content: Mapping[str, Any], key: str, count: int) -> Array:
    """The `data` of a matrix in the calibration file, `count` finite numbers."""
    table = content.get(key)
    data = table.get("data") if isinstance(table, Mapping) else None
    numbers = [v for v in data if isinstance(v, int | float) and np.isfinite(v)] if isinstance(data, list) else []
    if not isinstance(data, list) or len(numbers) != len(data) or len(numbers) != count:
        raise ValueError(f"{key}.data: expected a list of {count} numbers, got {data!r}")
    return np.array(numbers, float)


def _size(content: Mapping[str, Any], key: str) -> int:
    value = content.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or value <= 0:
        raise ValueError(f"{key}: expected a whole number of pixels above 0, got {value!r}")
    return value
