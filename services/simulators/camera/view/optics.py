"""The simulated lens: from points to pixels and back, exactly, for the whole sensor or a window of it.

Brown-Conrady distortion with OpenCV's five coefficients (k1 k2 p1 p2 k3). Written here without OpenCV's own
functions, so that a test which compares the two checks both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.simulators.true_camera import Lens
from services.vision.frames import Array

Float32 = NDArray[np.float32]
GRID_PX = 8  # undistorted exactly at every 8th pixel; bilinear between: below 0.005 px for such lenses


def distort(rays: Array, lens: Lens) -> Array:
    """Where the lens puts undistorted normalised coordinates (..., 2)."""
    k1, k2, p1, p2, k3 = lens.distortion
    x, y = rays[..., 0], rays[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([x * radial + dx, y * radial + dy], axis=-1)


def undistort(seen: Array, lens: Lens, rounds: int = 25) -> Array:
    """The inverse of `distort`, by fixed-point iteration (it converges where the distortion is small)."""
    rays = seen
    for _ in range(rounds):
        rays = rays + (seen - distort(rays, lens))
    return rays


def project(points: Array, lens: Lens) -> Array:
    """Pixels (n, 2) of points (n, 3) before the camera, in the upright picture at the widest zoom."""
    seen = distort(points[:, :2] / points[:, 2:], lens)
    return seen * (lens.fx, lens.fy) + (lens.cx, lens.cy)


@dataclass(frozen=True)
class Window:
    """The part of the sensor that a picture of `width` x `height` shows, in sensor pixels (digital zoom is a crop)."""

    left: float
    top: float
    across: float
    down: float
    width: int
    height: int

    @property
    def scale(self) -> float:
        """Picture pixels per sensor pixel."""
        return self.width / self.across

    def to_sensor(self, pixels: Array) -> Array:
        """Sensor pixels of picture pixels (..., 2); pixel centres are whole numbers in both."""
        k = (self.across / self.width, self.down / self.height)
        return (pixels + 0.5) * k - 0.5 + (self.left, self.top)

    def from_sensor(self, pixels: Array) -> Array:
        """Picture pixels of sensor pixels (..., 2)."""
        k = (self.width / self.across, self.height / self.down)
        return (pixels - (self.left, self.top) + 0.5) * k - 0.5


def window(lens: Lens, magnification: float, width: int, height: int) -> Window:
    """The window about the middle of the sensor that digital zoom shows at this magnification."""
    across, down = lens.width / magnification, lens.height / magnification
    return Window((lens.width - across) / 2, (lens.height - down) / 2, across, down, width, height)


def rays(lens: Lens, view: Window) -> Float32:
    """(height, width, 2): the undistorted normalised coordinates that every pixel of the picture looks along."""
    columns = np.arange(-GRID_PX, view.width + 2 * GRID_PX, GRID_PX)
    rows = np.arange(-GRID_PX, view.height + 2 * GRID_PX, GRID_PX)
    grid = np.stack(np.meshgrid(columns, rows), axis=-1).astype(float)
    seen = (view.to_sensor(grid) - (lens.cx, lens.cy)) / (lens.fx, lens.fy)
    return _between(undistort(seen, lens), view.width, view.height)


def _between(grid: Array, width: int, height: int) -> Float32:
    """Bilinear values at every pixel from those at every GRID_PX-th, which begin one step outside."""
    x, y = np.arange(width) / GRID_PX + 1.0, np.arange(height) / GRID_PX + 1.0
    i, j = x.astype(int), y.astype(int)
    a, b = (x - i)[None, :, None], (y - j)[:, None, None]
    row = (grid[:, i] * (1 - a) + grid[:, i + 1] * a).astype(np.float32)
    result: Float32 = row[j] * (1 - b.astype(np.float32)) + row[j + 1] * b.astype(np.float32)
    return result
