"""A calibration of the lens from corners alone, and how far it is from the truth: for the tests and `make soak`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.vision.board import Board
from services.vision.calibrate_lens import Fit, fit
from services.vision.lens import Lens
from tests.vision.boards import views

SIZE = (2304, 1296)
MATRIX = np.array([[1158.4, 0, 1147.2], [0, 1156.9, 652.8], [0, 0, 1]])
PLAIN = Lens(*SIZE, MATRIX, np.array([-0.061, 0.018, 0.0006, -0.0004, -0.002]))
RATIONAL = Lens(*SIZE, MATRIX, np.array([8.1, 4.2, 0.0005, -0.0003, 0.12, 8.4, 6.1, 1.05]))


@dataclass(frozen=True)
class LensTrial:
    """How far off it is; `reprojection_px` is the worst over the picture, of the same rays, a common turn aside."""

    focal_off: float
    centre_off_px: float
    reprojection_px: float
    focal_sigmas: float


def judged(found: Fit, truth: Lens) -> LensTrial:
    """A fit against the truth."""
    off = found.lens.matrix - truth.matrix
    fx, sigma = found.values["fx"]
    return LensTrial(
        float(max(abs(off[0, 0] / truth.matrix[0, 0]), abs(off[1, 1] / truth.matrix[1, 1]))),
        float(np.hypot(off[0, 2], off[1, 2])),
        reprojection(found.lens, truth),
        (fx - float(truth.matrix[0, 0])) / sigma,
    )


def reprojection(found: Lens, truth: Lens) -> float:
    """How far apart the two lenses put the same rays at worst, pixels; what a turn of the camera makes good is left."""
    x, y = np.meshgrid(np.linspace(0.04, 0.96, 25) * truth.width, np.linspace(0.04, 0.96, 15) * truth.height)
    rays = truth.rays(np.column_stack((x.ravel(), y.ravel())))
    points = np.column_stack((rays, np.ones(len(rays))))
    off = found.project(points) - truth.project(points)
    turns = []
    for axis in 1e-4 * np.eye(3):
        turned = points + np.cross(axis, points)
        turns.append(((found.project(turned) - found.project(points)) / 1e-4).ravel())
    design = np.array(turns).T
    left = off.ravel() - design @ np.linalg.lstsq(design, off.ravel(), rcond=None)[0]
    return float(np.linalg.norm(left.reshape(-1, 2), axis=1).max())


def lens_trial(rng: np.random.Generator, count: int = 24, truth: Lens = PLAIN) -> LensTrial:
    """One calibration from `count` views with the noise of a good picture."""
    return judged(fit(views(truth, Board(), count, rng), SIZE), truth)
