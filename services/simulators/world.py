"""The truth that every simulator and test shares: rooms, walls, furniture, markers, camera and robot.

One file (`config/world.yaml`) describes it. Metres and degrees in the apartment frame, z up (`contract.md` sections
4 and 7); only the robot's pose is in the map frame. What a camera *believes* about itself is in its own
configuration, not here. How the world looks is in `camera/solids.py` and `camera/textures.py`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from math import hypot
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, PositiveFloat, ValidationError, field_validator, model_validator

from services import document
from services.document import Document, Path_
from services.errors import ConfigError
from services.section import Section
from services.simulators.board import HeldBoard
from services.simulators.true_camera import XY, XYZ, WorldCamera
from services.vision.frames import (
    Array,
    Transform,
    rotation_x,
    rotation_z,
)

LAMP_LUX = 200.0  # a living room in the evening


class Room(Section):
    """A part of the apartment; `polygon` holds its corners, in order. Open areas have edges without a wall."""

    label: str
    polygon: tuple[XY, ...] = Field(min_length=3)


class Opening(Section):
    """A gap in a wall; `at` is where it begins, metres along the wall from its start."""

    at: float = Field(ge=0)
    width: PositiveFloat
    bottom: float = Field(default=0.0, ge=0)
    top: PositiveFloat = 2.05
    filled: Literal["nothing", "glass", "door"] = "nothing"


class Wall(Section):
    """A wall standing on the line from `start` to `end`; its openings are doors, windows and passages."""

    start: XY
    end: XY
    height: PositiveFloat = 2.6
    thickness: PositiveFloat = 0.1
    openings: tuple[Opening, ...] = ()

    @property
    def length(self) -> float:
        """Metres."""
        return hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    @model_validator(mode="after")
    def openings_follow_each_other(self) -> Wall:
        edges = [0.0]
        for opening in self.openings:
            edges += [opening.at, opening.at + opening.width]
        if any(b < a for a, b in zip(edges, [*edges[1:], self.length], strict=True)):
            raise ValueError(f"expected openings in order, apart, and inside {self.length:.2f} m, got {edges[1:]}")
        return self


class Furniture(Section):
    """A box: centre, size along its own x and y, height, `z` of its underside; `kind` is its look.

    At `yaw_deg` 0 its front faces -y (south) and its x runs along that front.
    """

    label: str
    room: str
    kind: str = "cupboard"
    x: float
    y: float
    size: tuple[PositiveFloat, PositiveFloat]
    height: PositiveFloat
    z: float = Field(default=0.0, ge=0)
    yaw_deg: float = 0.0


class Marker(Section):
    """A printed marker. `position` is its centre; `facing` is `up` or the azimuth (degrees) that its print faces.

    At `spin_deg` 0 the marker's x is the apartment's x (facing up), its y is up (on a wall); a growing spin turns
    it counter-clockwise, seen from the front.
    """

    id: int = Field(ge=0)
    dictionary: Literal["DICT_5X5_1000"] = "DICT_5X5_1000"
    size: PositiveFloat  # m, side of the black square
    position: XYZ
    facing: Literal["up"] | float = "up"
    spin_deg: float = 0.0
    where: str  # label of the furniture that it lies on or hangs at
    room: str
    place: str  # the camera's place that shows it best

    @property
    def pose(self) -> Transform:
        """`T_AM`: the marker (x right, y up, z out of the print) in the apartment."""
        upright = np.eye(3)
        if self.facing != "up":
            upright = rotation_z(self.facing + 90.0) @ rotation_x(90.0)
        return Transform(upright @ rotation_z(self.spin_deg), np.array(self.position, float))


class Pose2D(Section):
    """A place and a heading on the floor."""

    x: float
    y: float
    yaw_deg: float = 0.0

    @property
    def transform(self) -> Transform:
        """The same as a motion in space."""
        return Transform(rotation_z(self.yaw_deg), np.array([self.x, self.y, 0.0]))


class WorldRobot(Section):
    """A robot; `pose` is in the map frame."""

    pose: Pose2D


class WorldMap(Section):
    """The robot's map: metres per cell, its origin as in map_server, and the apartment frame's pose in the map."""

    resolution: PositiveFloat = 0.05
    origin: XYZ = (0.0, 0.0, 0.0)
    apartment_to_map: Pose2D

    def to_apartment(self, points: Array) -> Array:
        """Points (n, 3) of the map frame in the apartment frame."""
        return self.apartment_to_map.transform.inverse().apply(points)


class World(Section):
    """Everything that stands, hangs or lies in the apartment."""

    light: float = Field(default=LAMP_LUX, ge=0, le=100_000)  # lux, everywhere
    rooms: dict[str, Room]
    walls: tuple[Wall, ...]
    furniture: tuple[Furniture, ...] = ()
    markers: tuple[Marker, ...] = ()
    boards: dict[str, HeldBoard] = Field(default_factory=dict)
    cameras: dict[str, WorldCamera] = Field(default_factory=dict)
    robots: dict[str, WorldRobot] = Field(default_factory=dict)
    map: WorldMap

    @field_validator("furniture")
    @classmethod
    def labels_are_unique(cls, furniture: tuple[Furniture, ...]) -> tuple[Furniture, ...]:
        if twice := [label for label, n in Counter(f.label for f in furniture).items() if n > 1]:
            raise ValueError(f"expected every label once, got {', '.join(map(repr, twice))} again")
        return furniture

    def faults(self) -> Iterator[tuple[Path_, str]]:
        """What does not hang together: where it stands, and what was expected."""
        yield from self._unknown_names()
        yield from self._unreachable_places()

    def _unknown_names(self) -> Iterator[tuple[Path_, str]]:
        pieces = {piece.label for piece in self.furniture}
        places = {place for camera in self.cameras.values() for place in camera.places}
        for index, piece in enumerate(self.furniture):
            if piece.room not in self.rooms:
                yield ("furniture", index, "room"), _one_of(self.rooms, piece.room)
        for index, marker in enumerate(self.markers):
            for field, known in (("room", set(self.rooms)), ("where", pieces), ("place", places)):
                if (name := getattr(marker, field)) not in known:
                    yield ("markers", index, field), _one_of(sorted(known), name)

    def _unreachable_places(self) -> Iterator[tuple[Path_, str]]:
        for name, camera in self.cameras.items():
            for label, place in camera.places.items():
                pan, tilt = camera.aim(place.looks_at)
                if not camera.reaches(pan, tilt):
                    where = ("cameras", name, "places", label, "looks_at")
                    yield where, f"expected readings in reach, got pan {pan:.1f} and tilt {tilt:.1f}"

    def marker(self, marker_id: int) -> Marker:
        """The marker with this id; KeyError when there is none."""
        for marker in self.markers:
            if marker.id == marker_id:
                return marker
        raise KeyError(marker_id)


def _one_of(known: Iterable[str], got: str) -> str:
    return f"expected one of {', '.join(known)}, got {got!r}"


def load(path: Path) -> World:
    """Reads a world; ConfigError lists everything that is wrong with the file, with the line."""
    source = document.read(path)
    world = None if source.faults else _world(source)
    for where, text in world.faults() if world else ():
        source.fault(where, text)
    if world is None or source.faults:
        raise ConfigError(source.faults)
    return world


def _world(source: Document) -> World | None:
    try:
        return World.model_validate(source.value)
    except ValidationError as fault:
        for error in fault.errors():
            got = "" if error["type"] in ("missing", "value_error") else f", got {error['input']!r}"
            source.fault(error["loc"], error["msg"].removeprefix("Value error, ") + got)
        return None
