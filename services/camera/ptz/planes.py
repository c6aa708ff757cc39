"""How large the scale of the relative form is at each zoom: the tangent of its end, a point of the picture's plane.

The tangents of both axes shrink alike when zoom makes the picture larger, at levels near each other by about as much
more or less than is thought. A Kalman filter over their logarithms keeps the guess and its doubt: one hop teaches
both axes and all levels, each as far as it tells. Pure. What a hop tells: `scale.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp, hypot

import numpy as np

from services.camera.ptz.pace import Vector, taught

GUESS = (1.0, 0.56)  # pan and tilt at the widest zoom
LEVELS = 9  # 0 to 8
DOUBT = 0.5  # of the guess, as a share
LEVEL_DOUBT, ALONE_DOUBT, APART = 0.1, 0.02, 3.0  # of a level's magnification: with its neighbours, on its own
AGE = 0.005  # more doubt about each with every hop
BENT = 0.2  # of what was off: a tangent is no straight line
AXES = 2


def larger(zoom: float) -> float:
    """How much the picture grows with zoom, about."""
    return 1.0 + zoom / 4.0


def growth(zoom: float) -> float:
    """By which share it grows there with one level more."""
    return 1.0 / (4.0 + zoom)


def _doubts() -> Vector:
    levels = np.arange(LEVELS)
    apart = (levels[:, None] - levels[None, :]) / APART
    cov = np.zeros((AXES + LEVELS, AXES + LEVELS))
    cov[:AXES, :AXES] = DOUBT**2 * np.eye(AXES)
    cov[AXES:, AXES:] = LEVEL_DOUBT**2 * np.exp(-np.square(apart) / 2) + ALONE_DOUBT**2 * np.eye(LEVELS)
    return cov


@dataclass
class Planes:
    """The logarithms of both tangents over the guess, then of each level's; and their covariance."""

    mean: Vector = field(default_factory=lambda: np.zeros(AXES + LEVELS))
    cov: Vector = field(default_factory=_doubts)

    def at(self, zoom: float) -> tuple[float, float]:
        """The tangents of pan and tilt at a zoom."""
        pan, tilt = (
            guess * exp(float(self.weights(axis, zoom) @ self.mean)) / larger(zoom) for axis, guess in enumerate(GUESS)
        )
        return pan, tilt

    def weights(self, axis: int, zoom: float) -> Vector:
        """How far each number counts for a tangent's logarithm."""
        found = np.zeros(AXES + LEVELS)
        found[axis] = 1.0
        at = min(LEVELS - 1.0, max(0.0, zoom))
        below = min(LEVELS - 2, int(at))
        found[AXES + below], found[AXES + below + 1] = 1.0 - (at - below), at - below
        return found

    def doubt(self, slope: Vector) -> float:
        """The standard deviation of what changes so with each number."""
        return float(np.sqrt(slope @ self.cov @ slope))

    def age(self) -> None:
        """A hop is over: where zoom stands in a level is not always the same."""
        self.cov = self.cov + AGE**2 * np.eye(len(self.mean))

    def learn(self, slope: Vector, wrong: float, noise: float) -> None:
        """Something that changes so with each number was off by that much; `noise` is one standard deviation."""
        self.mean, self.cov = taught(self.mean, self.cov, slope, wrong, hypot(noise, BENT * wrong))
