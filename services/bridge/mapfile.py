"""The floor plan that map_server's YAML names, as a nav_msgs/OccupancyGrid.

The picture's first row is the top, the grid's first row the bottom; the origin is the lower left corner.
"""

from __future__ import annotations

from math import cos, sin
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from pydantic import Field, ValidationError

from services import document
from services.bridge.rules import Fields
from services.section import Section

FREE, OCCUPIED, UNKNOWN = 0, 100, -1


class MapFile(Section):
    """What stands in the file (wiki.ros.org/map_server)."""

    image: Path
    resolution: float = Field(gt=0)  # m per pixel
    origin: tuple[float, float, float]  # x, y in m, yaw in radians, of the lower left pixel
    occupied_thresh: float = Field(default=0.65, ge=0, le=1)
    free_thresh: float = Field(default=0.196, ge=0, le=1)
    negate: int = Field(default=0, ge=0, le=1)
    mode: Literal["trinary", "scale", "raw"] = "trinary"


def load(file: Path) -> Fields:
    """The grid, its stamps 0; ConfigError with file and line."""
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
    return _grid(settings, cells(settings, np.asarray(picture)))


def cells(settings: MapFile, picture: Any) -> Any:
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


def _grid(settings: MapFile, values: Any) -> Fields:
    height, width = values.shape
    x, y, yaw = settings.origin
    info = {
        "resolution": settings.resolution, "width": width, "height": height,
        "origin": {"position": {"x": x, "y": y, "z": 0.0},
                   "orientation": {"x": 0.0, "y": 0.0, "z": sin(yaw / 2), "w": cos(yaw / 2)}},
    }  # fmt: skip
    return {"header": {"frame_id": "map"}, "info": info, "data": values.ravel().tolist()}
