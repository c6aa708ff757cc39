"""A board of squares that somebody holds before a camera: a chessboard, or one with markers in its white squares.

How it looks in a picture is in `camera/view/boards.py`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, PositiveFloat

from services.section import Section
from services.simulators.true_camera import XYZ
from services.vision.frames import Array, Transform


class HeldBoard(Section):
    """`columns` x `rows` squares of `square` metres; `position` is its centre.

    `turned_deg` is a rotation vector: by it the board's frame (x right, y up, z out of the print) is turned from the
    apartment's. `margin` is the white rim.
    """

    kind: Literal["charuco", "chessboard"] = "charuco"
    columns: int = Field(default=9, ge=3, le=40)
    rows: int = Field(default=6, ge=3, le=40)
    square: PositiveFloat = 0.030
    marker: PositiveFloat = 0.021  # the markers' side, m
    dictionary: str = "DICT_4X4_50"
    margin: float = Field(default=0.012, ge=0)
    position: XYZ
    turned_deg: XYZ = (0.0, 0.0, 0.0)

    @property
    def pose(self) -> Transform:
        """`T_AM`: its frame in the apartment, the origin in its centre."""
        vector = np.radians(np.array(self.turned_deg))
        angle = max(float(np.linalg.norm(vector)), 1e-12)
        cross = np.cross(np.eye(3), vector / angle)  # Rodrigues' formula
        turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        return Transform(turn, np.array(self.position, float))

    def sheet(self) -> Array:
        """The corners (4, 3) of the sheet in the apartment: top left, top right, bottom right, bottom left."""
        x, y = (n * self.square / 2 + self.margin for n in (self.columns, self.rows))
        return self.pose.apply(np.array([[-x, y, 0], [x, y, 0], [x, -y, 0], [-x, -y, 0]]))
