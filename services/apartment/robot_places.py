"""A robot's own file (`robot_places.yaml`): its named points, its map, and where the apartment lies in that map.

Read by whoever speaks for a robot or sends one; nothing else says where the apartment lies in the map. Not here: from
where a robot can see something (`mission/standing.py`), how the relation is estimated (`vision/calibrate_map.py`).
"""

from __future__ import annotations

import re
from math import cos, radians, sin
from pathlib import Path

from pydantic import Field, ValidationError

from services import document
from services.apartment import floor
from services.apartment.floor import XY, Grid
from services.errors import ConfigError
from services.section import Section

PLACE, ANGLE = 4, 3  # decimals of what is written: a tenth of a millimetre, a thousandth of a degree
KEY = "apartment_to_map"
COMMENT = re.compile(r"\s+#.*$")


class Relation(Section):
    """The apartment frame's pose in the map frame."""

    x: float = 0.0
    y: float = 0.0
    yaw_deg: float = 0.0

    def to_map(self, x: float, y: float) -> XY:
        """A point of the apartment in the map, metres."""
        c, s = cos(radians(self.yaw_deg)), sin(radians(self.yaw_deg))
        return self.x + c * x - s * y, self.y + s * x + c * y

    def to_apartment(self, x: float, y: float) -> XY:
        """The reverse."""
        c, s = cos(radians(self.yaw_deg)), sin(radians(self.yaw_deg))
        return c * (x - self.x) + s * (y - self.y), -s * (x - self.x) + c * (y - self.y)


class PointPose(Section):
    """A named point: where the robot stands there, in the map frame."""

    x: float
    y: float
    yaw_deg: float = 0.0


class RobotPlaces(Section):
    """The file."""

    map: Path | None = None  # map_server's YAML, beside this file
    apartment_to_map: Relation = Relation()
    radius: float = Field(default=0.28, gt=0, lt=2)  # of the robot, metres
    eye: float = Field(default=1.1, gt=0, lt=3)  # height of its camera over the floor, metres
    points: dict[str, PointPose] = {}

    def named(self, name: str) -> str | None:
        """The point's name as the file writes it, without regard to case; None when there is none."""
        return {one.casefold(): one for one in self.points}.get(name.strip().casefold())


def places(file: Path) -> RobotPlaces:
    """The file alone; ConfigError tells every fault with file and line."""
    return _read(file)[0]


def read(file: Path) -> tuple[RobotPlaces, Grid | None]:
    """The file, and the map that it names; ConfigError tells every fault with file and line."""
    found, source = _read(file)
    grid = floor.read(file.parent / found.map) if found.map else None
    if grid is not None and grid.yaw:
        source.fault(("map",), "expected a map that is not turned (the third number of its origin 0)")
        raise ConfigError(source.faults)
    return found, grid


def _read(file: Path) -> tuple[RobotPlaces, document.Document]:
    source = document.read(file)
    found = None
    if not source.faults:
        try:
            found = RobotPlaces.model_validate(source.value or {})
        except ValidationError as fault:
            for error in fault.errors(include_url=False):
                source.fault(error["loc"], f"expected {error['msg']}, got {error['input']!r:.80}")
    if found is None or source.faults:
        raise ConfigError(source.faults)
    return found, source


def with_relation(text: str, relation: Relation) -> str:
    """The file's text with this relation, comments and all else as they were; one without it gets it at its end."""
    x, y, yaw = round(relation.x, PLACE), round(relation.y, PLACE), round(relation.yaw_deg, ANGLE)
    line, lines = f"{KEY}: {{x: {x + 0.0}, y: {y + 0.0}, yaw_deg: {yaw + 0.0}}}", text.splitlines()
    at = next((index for index, one in enumerate(lines) if one.startswith(f"{KEY}:")), None)
    if at is None:
        return "\n".join([*lines, line, ""])
    end = next((index for index in range(at + 1, len(lines)) if not lines[index].startswith((" ", "\t"))), len(lines))
    comment = COMMENT.search(lines[at])
    kept = [one for one in lines[at + 1 : end] if one.lstrip().startswith("#")]
    return "\n".join([*lines[:at], line + (comment[0] if comment else ""), *kept, *lines[end:], ""])
