"""The robot's map: which cells of the floor are free, occupied or unknown, in the form of ROS's map_server.

The frame is `map`: metres, x right and y up in the picture, the origin is the outer corner of the lower left cell.
Not here: where a robot may stand to see something (`mission/standing.py`), and how a map is made of a simulated flat
(`simulators/robot/plan.py`).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from services import document
from services.section import Section

FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # as in nav_msgs/OccupancyGrid
PIXELS = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}  # as map_saver writes them
LAP_M = 0.8  # of the furniture that something lies on, on the way to the one who looks
FAR = 10**9  # cells; the square of what is farther fits no integer of numpy
XY = tuple[float, float]
Cells = NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Grid:
    """`cells` (rows, columns) of int8, row 0 at the lowest y; `resolution` metres per cell; `origin` x, y in metres.

    `yaw` of the whole, radians. Only a grid that is not turned has points, ways and sights.
    """

    cells: Cells
    resolution: float
    origin: XY
    yaw: float = 0.0

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Row and column of the cell that holds a point; it may lie outside."""
        return int((y - self.origin[1]) // self.resolution), int((x - self.origin[0]) // self.resolution)

    def point(self, row: float, column: float) -> XY:
        """The middle of a cell."""
        return self.origin[0] + (column + 0.5) * self.resolution, self.origin[1] + (row + 0.5) * self.resolution

    def inside(self, row: int, column: int) -> bool:
        """Whether there is such a cell."""
        rows, columns = self.cells.shape
        return 0 <= row < int(rows) and 0 <= column < int(columns)

    @cached_property
    def clearance(self) -> NDArray[np.float64]:
        """Metres from the middle of each cell to the nearest edge of a cell that is not free, or of the map.

        Squared distances separate by axis: first along the rows, then the least over the rows (Felzenszwalb 2012).
        """
        blocked = np.pad(self.cells != FREE, 1, constant_values=True)
        along = np.full(blocked.shape, np.inf)
        columns = np.arange(blocked.shape[1])
        for row, line in enumerate(blocked):
            at = np.flatnonzero(line)
            along[row] = _edge(columns[:, None] - at[None, :]).min(axis=1, initial=np.inf)
        rows = np.arange(blocked.shape[0])
        squared = [(along**2 + (_edge(rows - row) ** 2)[:, None]).min(axis=0) for row in rows]
        distance: NDArray[np.float64] = np.sqrt(np.array(squared)[1:-1, 1:-1]) * self.resolution
        return np.where(self.cells == FREE, distance, 0.0)

    def reachable(self, start: XY, radius: float) -> NDArray[np.bool_]:
        """The cells that the middle of a disc can come to from `start`, by cells that share an edge.

        A start that is itself too near to something counts from the nearest cell that is not.
        """
        open_ = self.clearance >= radius
        reached = np.zeros_like(open_)
        rows, columns = np.nonzero(open_)
        if not len(rows):
            return reached
        row, column = (max(-FAR, min(one, FAR)) for one in self.cell(*start))
        nearest = int(np.argmin((rows - row) ** 2 + (columns - column) ** 2))
        waiting = deque([(int(rows[nearest]), int(columns[nearest]))])
        reached[waiting[0]] = True
        while waiting:
            row, column = waiting.popleft()
            for other in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
                if self.inside(*other) and open_[other] and not reached[other]:
                    reached[other] = True
                    waiting.append(other)
        return reached

    def sees(self, one: XY, other: XY) -> bool:
        """Whether nothing stands on the straight line from one point to the other, but what the other lies on.

        That is the occupied stretch around `other`, up to LAP_M of it: a robot looks over a table, not over a wall.
        """
        length = float(np.hypot(other[0] - one[0], other[1] - one[1]))
        lap, done = True, 0.0
        while done < length:
            share = 1.0 - done / length
            cell = self.cell(one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1]))
            occupied = not self.inside(*cell) or self.cells[cell] == OCCUPIED
            lap = lap and occupied and done <= LAP_M
            if occupied and not lap:
                return False
            done += self.resolution / 2
        return True


def _edge(cells: NDArray[np.int_]) -> NDArray[np.float64]:
    """From the middle of a cell to the near edge of one that is so many cells away along an axis, in cells."""
    return np.maximum(np.abs(cells) - 0.5, 0.0)


class MapFile(Section):
    """What stands in map_server's YAML (wiki.ros.org/map_server)."""

    image: Path
    resolution: float = Field(gt=0)  # m per pixel
    origin: tuple[float, float, float]  # x, y in m, yaw in radians, of the lower left pixel
    occupied_thresh: float = Field(default=0.65, ge=0, le=1)
    free_thresh: float = Field(default=0.196, ge=0, le=1)
    negate: int = Field(default=0, ge=0, le=1)
    mode: Literal["trinary", "scale", "raw"] = "trinary"


def read(file: Path) -> Grid:
    """A map_server YAML and the picture that it names; ConfigError tells file and line."""
    import cv2  # 40 MB: only where a map is read, not wherever a configuration is

    source = document.read(file)
    document.must(source)
    try:
        settings = MapFile.model_validate(source.value)
    except ValidationError as error:
        for fault in error.errors(include_url=False):
            source.fault(fault["loc"], f"expected {fault['msg']}, got {str(fault['input'])[:80]!r}")
        document.must(source)
        raise
    picture = cv2.imread(str(file.parent / settings.image), cv2.IMREAD_GRAYSCALE)
    if picture is None:
        source.fault(("image",), f"expected a picture, got {str(settings.image)!r}")
        document.must(source)
    x, y, yaw = settings.origin
    return Grid(_cells(settings, np.asarray(picture)), settings.resolution, (x, y), yaw)


def _cells(settings: MapFile, picture: NDArray[Any]) -> Cells:
    """The grid's values, bottom row first: 0 free, 100 occupied, -1 unknown, in between with `scale`."""
    flipped = np.flipud(picture).astype(float)
    if settings.mode == "raw":
        return np.where(flipped > OCCUPIED, UNKNOWN, flipped).astype(np.int8)
    occupied = flipped / 255 if settings.negate else (255 - flipped) / 255
    if settings.mode == "scale":
        between = 1 + 98 * (occupied - settings.free_thresh) / (settings.occupied_thresh - settings.free_thresh)
    else:
        between = np.full(occupied.shape, float(UNKNOWN))
    grid = np.where(occupied > settings.occupied_thresh, OCCUPIED, between)
    return np.where(occupied < settings.free_thresh, FREE, grid).astype(np.int8)


def write(grid: Grid, file: Path) -> None:
    """The same two files: `file` and, beside it, the picture of the same name."""
    picture = file.with_suffix(".pgm")
    pixels = np.vectorize(PIXELS.get, otypes=[np.uint8])(grid.cells[::-1])
    height, width = pixels.shape
    picture.write_bytes(f"P5\n{width} {height}\n255\n".encode() + pixels.tobytes())
    x, y = grid.origin
    file.write_text(
        f"image: {picture.name}\nresolution: {grid.resolution}\norigin: [{x}, {y}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        encoding="utf-8",
    )
