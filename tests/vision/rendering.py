"""Pictures of printed markers seen through a lens, made from the geometry alone, so that the truth is known.

Each pixel is the mean of SUPER x SUPER rays that are followed to the print; then blur and noise. Nothing of
`detect` or `corners` is used, so an offset of half a pixel in either would show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.frames import Transform
from services.vision.lens import Lens

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
SUPER = 5
CELL_PX = 20  # of a cell in the print's own picture
LIGHT, DARK, WALL = 205.0, 35.0, 120.0


@dataclass(frozen=True)
class Print:
    """A marker with a white rim of one cell: `size_m` is the black square's side, `pose` the marker in the apartment."""

    marker: int
    dictionary: str
    size_m: float
    pose: Transform

    def corners(self) -> Array:
        """The black square's corners (4, 3) in the apartment, clockwise from the marker's own top-left."""
        half = self.size_m / 2
        return self.pose.apply(np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]]))


def pinhole(width: int = 640, height: int = 480, focal: float = 1152.0) -> Lens:
    """A lens without distortion; a small picture by default, so that a test can make hundreds."""
    matrix = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    return Lens(width, height, matrix, np.zeros(5))


def true_corners(lens: Lens, camera: Transform, marker: Print) -> Array:
    """Where the corners fall in the picture, (4, 2)."""
    return lens.project(camera.inverse().apply(marker.corners()))


def facing(rng: np.random.Generator, position_c: Array, tilt_deg: float) -> Transform:
    """A marker at this place in the camera frame, its normal `tilt_deg` off the line of sight, else random."""
    to_lens = -position_c / np.linalg.norm(position_c)
    axis = np.cross(to_lens, rng.normal(size=3))
    tilt = cv2.Rodrigues(np.radians(tilt_deg) * axis / np.linalg.norm(axis))[0]
    normal = tilt @ to_lens
    right = np.cross(rng.normal(size=3), normal)
    right /= np.linalg.norm(right)
    return Transform(np.column_stack((right, np.cross(normal, right), normal)), np.asarray(position_c, float))


def picture(
    lens: Lens,
    camera: Transform,
    prints: Sequence[Print],
    rng: np.random.Generator,
    *,
    blur: float = 0.7,
    noise: float = 3.0,
    background: Array | None = None,
) -> Picture:
    """What the camera at `camera` (T_AC) sees, grey; `background` is a grey picture of the lens's size."""
    canvas = np.full((lens.height, lens.width), WALL) if background is None else background.astype(float).copy()
    for marker in prints:
        _paint(canvas, lens, camera, marker)
    if blur > 0:
        canvas = cv2.GaussianBlur(canvas, (0, 0), blur)
    canvas += rng.normal(0, noise, canvas.shape)
    return np.clip(np.rint(canvas), 0, 255).astype(np.uint8)


def _paint(canvas: Array, lens: Lens, camera: Transform, marker: Print) -> None:
    texture = _texture(marker)
    full = marker.size_m * texture.shape[0] / (texture.shape[0] - 2 * CELL_PX)
    outline = true_corners(lens, camera, Print(marker.marker, marker.dictionary, full * 1.1, marker.pose))
    x0, y0 = np.maximum(np.floor(outline.min(axis=0)).astype(int), 0)
    x1, y1 = np.minimum(np.ceil(outline.max(axis=0)).astype(int) + 1, (lens.width, lens.height))
    if x1 <= x0 or y1 <= y0:
        return
    sub = (np.arange(SUPER) + 0.5) / SUPER - 0.5
    xs, ys = (np.arange(x0, x1)[:, None] + sub).ravel(), (np.arange(y0, y1)[:, None] + sub).ravel()
    grid = np.stack(np.meshgrid(xs, ys), axis=-1)
    on_print = _meet(lens, camera, marker, grid.reshape(-1, 2)).reshape(grid.shape) / full
    across = ((on_print[..., 0] + 0.5) * texture.shape[1] - 0.5).astype(np.float32)
    down = ((0.5 - on_print[..., 1]) * texture.shape[0] - 0.5).astype(np.float32)
    seen = cv2.remap(texture, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    inside = (np.abs(on_print) <= 0.5).all(axis=-1)

    def mean(a: Array) -> Array:
        return a.reshape(y1 - y0, SUPER, x1 - x0, SUPER).mean(axis=(1, 3))

    patch = canvas[y0:y1, x0:x1]
    patch[:] = mean(np.where(inside, seen, 0.0)) + (1 - mean(inside.astype(float))) * patch


def _meet(lens: Lens, camera: Transform, marker: Print, pixels: Array) -> Array:
    """Where the pixels' rays meet the print's plane: x, y in the marker's frame, (n, 2), metres."""
    marker_in_camera = camera.inverse() @ marker.pose
    rays = np.column_stack((lens.rays(pixels), np.ones(len(pixels))))
    normal = marker_in_camera.rotation[:, 2]
    hits = rays * (normal @ marker_in_camera.translation / (rays @ normal))[:, None]
    return marker_in_camera.inverse().apply(hits)[:, :2]


def _texture(marker: Print) -> Array:
    book = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, marker.dictionary))
    modules = book.markerSize + 2
    bits = cv2.aruco.generateImageMarker(book, marker.marker, modules)
    cells = np.pad(np.where(bits > 0, LIGHT, DARK), 1, constant_values=LIGHT)
    return np.kron(cells, np.ones((CELL_PX, CELL_PX)))
