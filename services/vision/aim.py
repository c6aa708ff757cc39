"""From a point to the readings at which the camera looks at it: the reverse of `frames`."""

from __future__ import annotations

from math import asin, atan2, degrees, hypot

from services.vision.frames import Array, Mount, base_in_apartment


def readings_at(mount: Mount, point: Array) -> tuple[float, float]:
    """Pan (0..360) and tilt, degrees, at which the optical axis goes through a point (3,) of the apartment.

    The lens stays in the plane through the pan axis and the optical axis, so pan is the point's azimuth in the base
    and tilt a right triangle in that plane. Whether the motors can stand there is not asked.
    """
    x, y, z = (float(value) for value in base_in_apartment(mount).inverse().apply(point))
    forward, away = mount.pan_to_tilt_m
    out, off = hypot(x, y) - forward, z - away
    side = mount.tilt_to_lens_m[1] * (-1.0 if mount.kind == "ceiling" else 1.0)
    tilt = atan2(off, out) - asin(max(-1.0, min(1.0, side / max(hypot(out, off), 1e-9))))
    return degrees(atan2(y, x)) % 360.0, degrees(tilt) + mount.tilt_zero_deg
