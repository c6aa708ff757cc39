"""Corners of a black square to a few hundredths of a pixel: lines fitted to its edges (squared-gradient centroids)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
REACH = np.linspace(-1.5, 1.5, 25)  # px across the edge: less than a module


def refined(grey: NDArray[np.uint8], corners: Array) -> Array:
    """Corners (4, 2) near the given ones."""
    for _ in range(3):
        lines = [_line(grey, corners[i], corners[(i + 1) % 4]) for i in range(4)]
        corners = np.array([_meet(lines[i - 1], lines[i]) for i in range(4)])
    return corners


def _line(grey: NDArray[np.uint8], a: Array, b: Array) -> Array:
    """The edge from a to b as (x, y, 1)-coefficients."""
    along = (b - a) / np.linalg.norm(b - a)
    across = np.array([-along[1], along[0]])
    foot = a + np.linspace(0.15, 0.85, 40)[:, None] * (b - a)
    at = (foot[:, None] + REACH[None, :, None] * across).astype(np.float32)
    profile = cv2.remap(grey.astype(np.float32), at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    weight = np.gradient(profile, axis=1) ** 2
    points = foot + ((weight * REACH).sum(axis=1) / weight.sum(axis=1))[:, None] * across
    vx, vy, x, y = cv2.fitLine(points.astype(np.float32), cv2.DIST_HUBER, 0, 0.001, 0.001).ravel()
    return np.array([-vy, vx, vy * x - vx * y])


def _meet(one: Array, other: Array) -> Array:
    x, y, w = np.cross(one, other)
    return np.array([x / w, y / w])
