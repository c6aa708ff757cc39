"""Which parts of the picture a board has been shown in, which tilts, and what is missing yet: in words for a person.

It also says which views are worth keeping. The fit itself is in `calibrate_lens`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import degrees

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.board import Seen

Array = NDArray[np.float64]

REGIONS = (5, 3)  # across and down
CORNERS, VIEWS = 8, 2  # that a region wants
FEWEST, MOST = 14, 60  # views
TILTED_DEG = 18.0  # the board's plane against the picture's
TILTED_VIEWS = 2  # for each way
MOVED = 0.05  # of the picture's width: a view this near to one before, and no more turned than that, adds little
TURNED_DEG = 9.0
BLURRED_PX = 1.6  # sigma of the edges: about 4 px of motion
NOMINAL_FOCAL = 0.6  # of the width, for the tilt of a board before the lens is known
ROWS, COLUMNS = ("top", "middle", "bottom"), ("far left", "left", "centre", "right", "far right")
SIDES = {"up": "top", "down": "bottom"}
TILTS = {"left": (0, -1.0), "right": (0, 1.0), "up": (1, -1.0), "down": (1, 1.0)}  # of the board's face; in the picture


@dataclass(frozen=True, eq=False)
class Shown:
    """One view with how the board's face is turned: right and down as the picture shows it, degrees."""

    seen: Seen
    facing: tuple[float, float]
    focal: float


@dataclass
class Album:
    """The views of one calibration, of pictures of `size` (width, height)."""

    size: tuple[int, int]
    views: list[Shown] = field(default_factory=list)

    def add(self, seen: Seen) -> str:
        """Takes a view; empty when it was taken, otherwise why not."""
        if seen.blur_px > BLURRED_PX:
            return "it is blurred: hold it still"
        shown = Shown(seen, facing(seen, self.size), NOMINAL_FOCAL * self.size[0])
        twin = next((i for i, one in enumerate(self.views) if self._alike(one, shown)), None)
        if twin is not None:
            if seen.blur_px < 0.8 * self.views[twin].seen.blur_px and len(seen.ids) >= len(self.views[twin].seen.ids):
                self.views[twin] = shown
            return "as before: move or tilt it"
        if len(self.views) >= MOST:
            return "that is enough"
        self.views.append(shown)
        return ""

    @property
    def regions(self) -> NDArray[np.bool_]:
        """(rows, columns): whether the board has been shown there."""
        corners, views = np.zeros(REGIONS[::-1], int), np.zeros(REGIONS[::-1], int)
        for one in self.views:
            cells = np.clip((one.seen.pixels + 0.5) / self.size * REGIONS, 0, np.array(REGIONS) - 1).astype(int)
            here = np.zeros_like(corners)
            np.add.at(here, (cells[:, 1], cells[:, 0]), 1)
            corners, views = corners + here, views + (here > 0)
        return (corners >= CORNERS) & (views >= VIEWS)

    @property
    def tilts(self) -> dict[str, int]:
        """How many views show the board's face turned each way."""
        return {
            way: sum(sign * one.facing[axis] > TILTED_DEG for one in self.views) for way, (axis, sign) in TILTS.items()
        }

    @property
    def progress(self) -> float:
        """0 to 1: how much of what is wanted has been shown."""
        tilts = [min(1.0, count / TILTED_VIEWS) for count in self.tilts.values()]
        parts = (float(self.regions.mean()), float(np.mean(tilts)), min(1.0, len(self.views) / FEWEST))
        return 0.6 * parts[0] + 0.2 * parts[1] + 0.2 * parts[2]

    @property
    def missing(self) -> str:
        """What to show next, for a person; empty when there is enough."""
        if len(self.views) >= MOST:
            return ""
        empty = np.argwhere(~self.regions)
        if len(empty):
            row, column = min(empty.tolist(), key=lambda at: (-abs(at[1] - 2), -abs(at[0] - 1)))
            return f"show it at the {ROWS[row]} {COLUMNS[column]} of the picture"
        turn = next((way for way, count in self.tilts.items() if count < TILTED_VIEWS), None)
        if turn is not None:
            return f"tilt it: turn its face to the picture's {SIDES.get(turn, turn)}"
        return "show it in other places" if len(self.views) < FEWEST else ""

    def _alike(self, one: Shown, other: Shown) -> bool:
        _, mine, others = np.intersect1d(one.seen.ids, other.seen.ids, return_indices=True)
        if len(mine) < len(other.seen.ids) / 2:
            return False
        moved = np.linalg.norm(one.seen.pixels[mine] - other.seen.pixels[others], axis=1).mean() / self.size[0]
        turned = max(abs(a - b) for a, b in zip(one.facing, other.facing, strict=True))
        return bool(moved < MOVED and turned < TURNED_DEG)


def facing(seen: Seen, size: tuple[int, int]) -> tuple[float, float]:
    """How the board's face is turned against the camera: to the right and down in the picture, degrees, roughly."""
    focal, flat = NOMINAL_FOCAL * size[0], np.zeros(5)
    matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    found, turn, shift = cv2.solvePnP(seen.points, seen.pixels, matrix, flat, flags=cv2.SOLVEPNP_IPPE)
    if not found:
        return 0.0, 0.0
    normal = np.asarray(cv2.Rodrigues(turn)[0], float)[:, 2]
    normal = -normal if normal @ np.asarray(shift, float).ravel() > 0 else normal
    return degrees(float(np.arctan2(normal[0], -normal[2]))), degrees(float(np.arctan2(normal[1], -normal[2])))
