"""Where each marker was seen last, by whom and how sure. Pure: sightings in, the newest out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

from services.errors import BadMessage
from services.mission.state import XYZ
from services.payloads import LARGEST, Point, ScanResult, seconds, stamp
from services.payloads.robot import Whereabouts

MOST = 20_000  # sightings: every marker by two


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

    def note(self, sighting: Sighting, now: float) -> bool:
        """Keeps it, unless that one has seen the marker later; whether it was news.

        Nobody has seen anything later than now: a clock that was ahead would hide all that comes for as long.
        """
        key = (sighting.marker, sighting.by)
        known = self._newest.pop(key, None)
        if known is not None and known.at >= min(sighting.at, now):
            self._newest[key] = known
            return False
        self._newest[key] = replace(sighting, at=min(sighting.at, now))
        if len(self._newest) > MOST:
            del self._newest[next(iter(self._newest))]
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
                position=point(one.position),
                sigma_m=one.sigma_m,
                age_s=round(max(0.0, now - one.at), 1),
                stamp=stamp(one.at),
            )
            for one in self.of(marker)
        ]


def point(at: XYZ | None) -> Point | None:
    """For a payload; None too where turning it into the apartment's frame has left what a payload can say."""
    if at is None or any(abs(one) > LARGEST for one in at):
        return None
    return Point(**dict(zip("xyz", at, strict=True)))


def by_camera(result: ScanResult, camera: str) -> Sighting:
    """What that camera's scan found; BadMessage when it speaks for another."""
    if result.camera != camera:
        raise BadMessage(f"camera: expected {camera}, got {result.camera[:80]!r}")
    position = None if result.position is None else (result.position.x, result.position.y, result.position.z)
    sigma = None if result.covariance is None else sqrt(max(0.0, sum(result.covariance[k][k] for k in range(3))))
    return Sighting(result.camera, result.marker, result.place, seconds(result.stamp), position, _normal(result), sigma)


def _normal(result: ScanResult) -> XYZ | None:
    """The third column of the rotation that the quaternion stands for."""
    q = result.orientation
    if q is None:
        return None
    return 2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x), 1 - 2 * (q.x * q.x + q.y * q.y)
