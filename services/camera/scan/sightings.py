"""From what was seen in a scan to its results: the views of each marker, fused into one place in the apartment. Pure.

The geometry is in `vision/pose.py` and `vision/frames.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import acos, atan, atan2, cos, degrees, hypot, radians, sin

import numpy as np

from services.camera.device import Reading
from services.payloads import Point, Quaternion, ScanResult, WeightedQuaternion, stamp
from services.vision.detect import Detection
from services.vision.frames import Array, Kind, Mount, axes_in_apartment, camera_in_apartment, quaternion
from services.vision.lens import Lens
from services.vision.pose import Located, View, locate_each
from services.vision.prior import Prior
from services.vision.views import BLOOM_PX
from services.vision.zoom import WIDEST, Level, Magnification, at_level

LEAST_TIMES = 1.1  # what a zoom magnifies by at least, of which that is not known
MOST_SLACK_DEG = 3.0
HALF_HEIGHT = 9 / 16  # over the focal length, of a lens that is not known: about 90 degrees wide
CUT_OFF_PX = 0.06  # all sides seem 0.03 to 0.09 px outwards or inwards where light is cut off
AT_EDGE = 6.0  # times the noise of corners where the picture's edge cuts the marker: 0.08 px
WELL_KNOWN = 0.01  # share of the magnification's uncertainty above which no distance is told: 5 cm at 5 m


@dataclass(frozen=True)
class Sighting:
    """One marker in one frame: `at` when it was taken, `size` of the picture (width, height).

    `magnified`: as it was measured against the widest picture from there (`vision/zoom.py`); None: it was not.
    `cut_off`: its light or its dark is cut off, so that its edges are less exact (`vision/exposure.py`).
    """

    detection: Detection
    place: str
    reading: Reading
    at: float
    size: tuple[int, int]
    magnified: Magnification | None = None
    cut_off: bool = False

    @property
    def off_centre(self) -> float:
        """How far from the middle of the picture, as a share of its width."""
        x, y = np.asarray(self.detection.corners, float).mean(axis=0)
        width, height = self.size
        return hypot(x - (width - 1) / 2, y - (height - 1) / 2) / width

    def bearing(self, kind: Kind) -> tuple[float, float]:
        """Roughly the pan and tilt readings that would bring it to the middle of the picture (90 degrees wide)."""
        x, y = np.asarray(self.detection.corners, float).mean(axis=0)
        width, height = self.size
        sign = 1.0 if kind == "ceiling" else -1.0  # which way the readings grow, in the upright picture
        right, down = sign * (x - width / 2) / (width / 2), sign * (y - height / 2) / (width / 2)
        tilt = radians(self.reading.tilt)
        ahead, below = cos(tilt) - down * sin(tilt), sin(tilt) + down * cos(tilt)
        return self.reading.pan + degrees(atan2(right, ahead)), degrees(atan2(below, hypot(right, ahead)))


def between(one: tuple[float, float], other: tuple[float, float]) -> float:
    """The angle between two directions given as pan and tilt, degrees."""
    (pan, tilt), (pan_2, tilt_2) = (tuple(map(radians, pair)) for pair in (one, other))
    cosine = sin(tilt) * sin(tilt_2) + cos(tilt) * cos(tilt_2) * cos(pan - pan_2)
    return degrees(acos(max(-1.0, min(1.0, cosine))))


@dataclass(frozen=True)
class Eye:
    """What is known of the camera; `lens` or `mount` None: no positions. `levels`: its calibrated zoom."""

    camera: str
    dictionary: str
    lens: Lens | None
    mount: Mount | None
    widest: float = 0.0  # the zoom at which the lens was calibrated
    levels: tuple[Level, ...] = ()
    angle_noise_deg: float = 0.05  # standard deviation of a reading
    mount_doubt: Array | None = None  # covariance (6, 6) of the mount's place (m) and turn (rad, apartment's axes)

    def slack_deg(self, zoom: float) -> float:
        """How far beside a place saved at this zoom the widest picture still shows all that was seen from there."""
        if zoom < self.widest + 1.0:
            return 0.0
        known = at_level(self.levels, zoom)
        times = LEAST_TIMES if known is None else max(1.0, known.times)
        half = HALF_HEIGHT if self.lens is None else self.lens.height / 2 / self.lens.focal
        return min(MOST_SLACK_DEG, degrees(atan(half) - atan(half / times)))

    def magnification(self, seen: Sighting) -> Magnification | None:
        """Of the picture of a sighting: measured, or by the table; None where neither tells it well enough."""
        if seen.magnified is not None:
            known: Magnification | None = seen.magnified
        else:
            known = WIDEST if seen.reading.zoom <= self.widest else at_level(self.levels, seen.reading.zoom)
        return known if known is not None and known.relative <= WELL_KNOWN else None


@dataclass(frozen=True)
class Sought:
    """What is known of a marker before it is seen: the side of its black square, and how it hangs or lies."""

    marker: int
    size_m: float
    prior: Prior | None = None


def results(eye: Eye, sought: Sought, seen: Sequence[Sighting], scan: str, mode: str) -> list[ScanResult]:
    """The results for one marker, from all frames of a scan that show it (at least one); the newest place first.

    There are several where it was seen at several places at a time. A place that it has left is none.
    """
    located, why = _located(eye, sought, seen)
    if not located:
        return [_result(eye, sought.marker, seen, scan, mode, why, None)]
    return [
        _result(eye, sought.marker, [sightings[index] for index in one.used], scan, mode, None, one)
        for one, sightings in located
    ]


def _result(
    eye: Eye, marker: int, seen: Sequence[Sighting], scan: str, mode: str, why: str | None, located: Located | None
) -> ScanResult:
    best = min(seen, key=lambda sighting: sighting.off_centre)
    return ScanResult(
        camera=eye.camera,
        marker=marker,
        dictionary=eye.dictionary,
        place=best.place,
        zoom=best.reading.zoom,
        frames=len(seen),
        mode=mode,
        first_seen=stamp(min(sighting.at for sighting in seen)),
        stamp=stamp(max(sighting.at for sighting in seen)),
        scan=scan,
        why=why,
        **_geometry(located),
    )


Placed = list[tuple[Located, list[Sighting]]]


def _located(eye: Eye, sought: Sought, seen: Sequence[Sighting]) -> tuple[Placed, str | None]:
    """Where it is, each with the sightings that its views are of; and why there is nothing."""
    if eye.lens is None or eye.mount is None:
        return [], "the camera has no camera_info" if eye.lens is None else "the camera has no mount"
    known = [(sighting, eye.magnification(sighting)) for sighting in seen]
    measured = [(sighting, magnified) for sighting, magnified in known if magnified is not None]
    if not measured:
        return [], f"how much zoom {seen[0].reading.zoom:g} magnifies is not known well enough to tell the distance"
    views = [_view(eye, eye.lens, eye.mount, sought, sighting, magnified) for sighting, magnified in measured]
    try:
        found = [_hung(one, eye.mount, eye.mount_doubt) for one in locate_each(views, sought.prior)]
        return [(one, [sighting for sighting, _ in measured]) for one in found], None
    except ValueError as error:
        return [], str(error)


def _hung(located: Located, mount: Mount, doubt: Array | None) -> Located:
    """With what the mount's own place and turn add: all sights share it, so no number of them takes it away."""
    if doubt is None:
        return located
    x, y, z = located.position - np.array(mount.position)
    moved = np.hstack((np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]))  # the marker, by place and turn
    return replace(located, covariance=located.covariance + moved @ doubt @ moved.T)


