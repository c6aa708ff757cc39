"""The floor of a simulated flat as the robot's map: what stands on it at the height of the robot is occupied.

The map frame is turned and shifted against the apartment's, as `config/world.yaml` says. A real robot makes its map by
driving; here the truth is drawn.
"""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray

from services.apartment.floor import FREE, OCCUPIED, UNKNOWN, Grid
from services.simulators.camera.view.solids import Box, boxes
from services.simulators.world import Room, World
from services.vision.frames import Array

LOW_M, HIGH_M = 0.05, 1.1  # what is between is in the robot's way
MARGIN_M = 0.4  # of the map around the rooms


def grid(world: World) -> Grid:
    """The map of a world."""
    corners = np.array([(*corner, 0.0) for room in world.rooms.values() for corner in room.polygon])
    there = world.map.apartment_to_map.transform.apply(corners)[:, :2]
    size = world.map.resolution
    low = np.floor((there.min(axis=0) - MARGIN_M) / size) * size
    columns, rows = (ceil(side / size) for side in there.max(axis=0) + MARGIN_M - low)
    x, y = np.meshgrid(low[0] + (np.arange(columns) + 0.5) * size, low[1] + (np.arange(rows) + 0.5) * size)
    points = world.map.to_apartment(np.column_stack((x.ravel(), y.ravel(), np.zeros(x.size))))[:, :2]
    cells = np.full(len(points), UNKNOWN, np.int8)
    for room in world.rooms.values():
        cells[_within(points, room)] = FREE
    for box in boxes(world):
        cells[_under(points, box, size / 2)] = OCCUPIED
    return Grid(cells.reshape(rows, columns), size, (round(float(low[0]), 6), round(float(low[1]), 6)))


def _within(points: Array, room: Room) -> NDArray[np.bool_]:
    """Whether points (n, 2) lie in a room: a ray to the right crosses its edges an odd number of times."""
    inside = np.zeros(len(points), bool)
    corners = np.array(room.polygon, float)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        crosses = (points[:, 1] < ay) != (points[:, 1] < by)
        along = (points[:, 1] - ay) / (by - ay) if by != ay else np.zeros(len(points))
        inside ^= crosses & (points[:, 0] < ax + along * (bx - ax))
    return inside


def _under(points: Array, box: Box, margin: float) -> NDArray[np.bool_]:
    """Whether points (n, 2) lie under a box that is in the robot's way; boxes stand upright."""
    bottom = float(box.pose.translation[2])
    if bottom >= HIGH_M or bottom + float(box.extent[2]) <= LOW_M:
        return np.zeros(len(points), bool)
    at = box.pose.inverse().apply(np.column_stack((points, np.full(len(points), bottom))))[:, :2]
    return np.asarray(((at >= -margin) & (at <= box.extent[:2] + margin)).all(axis=1), bool)
