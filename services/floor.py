"""The robot's map: which cells of the floor are free, occupied or unknown, in the form of ROS's map_server.

The frame is `map`: metres, x right and y up in the picture, the origin is the outer corner of the lower left cell.
Not here: where a robot may stand to see something (`mission/standing.py`), and how a map is made of a simulated flat
(`simulators/robot/plan.py`).
"""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from services import document
from services.errors import ConfigError

FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # as in nav_msgs/OccupancyGrid
PIXELS = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}  # as map_saver writes them
LAP_M = 0.8  # of the furniture that something lies on, on the way to the one who looks
XY = tuple[float, float]
Cells = NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Grid:
    """`cells` (rows, columns) of int8, row 0 at the lowest y; `resolution` metres per cell; `origin` x, y in metres."""

    cells: Cells
    resolution: float
    origin: XY

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

    def clear(self, x: float, y: float, radius: float) -> bool:
        """Whether a disc around a point lies in free cells."""
        row, column = self.cell(x, y)
        return self.inside(row, column) and bool(self.clearance[row, column] >= radius + 0.71 * self.resolution)

    def reachable(self, start: XY, radius: float) -> NDArray[np.bool_]:
        """The cells that the middle of a disc can come to from `start`, by cells that share an edge.

        A start that is itself too near to something counts from the nearest cell that is not.
        """
        open_ = self.clearance >= radius
        reached = np.zeros_like(open_)
        rows, columns = np.nonzero(open_)
        if not len(rows):
            return reached
        row, column = self.cell(*start)
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


def read(file: Path) -> Grid:
    """A map_server YAML and the PGM picture beside it (`image`, `resolution`, `origin`, `occupied_thresh`,
    `free_thresh`, `negate`); ConfigError tells file and line."""
    source = document.read(file)
    if not source.faults and not isinstance(source.value, dict):
        source.fault((), "expected a map as map_server writes it, got something else")
    if source.faults:
        raise ConfigError(source.faults)
    try:
        return _grid(file, source.value)
    except (KeyError, TypeError, ValueError, OSError) as error:
        text = f"no {error} in it" if isinstance(error, KeyError) else str(error)
        raise ConfigError([f"{file}:1: expected a map as map_server writes it: {text}"]) from error


def _grid(file: Path, settings: dict[str, object]) -> Grid:
    x, y, yaw = (float(value) for value in settings["origin"])  # type: ignore[attr-defined]
    if yaw:
        raise ValueError("a map that is turned (origin's third number) is not supported")
    grey = _pgm(file.parent / str(settings["image"])).astype(float)
    dark = grey / 255 if settings.get("negate") else 1 - grey / 255
    cells = np.full(grey.shape, UNKNOWN, np.int8)
    cells[dark > float(str(settings.get("occupied_thresh", 0.65)))] = OCCUPIED
    cells[dark < float(str(settings.get("free_thresh", 0.196)))] = FREE
    return Grid(np.ascontiguousarray(cells[::-1]), float(str(settings["resolution"])), (x, y))


def _pgm(file: Path) -> NDArray[np.uint8]:
    """A binary grey PGM (P5, one byte per pixel), rows from the top."""
    data = file.read_bytes()
    head = re.match(rb"P5\s+(?:#[^\n]*\n\s*)*(\d+)\s+(\d+)\s+255\s", data)
    if head is None:
        raise ValueError(f"{file.name}: expected a binary PGM (P5) of 8 bits")
    width, height = int(head[1]), int(head[2])
    pixels = np.frombuffer(data, np.uint8, offset=head.end())
    if len(pixels) < width * height:
        raise ValueError(f"{file.name}: expected {width} x {height} pixels, got {len(pixels)}")
    return pixels[: width * height].reshape(height, width)


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
