"""The least squares of the mount: its unknowns, what the looks and the priors leave, and the steps to the minimum.

Unknown are the base in the apartment, tilt's zero, the sensor's roll, the two arms, and every marker's place and turn.
Where it starts and what is told of the end is in `calibrate_mount`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import degrees, radians

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.frames import Mount, Transform, base_in_apartment, camera_in_base
from services.vision.lens import Lens

Array = NDArray[np.float64]

CORNER_PX = 0.15  # what a corner is off, the lens calibration's share included
ANGLE_DEG = 0.05  # what a reading is off, where nobody knows better
LEVER_M, FREE_LEVER_M = 0.003, 0.04  # how well the arms are known: from a data sheet, and when they are all zero
AXIS_DEG = 1.0  # how far tilt's zero and the sensor's roll may be off
LEVEL_DEG = 3.0  # a mounting plate is level to that
STEPS, SMALLEST, NUDGE = 40, 1e-6, 1e-6
NEAREST_M = 1e-3
DAMPING, MOST_DAMPING = 1e-4, 1e8
CAUCHY = 3.0  # standard deviations at which a marker's place, or a look, begins to count less
SQUARE = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0]])
CAMERA = 12  # unknowns of the camera: place 3, turn 3, tilt's zero, roll, two arms of two


@dataclass(frozen=True, eq=False)
class Look:
    """A marker in a picture: `corners` (4, 2) as `detect` gives them, through `lens`, at these readings (degrees)."""

    marker: int
    corners: Array
    lens: Lens
    pan: float
    tilt: float


@dataclass(frozen=True)
class Known:
    """Where a marker's centre was put (m, apartment), the side of its black square, and how well that was measured.

    `doubt_m` is how far from there it mostly is: the root mean square of the distance, in whatever direction.
    """

    position: tuple[float, float, float]
    size_m: float
    doubt_m: float = 0.01


@dataclass(frozen=True, eq=False)
class Problem:
    """What is given: the looks, where the markers were said to be, and what is guessed of the mount."""

    looks: tuple[Look, ...]
    ids: list[int]
    said: Array  # (m, 3)
    doubt: Array  # (m,) of each coordinate
    sizes: Array  # (m,)
    guess: Mount
    angle_deg: float  # what a reading is off, one standard deviation
    candidates: tuple[tuple[Transform, ...], ...]  # of each look: the marker in the camera, the better first

    @property
    def which(self) -> list[int]:
        """The index of each look's marker."""
        return [self.ids.index(look.marker) for look in self.looks]


@dataclass(frozen=True, eq=False)
class State:
    """`base` is T_AB; `axes`: tilt's zero and roll (rad), arms (m); `markers`: T_AM of each."""

    base: Transform
    axes: Array
    markers: tuple[Transform, ...]


def turned(vector: Array) -> Array:
    """The rotation, 3x3, of a rotation vector in radians."""
    return np.asarray(cv2.Rodrigues(np.asarray(vector, float))[0], float)


def axes_of(mount: Mount) -> Array:
    """Tilt's zero and the sensor's roll (rad), and the two arms (m), (6,)."""
    angles = (radians(mount.tilt_zero_deg), radians(mount.sensor_roll_deg))
    return np.array([*angles, *mount.pan_to_tilt_m, *mount.tilt_to_lens_m], float)


def with_axes(guess: Mount, axes: Array) -> Mount:
    """A mount with these axes."""
    zero, roll, forward, away, along, above = (float(value) for value in axes)
    return replace(
        guess,
        tilt_zero_deg=degrees(zero),
        sensor_roll_deg=degrees(roll),
        pan_to_tilt_m=(forward, away),
        tilt_to_lens_m=(along, above),
    )


def solved(problem: Problem, state: State) -> tuple[State, float, Array]:
    """The minimum near a state, its cost, and the information (n, n) about the unknowns there."""
    cost, matrix, vector = _normal(problem, state)
    damping = DAMPING
    for _ in range(STEPS):
        step = np.asarray(np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), -vector), float)
        tried = _moved(state, step)
        other = _normal(problem, tried)
        if other[0] < cost:
            gain, state = cost - other[0], tried
            cost, matrix, vector = other
            damping = max(damping / 10, 1e-12)
            if gain < SMALLEST * max(cost, 1.0):
                break
        elif damping > MOST_DAMPING:
            break
        else:
            damping *= 10
    return state, cost, matrix


def _normal(problem: Problem, state: State) -> tuple[float, Array, Array]:
    """The cost, and the normal equations: information (n, n) and gradient (n,)."""
    count = CAMERA + 6 * len(problem.ids)
    cost, matrix, vector = 0.0, np.zeros((count, count)), np.zeros(count)
    for columns, residual, slopes, freedom in (*_of_looks(problem, state), *_of_priors(problem, state)):
        size = float(residual @ residual) / freedom
        limit = CAUCHY**2
        weight = 1 / (1 + size / limit)  # Cauchy's: what is far off hardly pulls
        cost += freedom * limit * float(np.log1p(size / limit))
        matrix[np.ix_(columns, columns)] += weight * slopes.T @ slopes
        vector[columns] += weight * slopes.T @ residual
    return cost, matrix, vector


