"""What is known of a marker before it is seen: it lies flat, or hangs on a wall. A leaning on it, not a constraint.

A normal that is taken for exact costs more than it gives when it is two degrees off.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Faces = Literal["up", "wall"]
LEVEL_DEG = 1.5  # how flat tables lie and how upright walls stand
AT_MOST = 100.0  # squared, of the residuals: beyond, it is plainly not so, and what is seen counts


@dataclass(frozen=True)
class Prior:
    """Where the marker's normal points: `up`, or anywhere level (`wall`); known to `level_deg`."""

    faces: Faces
    level_deg: float = LEVEL_DEG

    def residuals(self, normal: Array) -> Array:
        """How far a normal (3,) is off, in standard deviations, limited: two numbers for `up`, one for `wall`."""
        off = normal[:2] if self.faces == "up" else normal[2:]
        if self.faces == "up" and normal[2] < 0:
            off = off / max(float(np.linalg.norm(off)), 1e-9)  # upside down is as wrong as can be
        residuals = off / radians(self.level_deg)
        limit = sqrt(AT_MOST) / max(float(np.linalg.norm(residuals)), 1e-9)
        return np.asarray(residuals * min(1.0, limit), float)

    def holds(self, normal: Array) -> bool:
        """Whether a normal (3,) is anywhere near to what was said."""
        residuals = self.residuals(normal)
        return float(residuals @ residuals) < 0.99 * AT_MOST

    def slope(self, rotation: Array) -> Array:
        """The residuals' derivative after a small turn of the marker about its own axes: (2, 3) or (1, 3)."""
        turned = rotation @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 0]])  # of the normal, by each of the three turns
        rows = turned[:2] if self.faces == "up" else turned[2:]
        return np.asarray(rows / radians(self.level_deg), float)
