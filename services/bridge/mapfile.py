"""The floor plan that map_server's YAML names, as a nav_msgs/OccupancyGrid. Read in `apartment/floor.py`."""

from __future__ import annotations

from math import cos, sin
from pathlib import Path

from services.apartment import floor
from services.bridge.rules import Fields


def load(file: Path) -> Fields:
    """The grid, its stamps 0; ConfigError with file and line."""
    grid = floor.read(file)
    height, width = grid.cells.shape
    info = {
        "resolution": grid.resolution, "width": width, "height": height,
        "origin": {"position": {"x": grid.origin[0], "y": grid.origin[1], "z": 0.0},
                   "orientation": {"x": 0.0, "y": 0.0, "z": sin(grid.yaw / 2), "w": cos(grid.yaw / 2)}},
    }  # fmt: skip
    return {"header": {"frame_id": "map"}, "info": info, "data": grid.cells.ravel().tolist()}