Part = tuple[NDArray[np.intp], Array, Array, float]


def _of_looks(problem: Problem, state: State) -> Iterator[Part]:
    for index, which in enumerate(problem.which):
        own = CAMERA + 6 * which
        columns = np.concatenate((np.arange(CAMERA), np.arange(own, own + 6)))
        yield columns, *_of_look(problem, state, index), 8.0


def _of_priors(problem: Problem, state: State) -> Iterator[Part]:
    """What is known beforehand: the axes, that the plate is about level, and where the markers were put."""
    guess = axes_of(problem.guess)
    lever = LEVER_M if np.any(guess[2:]) else FREE_LEVER_M
    doubt = np.array([radians(AXIS_DEG), radians(AXIS_DEG), *[lever] * 4])
    yield np.arange(6, CAMERA), (state.axes - guess) / doubt, np.diag(1 / doubt), 6.0
    out = base_in_apartment(Mount((0, 0, 0), problem.guess.kind)).rotation[2, 2] * state.base.rotation[:, 2]
    level = radians(LEVEL_DEG)
    slopes = np.array([[0.0, out[2], -out[1]], [-out[2], 0.0, out[0]]]) / level  # of x and y of the plate's normal
    yield np.arange(3, 6), out[:2] / level, slopes, 2.0
    for index, (said, doubt_m) in enumerate(zip(problem.said, problem.doubt, strict=True)):
        own = CAMERA + 6 * index
        off = (state.markers[index].translation - said) / doubt_m
        yield np.arange(own, own + 3), off, np.eye(3) / doubt_m, 3.0


def _moved(state: State, step: Array) -> State:
    """The state after a step of all unknowns; turns are about the apartment's axes, small ones."""
    base = Transform(turned(step[3:6]) @ state.base.rotation, state.base.translation + step[:3])
    markers = tuple(
        Transform(turned(part[3:]) @ one.rotation, one.translation + part[:3])
        for one, part in zip(state.markers, step[CAMERA:].reshape(-1, 6), strict=True)
    )
    return State(base, state.axes + step[6:CAMERA], markers)


def _of_look(problem: Problem, state: State, index: int) -> tuple[Array, Array]:
    """What a look leaves, (8,) in standard deviations, and its slopes by the camera's and the marker's unknowns."""
    look, which = problem.looks[index], problem.which[index]
    marker, mount = state.markers[which], with_axes(problem.guess, state.axes)
    head = camera_in_base(mount, look.pan, look.tilt)
    here = marker.apply(SQUARE * problem.sizes[which])  # in the apartment
    to_camera = (state.base @ head).inverse()
    near, by_point = _projected(look.lens, to_camera.apply(here))
    base_at, marker_at = state.base.translation, marker.translation
    moves = np.empty((4, 3, CAMERA + 6))  # of the corners in the camera
    moves[:, :, :3], moves[:, :, CAMERA : CAMERA + 3] = -to_camera.rotation, to_camera.rotation
    moves[:, :, 3:6] = -to_camera.rotation @ _turning(here - base_at)
    moves[:, :, CAMERA + 3 :] = to_camera.rotation @ _turning(here - marker_at)
    in_base, now = state.base.inverse().apply(here), to_camera.apply(here)
    for axis, nudge in enumerate(NUDGE * np.eye(CAMERA - 6)):
        other = camera_in_base(with_axes(problem.guess, state.axes + nudge), look.pan, look.tilt)
        moves[:, :, 6 + axis] = (other.inverse().apply(in_base) - now) / NUDGE
    swing = moves[:, :, 3:6] @ state.base.rotation[:, 2]  # of a growing pan
    sway = np.stack((swing, -moves[:, :, 6]), axis=-1)
    slopes, swayed = ((by_point @ one).reshape(8, -1) for one in (moves, sway))
    spread = CORNER_PX**2 * np.eye(8) + radians(problem.angle_deg) ** 2 * swayed @ swayed.T
    whiten = np.linalg.inv(np.linalg.cholesky(spread))
    return whiten @ (near - look.corners).ravel(), whiten @ slopes


def _turning(arms: Array) -> Array:
    """How points at the end of arms (n, 3) move under a turn about each axis, (n, 3, 3): the columns are e_k x arm."""
    x, y, z = arms.T
    none = np.zeros(len(arms))
    return np.array([[none, z, -y], [-z, none, x], [y, -x, none]]).transpose(2, 0, 1)


def _projected(lens: Lens, points: Array) -> tuple[Array, Array]:
    """Pixels (4, 2) of points in the camera, and their slopes (4, 2, 3)."""
    points = np.column_stack((points[:, :2], np.maximum(points[:, 2], NEAREST_M)))
    tried = np.concatenate([points, *(points + nudge for nudge in NUDGE * np.eye(3))])
    pixels = lens.project(tried).reshape(4, -1, 2)
    return pixels[0], ((pixels[1:] - pixels[0]) / NUDGE).transpose(1, 2, 0)
