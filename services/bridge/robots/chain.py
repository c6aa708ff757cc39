"""Where a robot's frames are, from the transforms that it says (tf): the chain between two of them, at a time. Pure.

Frames and messages as in tf2: a child has one parent; ids have no slash at their beginning (older robots write one).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from math import atan2, degrees

import numpy as np

from services.bridge.rules import Fields
from services.vision.frames import Array, Transform

KEPT = 60  # transforms of one child: what 20 a second say in three seconds
FARTHEST = 1e9  # metres
LONGEST = 50  # frames in a chain; more is a ring


class Chain:
    """Keeps what was said lately of each frame."""

    def __init__(self) -> None:
        self._said: dict[str, deque[tuple[float, str, Transform]]] = {}

    def note(self, transforms: Iterable[Fields], *, fixed: bool = False) -> None:
        """Takes a TFMessage's transforms; `fixed`: those of /tf_static."""
        for one in transforms:
            child, header = _plain(one["child_frame_id"]), one["header"]
            try:
                there = transform(one["transform"])
            except ValueError:  # tf leaves them out as well, and says so
                continue
            known = self._said.setdefault(child, deque(maxlen=KEPT))
            if fixed:
                known.clear()
            known.append((float(header["stamp"]), _plain(header["frame_id"]), there))

    def between(self, parent: str, child: str, stamp: float | None = None) -> Transform | None:
        """The child in its (grand)parent; None when nobody has said so. `stamp`: when, as near as it is known."""
        found = Transform(np.eye(3), np.zeros(3))
        frame, goal = _plain(child), _plain(parent)
        for _ in range(LONGEST):
            if frame == goal:
                return found
            if frame not in self._said:
                return None
            _, frame, step = self._at(frame, stamp)
            found = step @ found
        return None

    def _at(self, frame: str, stamp: float | None) -> tuple[float, str, Transform]:
        said = tuple(self._said[frame])
        return said[-1] if stamp is None else min(said, key=lambda one: abs(one[0] - stamp))


def transform(fields: Fields) -> Transform:
    """Of a geometry_msgs/Transform, or of a Pose; ValueError when it is nowhere: NaN, or too far."""
    at = fields.get("translation") or fields["position"]
    turned = fields.get("rotation") or fields["orientation"]
    q = np.array([float(turned[name]) for name in "xyzw"])
    place = np.array([float(at[name]) for name in "xyz"])
    if not (np.abs([*place, *q]) <= FARTHEST).all():
        raise ValueError(f"expected finite numbers up to {FARTHEST:g}")
    return Transform(_rotation(q), place)


def yaw_deg(where: Transform) -> float:
    """The heading of a body that stands upright, counter-clockwise from x."""
    return degrees(atan2(where.rotation[1, 0], where.rotation[0, 0]))


def _rotation(q: Array) -> Array:
    length = float(np.linalg.norm(q))
    if not length > 0:
        return np.eye(3)
    x, y, z, w = q / length
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def _plain(frame: object) -> str:
    return str(frame).lstrip("/")
