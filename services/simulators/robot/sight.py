"""What the robot's own camera sees: markers in range, in its field of view, turned to it, with nothing in between."""

from __future__ import annotations

from math import acos, atan2, degrees

import numpy as np

from services.simulators.camera.view.solids import Box
from services.simulators.world import Marker
from services.vision.frames import Array

EYE_M = 1.1  # height of the camera over the floor; the head looks up and down as it needs to
RANGE_M = 3.0  # at which a marker of 0.14 m can still be read; a smaller one nearer
FIELD_DEG = 57.0  # across
STEEPEST_DEG = 68.0  # from which a print is too oblique


def seen(at: Array, yaw_deg: float, markers: tuple[Marker, ...], boxes: list[Box]) -> list[tuple[Marker, float]]:
    """The markers that are seen and their distances, from a place (x, y) and heading in the apartment frame."""
    eye = np.array([at[0], at[1], EYE_M])
    return [(marker, far) for marker in markers if (far := _distance(eye, yaw_deg, marker, boxes)) is not None]


def _distance(eye: Array, yaw_deg: float, marker: Marker, boxes: list[Box]) -> float | None:
    pose = marker.pose
    way = pose.translation - eye
    far = float(np.linalg.norm(way))
    aside = abs((degrees(atan2(way[1], way[0])) - yaw_deg + 180) % 360 - 180)
    oblique = degrees(acos(float(np.clip(-way @ pose.rotation[:, 2] / far, -1, 1))))
    if far > RANGE_M * marker.size / 0.14 or aside > FIELD_DEG / 2 or oblique > STEEPEST_DEG:
        return None
    point = (eye + way * (1 - 0.02 / far))[None]
    return None if any(box.hides(eye, point)[0] for box in boxes if box.may_hide(eye, point)) else far
