"""A camera as it really is: mount, lens, limits, and the places that it has stored. A part of the world's file."""

from __future__ import annotations

from math import asin, atan2, degrees, hypot

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt

from services.section import Section
from services.vision.frames import Kind, Mount, Transform, base_in_apartment, camera_in_apartment

XY = tuple[float, float]
XYZ = tuple[float, float, float]


class Lens(Section):
    """The true lens of the upright picture at the widest zoom: pixels, and distortion k1 k2 p1 p2 k3 as in OpenCV."""

    width: PositiveInt
    height: PositiveInt
    fx: PositiveFloat
    fy: PositiveFloat
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)


class TrueMount(Section):
    """How the camera really hangs; the fields are those of `vision.frames.Mount`."""

    position: XYZ
    kind: Kind = "ceiling"
    yaw_deg: float = 0.0
    lean_deg: XY = (0.0, 0.0)
    pan_to_tilt_m: XY = (0.0, 0.0)
    tilt_to_lens_m: XY = (0.0, 0.0)
    sensor_roll_deg: float = 0.0
    tilt_zero_deg: float = 0.0

    @property
    def frames(self) -> Mount:
        """The same for the kinematics."""
        return Mount(**self.model_dump())


class Place(Section):
    """A place as the camera remembers it: the number of its preset and the point that it looks at."""

    preset: PositiveInt
    looks_at: XYZ


class WorldCamera(Section):
    """A camera as it is: mount, lens, limits (degrees, as it reads them) and what it has stored."""

    mount: TrueMount
    lens: Lens
    pan_dead_arc: XY = (179.0, 186.0)
    tilt_range: XY = (-10.0, 108.0)
    serial: str = "AMC0000000000001"
    starts_at: XYZ = (0.0, 20.0, 0.0)  # pan, tilt, zoom after power-on
    places: dict[str, Place] = Field(default_factory=dict)

    def aim(self, point: XYZ) -> tuple[float, float]:
        """The pan (0..360) and tilt readings at which the optical axis goes through a point of the apartment.

        Closed form: the lens stays in the plane through the pan axis and the optical axis, so pan is the point's
        azimuth in the base frame and tilt a right triangle in that plane.
        """
        mount = self.mount.frames
        x, y, z = base_in_apartment(mount).inverse().apply(np.array(point, float))
        forward, away = mount.pan_to_tilt_m
        out, off = hypot(x, y) - forward, z - away
        side = mount.tilt_to_lens_m[1] * (-1.0 if mount.kind == "ceiling" else 1.0)
        tilt = atan2(off, out) - asin(side / hypot(out, off))
        return degrees(atan2(y, x)) % 360.0, degrees(tilt) + mount.tilt_zero_deg

    def reaches(self, pan: float, tilt: float) -> bool:
        """Whether the motors can stand at these readings."""
        inside = self.pan_dead_arc[0] < pan % 360.0 < self.pan_dead_arc[1]
        return not inside and self.tilt_range[0] <= tilt <= self.tilt_range[1]

    def pose(self, pan: float, tilt: float) -> Transform:
        """`T_AC` at these readings."""
        return camera_in_apartment(self.mount.frames, pan, tilt)
