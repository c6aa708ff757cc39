"""The robot's own camera: the picture that it takes of the world from where it stands, and its lens as ROS tells it.

The same scene as the house's camera draws, with another lens. Where things of the robot are in its body is here too.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from services.simulators.camera.view.optics import window
from services.simulators.camera.view.prints import Image
from services.simulators.camera.view.scene import Scene
from services.simulators.true_camera import Lens
from services.simulators.world import World
from services.vision.frames import Transform, rotation_y

LENS = Lens(width=640, height=480, fx=570.3, fy=571.1, cx=318.4, cy=241.2, distortion=(0.02, -0.05, 0.0004, -0.0003, 0))
OPTICAL_IN_BODY = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
NOISE = 2.0  # grey levels, one sigma
NOISE_PLAY = 48  # pixels by which the noise pattern is shifted from picture to picture
QUALITY = 85


def in_base(height_m: float, down_deg: float) -> Transform:
    """The camera (z forward, x right, y down) in the robot's base: over its front, its head bent down."""
    return Transform(rotation_y(down_deg) @ OPTICAL_IN_BODY, np.array([0.12, 0.02, height_m]))


class Eye:
    """Takes pictures of one world. Not for several threads at once."""

    def __init__(self, world: World, seed: int) -> None:
        self._scene = Scene(world, LENS, seed)
        self._window = window(LENS, 1.0, LENS.width, LENS.height)
        self._rng = np.random.default_rng(seed)
        size = (LENS.height + NOISE_PLAY, LENS.width + NOISE_PLAY, 3)
        self._noise = (self._rng.standard_normal(size, dtype=np.float32) * NOISE).round().astype(np.int16)

    def picture(self, camera: Transform) -> Image:
        """BGR; `camera` in the apartment."""
        y, x = self._rng.integers(0, NOISE_PLAY, 2)
        grain = self._noise[y : y + LENS.height, x : x + LENS.width]
        taken = self._scene.draw(camera, self._window) + grain
        return np.asarray(np.clip(taken, 0, 255), np.uint8)


def jpeg(image: Image) -> bytes:
    """The picture as a file."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return bytes(data)


def camera_info() -> dict[str, Any]:
    """The fields of a sensor_msgs/CameraInfo, but for its header."""
    fx, fy, cx, cy = LENS.fx, LENS.fy, LENS.cx, LENS.cy
    return {
        "width": LENS.width, "height": LENS.height, "distortion_model": "plumb_bob", "D": list(LENS.distortion),
        "K": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "P": [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }  # fmt: skip
