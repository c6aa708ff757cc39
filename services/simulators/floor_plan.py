"""The floor plan of the world as a robot would have mapped it: the picture and the YAML of map_server.

What a laser at knee height meets is occupied: walls but for doors and passages, and furniture. Not here: driving.
"""

from __future__ import annotations

from math import cos, hypot, radians, sin
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from services import document
from services.simulators.world import Furniture, Wall, World
from services.vision.frames import Array

FREE, OCCUPIED, UNKNOWN = 254, 0, 205  # as map_saver writes them
LASER_M = 0.2  # height that it sees
SIZE_M = (10.5, 9.5)  # of the map, from its origin

Cells = NDArray[np.bool_]


def drawn(world: World) -> NDArray[np.uint8]:
    """The picture, its first row the top; one pixel a cell."""
    width, height = (round(side / world.map.resolution) for side in SIZE_M)
    columns, rows = np.meshgrid(np.arange(width), np.arange(height)[::-1])
    across, up = (world.map.origin[axis] + (index + 0.5) * world.map.resolution
                  for axis, index in enumerate((columns, rows)))  # fmt: skip
    points = np.column_stack((across.ravel(), up.ravel(), np.zeros(width * height)))
    x, y, _ = world.map.to_apartment(points).T
    picture = np.full(width * height, UNKNOWN, np.uint8)
    for room in world.rooms.values():
        picture[_inside(room.polygon, x, y)] = FREE
    for piece in world.furniture:
        if piece.z < LASER_M < piece.z + piece.height:
            picture[_under(piece, x, y)] = OCCUPIED
    for wall in world.walls:
        picture[_in_wall(wall, x, y)] = OCCUPIED
    return picture.reshape(height, width)


def write(world: World, folder: Path) -> None:
    """Writes `map.pgm` and `map.yaml`."""
    picture = drawn(world)
    head = f"P5\n{picture.shape[1]} {picture.shape[0]}\n255\n".encode()
    (folder / "map.pgm").write_bytes(head + picture.tobytes())
    settings = {"image": "map.pgm", "resolution": world.map.resolution, "origin": list(world.map.origin),
                "negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196}  # fmt: skip
    document.write(folder / "map.yaml", settings)


def _inside(polygon: tuple[tuple[float, float], ...], x: Array, y: Array) -> Cells:
    """Even-odd rule: how many edges a ray to the right crosses."""
    inside = np.zeros(x.shape, bool)
    for (ax, ay), (bx, by) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / (by - ay))
    return inside


def _under(piece: Furniture, x: Array, y: Array) -> Cells:
    c, s = cos(radians(piece.yaw_deg)), sin(radians(piece.yaw_deg))
    dx, dy = x - piece.x, y - piece.y
    along, across = c * dx + s * dy, c * dy - s * dx
    inside: Cells = (abs(along) <= piece.size[0] / 2) & (abs(across) <= piece.size[1] / 2)
    return inside


def _in_wall(wall: Wall, x: Array, y: Array) -> Cells:
    """Without doors and passages; a window begins above what the laser sees."""
    length = hypot(wall.end[0] - wall.start[0], wall.end[1] - wall.start[1])
    ux, uy = (wall.end[0] - wall.start[0]) / length, (wall.end[1] - wall.start[1]) / length
    along, across = (
        ux * (x - wall.start[0]) + uy * (y - wall.start[1]),
        ux * (y - wall.start[1]) - uy * (x - wall.start[0]),
    )
    half = wall.thickness / 2
    inside = (along >= -half) & (along <= length + half) & (abs(across) <= half)
    for gap in wall.openings:
        if gap.bottom < LASER_M and gap.filled == "nothing":
            inside &= (along < gap.at) | (along > gap.at + gap.width)
    return np.asarray(inside)