def _view(eye: Eye, lens: Lens, mount: Mount, sought: Sought, sighting: Sighting, magnified: Magnification) -> View:
    reading, zoomed = sighting.reading, magnified.through(lens.scaled(*sighting.size))
    times, size = max(1.0, magnified.times), sighting.size
    return View(
        lens=zoomed,
        camera=camera_in_apartment(mount, reading.pan, reading.tilt),
        corners=np.asarray(sighting.detection.corners, float),
        size_m=sought.size_m,
        angle_noise_deg=eye.angle_noise_deg,
        focal_doubt=magnified.relative,
        aside_deg=degrees(magnified.aside * zoomed.width / zoomed.focal),
        enlarged=times * (1.0 if sighting.detection.whole(*size) else AT_EDGE),
        bloom_px=times * (CUT_OFF_PX if sighting.cut_off else BLOOM_PX),
        axes=axes_in_apartment(mount, reading.pan, reading.tilt),
        at=sighting.at,
        sides=sighting.detection.sides,
    )


def _geometry(located: Located | None) -> dict[str, object]:
    if located is None:
        return {"position": None}
    x, y, z = (float(value) for value in located.position)
    ways = [
        WeightedQuaternion(**_quaternion(rotation), weight=float(weight)) for rotation, weight in located.orientations
    ]
    return {
        "position": Point(x=x, y=y, z=z),
        "covariance": [[float(value) for value in row] for row in located.covariance],
        "orientation": Quaternion(**ways[0].model_dump(exclude={"weight"})) if len(ways) == 1 else None,
        "orientations": ways,
        "distance": float(located.distance),
    }


def _quaternion(rotation: Array) -> dict[str, float]:
    return dict(zip("xyzw", quaternion(rotation), strict=True))
