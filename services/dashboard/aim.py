"""From a click in a camera's picture to where the camera should look. Pure; frames as in `vision/frames.py`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.vision.aim import readings_at
from services.vision.frames import Mount, camera_in_apartment
from services.vision.lens import Lens

FAR_M = 50.0  # so far away it does not matter that the lens moves as the camera turns
PER_LEVEL = 0.375  # of a zoom that nobody calibrated: four times at level 8


@dataclass(frozen=True)
class Sight:
    """One camera: how it hangs, its lens at the widest zoom, and what its levels of zoom magnify by."""

    mount: Mount
    lens: Lens
    levels: tuple[tuple[float, float], ...] = ()

    def magnification(self, zoom: float) -> float:
        """How much larger than at the widest zoom."""
        if not self.levels:
            return 1.0 + PER_LEVEL * max(0.0, zoom)
        levels, times = zip(*((0.0, 1.0), *(one for one in self.levels if one[0] > 0)), strict=True)
        return float(np.interp(zoom, levels, times))

    def centring(self, right: float, down: float, pan: float, tilt: float, zoom: float) -> tuple[float, float] | None:
        """The readings that bring a point to the middle; it is at these shares of the upright picture's size.

        None when no ray reaches that point.
        """
        lens = self.lens.zoomed(self.magnification(zoom))
        (ray,) = lens.rays(np.array([[right * lens.width - 0.5, down * lens.height - 0.5]]))
        if np.isnan(ray).any():
            return None
        direction = np.array([ray[0], ray[1], 1.0])
        point = camera_in_apartment(self.mount, pan, tilt).apply(direction / np.linalg.norm(direction) * FAR_M)
        return readings_at(self.mount, point)
