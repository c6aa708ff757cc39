"""From where a robot can follow a lead: poses on its map that face the marker, and its named points.

Without a map it looks from the named points alone. Not here: how good a stand is (`standing.py`), the robot's file
(`services/apartment/robot_places.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, degrees, hypot

from services.apartment.floor import Grid
from services.apartment.robot_places import RobotPlaces
from services.mission.standing import ANY, Pose, View, body, stands
from services.mission.state import HERE, ROUND, XYZ, Lead, Stand

TURNS_DEG = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)  # of a look around; a robot's camera sees about 60 degrees
FLAT = 0.5  # a marker whose normal rises more than this lies rather than hangs


@dataclass(frozen=True, eq=False)
class Chart:
    """One robot's."""

    places: RobotPlaces
    grid: Grid | None = None

    def here(self, pose: Pose) -> Lead:
        """Looking round from where the robot stands."""
        turned = [Stand(pose.x, pose.y, pose.yaw_deg + turn, away=turn > 0) for turn in TURNS_DEG]
        return Lead(HERE, tuple(turned), "where it stands")

    def round(self, pose: Pose) -> tuple[Lead, ...]:
        """All named points, the nearest one next."""
        left, at, leads = dict(self.places.points), (pose.x, pose.y), []
        while left:
            name = min(left, key=lambda one: hypot(left[one].x - at[0], left[one].y - at[1]))
            point = left.pop(name)
            at = (point.x, point.y)
            turned = [Stand(point.x, point.y, point.yaw_deg + turn) for turn in TURNS_DEG[1:]]
            leads.append(Lead(ROUND, (Stand(point=name), *turned), name))
        return tuple(leads)

    def lead(
        self, by: str, place: str, position: XYZ | None, normal: XYZ | None, stamp: float, robot: Pose
    ) -> Lead | None:
        """What a sighting leads to; `position` and `normal` (out of the print) in the apartment frame.

        None when the robot has no way to look there: no map, and no point of that name.
        """
        found = self._poses(position, normal, robot) if position is not None else []
        named = self._point(place, position)
        chosen = (*(Stand(one.x, one.y, one.yaw_deg) for one in found), *([Stand(point=named)] if named else []))
        return Lead(by, chosen, place, position, stamp) if chosen else None

    def _poses(self, position: XYZ, normal: XYZ | None, robot: Pose) -> list[Pose]:
        if self.grid is None:
            return []
        facing, view = None, ANY
        if normal is not None and abs(normal[2]) < FLAT:
            facing = self.places.apartment_to_map.yaw_deg + _azimuth(normal)
        elif normal is not None and self.places.eye > position[2]:
            view = View.down(self.places.eye - position[2])
        who = body(self.grid, self.places.radius, (robot.x, robot.y))
        return stands(self.grid, who, self.places.apartment_to_map.to_map(*position[:2]), facing, view)

    def _point(self, place: str, position: XYZ | None) -> str | None:
        """The point of the place's name, else the one nearest to the marker."""
        named = self.places.named(place)
        if named is not None or position is None or not self.places.points:
            return named
        x, y = self.places.apartment_to_map.to_map(*position[:2])
        known = self.places.points
        return min(known, key=lambda one: hypot(known[one].x - x, known[one].y - y))


def _azimuth(direction: XYZ) -> float:
    return degrees(atan2(direction[1], direction[0]))
