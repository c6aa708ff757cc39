"""Markers that the house and a robot have both seen: the same point in the apartment and in the robot's map. Pure.

A robot's sighting counts when it stood still, since what its camera and its odometry say is not of the same moment.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import dist
from statistics import median

from services.apartment.floor import XY
from services.payloads import ScanResult
from services.payloads.robot import RobotPose, RobotSeen

STILL_M, STILL_DEG = 0.01, 0.5  # between two poses


@dataclass
class Both:
    """What was heard so far; hand it the messages of one robot alone."""

    house: dict[int, ScanResult] = field(default_factory=dict)
    robot: dict[int, list[XY]] = field(default_factory=dict)
    pose: RobotPose | None = None
    still: bool = False

    def hears(self, said: object) -> None:
        """Takes what a camera found, where the robot is, and what it sees; anything else changes nothing."""
        if isinstance(said, ScanResult):
            if said.position is not None and _doubt(said) <= _doubt(self.house.get(said.marker)):
                self.house[said.marker] = said
        elif isinstance(said, RobotPose):
            self.still = self.pose is not None and _near(self.pose, said)
            self.pose = said
        elif isinstance(said, RobotSeen) and self.still:
            for one in said.markers:
                if one.position is not None:
                    self.robot.setdefault(one.marker, []).append((one.position.x, one.position.y))

    def pairs(self) -> dict[int, tuple[XY, XY]]:
        """By marker: where the surest camera has it in the apartment, and the median of where the robot does."""
        found = {}
        for marker, result in sorted(self.house.items()):
            seen = self.robot.get(marker)
            if seen and result.position is not None:
                there = median(x for x, _ in seen), median(y for _, y in seen)
                found[marker] = ((result.position.x, result.position.y), there)
        return found


def _doubt(result: ScanResult | None) -> float:
    """Variance in the plane, square metres; that of one which does not tell is infinite."""
    if result is None or result.covariance is None:
        return float("inf")
    return result.covariance[0][0] + result.covariance[1][1]


def _near(one: RobotPose, other: RobotPose) -> bool:
    turned = abs((one.yaw_deg - other.yaw_deg + 180) % 360 - 180)
    return dist((one.x, one.y), (other.x, other.y)) < STILL_M and turned < STILL_DEG
