"""The world as boxes: walls between their openings, and furniture made of parts. Geometry only, no pixels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, degrees
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.simulators.world import Furniture, Wall, World
from services.vision.frames import Array, Transform, rotation_z

SIDES = ("front", "right", "back", "left", "top", "bottom")
# for every side: the corner that is its top left seen from outside, then its right and its down, in units of the box
_TOP_LEFT = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1], [0, 1, 1], [0, 0, 0]], float)
_RIGHT = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0], [1, 0, 0]], float)
_DOWN = np.array([[0, 0, -1], [0, 0, -1], [0, 0, -1], [0, 0, -1], [0, -1, 0], [0, 1, 0]], float)
NORMALS = np.array([[0, -1, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]], float)
_UNIT = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)


class Part(NamedTuple):
    """A part of a piece of furniture, from and to in fractions of the whole along its x, y (front to back) and z."""

    x: tuple[float, float]
    y: tuple[float, float]
    z: tuple[float, float]
    look: str


def _legs(top: float, thick: float = 0.08) -> tuple[Part, ...]:
    ends = ((0.0, thick), (1.0 - thick, 1.0))
    return tuple(Part(x, y, (0.0, top), "dark wood") for x in ends for y in ends)


ALL = (0.0, 1.0)
PARTS: dict[str, tuple[Part, ...]] = {
    "table": (Part(ALL, ALL, (0.94, 1), "wood"), *_legs(0.94)),
    "chair": (Part(ALL, ALL, (0.48, 0.53), "wood"), Part(ALL, (0.9, 1), (0.6, 1), "wood"), *_legs(0.48)),
    "sofa": (
        Part((0.1, 0.9), (0, 0.75), (0.06, 0.5), "fabric"),
        Part((0.1, 0.9), (0.75, 1), (0.06, 1), "fabric"),
        Part((0, 0.1), ALL, (0.06, 0.72), "fabric"),
        Part((0.9, 1), ALL, (0.06, 0.72), "fabric"),
    ),
    "bed": (
        Part(ALL, ALL, (0, 0.5), "wood"),
        Part((0.03, 0.97), (0.02, 0.98), (0.5, 0.85), "linen"),
        Part((0.08, 0.46), (0.76, 0.96), (0.85, 1), "linen"),
        Part((0.54, 0.92), (0.76, 0.96), (0.85, 1), "linen"),
    ),
    "lamp": (
        Part((0.2, 0.8), (0.2, 0.8), (0, 0.02), "dark"),
        Part((0.46, 0.54), (0.46, 0.54), (0.02, 0.8), "dark"),
        Part(ALL, ALL, (0.8, 1), "shade"),
    ),
    "plant": (Part((0.28, 0.72), (0.28, 0.72), (0, 0.28), "pot"), Part(ALL, ALL, (0.33, 1), "leaves")),
}


@dataclass(frozen=True)
class Box:
    """A box in the apartment: `pose` of the corner with its least x, y and z, and its `extent` along its own axes."""

    pose: Transform
    extent: Array
    look: str
    name: str

    @property
    def corners(self) -> Array:
        """(8, 3), apartment."""
        return self.pose.apply(_UNIT * self.extent)

    def sides(self) -> Array:
        """(6, 3, 3): top left corner, edge to the right and edge down of every side, seen from outside."""
        turn = self.pose.rotation.T
        start = self.pose.apply(_TOP_LEFT * self.extent)
        return np.stack([start, (_RIGHT * self.extent) @ turn, (_DOWN * self.extent) @ turn], axis=1)

    def may_hide(self, eye: Array, points: Array) -> bool:
        """A quick first test for `hides`: whether the upright boxes around both touch."""
        lines, mine = np.vstack([points, eye]), self.corners
        return bool((lines.min(axis=0) <= mine.max(axis=0)).all() and (mine.min(axis=0) <= lines.max(axis=0)).all())

    def hides(self, eye: Array, points: Array) -> NDArray[np.bool_]:
        """For points (n, 3): whether the straight line from the eye to each passes through this box (slab method)."""
        inside = self.pose.inverse()
        start = inside.apply(eye)
        way = inside.apply(points) - start
        way = np.where(np.abs(way) < 1e-12, 1e-12, way)
        near, far = -start / way, (self.extent - start) / way
        enters = np.minimum(near, far).max(axis=1)
        leaves = np.maximum(near, far).min(axis=1)
        return np.asarray((enters < leaves) & (leaves > 0.0) & (enters < 1.0), np.bool_)


def boxes(world: World) -> list[Box]:
    """Every wall and every piece of furniture."""
    walls = [box for wall in world.walls for box in wall_boxes(wall)]
    return walls + [box for piece in world.furniture for box in furniture_boxes(piece)]


def wall_boxes(wall: Wall) -> Iterator[Box]:
    """The solid pieces of a wall: beside, under and over its openings, and what fills these."""
    azimuth = degrees(atan2(wall.end[1] - wall.start[1], wall.end[0] - wall.start[0]))
    along = Transform(rotation_z(azimuth), np.array([*wall.start, 0.0]))

    def piece(x: tuple[float, float], z: tuple[float, float], look: str, thick: float = wall.thickness) -> Box:
        corner = along.apply(np.array([x[0], -thick / 2, z[0]]))
        extent = np.array([x[1] - x[0], thick, z[1] - z[0]])
        return Box(Transform(along.rotation, corner), extent, look, f"wall {wall.start} {x[0]:.2f} {z[0]:.2f}")

    done = 0.0
    for opening in wall.openings:
        x = (opening.at, opening.at + opening.width)
        yield piece((done, x[0]), (0.0, wall.height), "wall")
        yield piece(x, (opening.top, wall.height), "wall")
        if opening.bottom > 0:
            yield piece(x, (0.0, opening.bottom), "wall")
        if opening.filled != "nothing":
            yield piece(x, (opening.bottom, opening.top), opening.filled, wall.thickness / 2)
        done = x[1]
    yield piece((done, wall.length), (0.0, wall.height), "wall")


def furniture_boxes(piece: Furniture) -> Iterator[Box]:
    """The parts of a piece of furniture; a kind without parts is one box that looks like its kind."""
    size = np.array([*piece.size, piece.height])
    whole = Transform(rotation_z(piece.yaw_deg), np.array([piece.x, piece.y, piece.z]))
    for index, part in enumerate(PARTS.get(piece.kind, (Part(ALL, ALL, ALL, piece.kind),))):
        spans = np.array([part.x, part.y, part.z])
        corner = whole.apply(size * (spans[:, 0] - (0.5, 0.5, 0.0)))
        extent = size * (spans[:, 1] - spans[:, 0])
        yield Box(Transform(whole.rotation, corner), extent, part.look, f"{piece.label} {index}")
