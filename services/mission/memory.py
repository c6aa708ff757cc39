"""Where each marker was seen last, by whom and how sure. Pure: sightings in, the newest out."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from services.mission.state import XYZ
from services.payloads import Point, ScanResult, seconds, stamp
from services.robot_payloads import Whereabouts


@dataclass(frozen=True)
class Sighting:
    """One: `position` and `normal` (out of the print) in the apartment frame, `sigma_m` of the position."""

    by: str
    marker: int
    place: str
    at: float  # seconds since 1970
    position: XYZ | None = None
    normal: XYZ | None = None
    sigma_m: float | None = None


class Memory:
    """The newest sighting of each marker by each who sees."""

    def __init__(self) -> None:
        self._newest: dict[tuple[int, str], Sighting] = {}

    def note(self, sighting: Sighting) -> bool:
        """Keeps it, unless that one has seen the marker later; whether it was news."""
        key = (sighting.marker, sighting.by)
        known = self._newest.get(key)
        if known is not None and known.at >= sighting.at:
            return False
        self._newest[key] = sighting
        return True

    def of(self, marker: int) -> list[Sighting]:
        """Newest first."""
        return sorted((one for one in self._newest.values() if one.marker == marker), key=lambda one: -one.at)

    def told(self, marker: int, now: float) -> list[Whereabouts]:
        """The same for those who ask."""
        return [
            Whereabouts(
                by=one.by,
                place=one.place or None,
                position=None if one.position is None else Point(**dict(zip("xyz", one.position, strict=True))),
                sigma_m=one.sigma_m,
                age_s=round(max(0.0, now - one.at), 1),
                stamp=stamp(one.at),
            )
            for one in self.of(marker)
        ]


def by_camera(result: ScanResult) -> Sighting:
    """What a camera's scan found."""
    position = None if result.position is None else (result.position.x, result.position.y, result.position.z)
    sigma = None if result.covariance is None else sqrt(max(0.0, sum(result.covariance[k][k] for k in range(3))))
    return Sighting(result.camera, result.marker, result.place, seconds(result.stamp), position, _normal(result), sigma)


def _normal(result: ScanResult) -> XYZ | None:
    """The third column of the rotation that the quaternion stands for."""
    q = result.orientation
    if q is None:
        return None
    return 2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x), 1 - 2 * (q.x * q.x + q.y * q.y)
