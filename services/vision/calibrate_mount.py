"""How the camera hangs, from markers at known places: least squares over the mount, its axes and the markers.

Each marker was placed by hand, so its place is only as good as it was measured: it is an unknown too, held to what was
said. So is its orientation, which nobody measured. One that is far from where it was said to be shows by that, and
hardly pulls. The frames and the mount's numbers are those of `frames`; going to the markers is the camera service's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import asin, atan2, degrees, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.frames import Mount, Transform, camera_in_apartment, camera_in_base
from services.vision.mount_squares import (
    ANGLE_DEG,
    CAMERA,
    SQUARE,
    Known,
    Look,
    Problem,
    State,
    axes_of,
    solved,
    turned,
    with_axes,
)

Array = NDArray[np.float64]

FEWEST = 3  # markers
MISPLACED = 4.0  # standard deviations of a place that is told to be wrong
FLAT = 0.15  # m; markers spread less than this across their line tell nothing about the turn around it


def best_pose(look: Look, size_m: float) -> Transform | None:
    """The marker in the camera, the likelier of its two poses; None when no pose explains its corners."""
    return next(iter(_candidates(look, size_m)), None)


@dataclass(frozen=True, eq=False)
class Placed:
    """What came out for one marker: `offset` (3,) in metres from where it was said to be, and what its looks leave."""

    offset: Array
    misplaced: bool
    looks: int
    rms_px: float


@dataclass(frozen=True, eq=False)
class MountFit:
    """`covariance` (12, 12) of place (m), turn (rad, about the apartment's axes), tilt's zero, roll, and the arms.

    `off_px` (n, 4, 2): what each of the looks leaves, pixels.
    """

    mount: Mount
    covariance: Array
    markers: Mapping[int, Placed]
    looks: tuple[Look, ...]
    off_px: Array

    @property
    def axes_doubt(self) -> Array:
        """(6,) standard deviations of tilt's zero and the roll (rad), and of the arms (m)."""
        return np.sqrt(np.diag(self.covariance)[6:])

    @property
    def position_doubt(self) -> Array:
        """(3,) standard deviations, metres."""
        return np.sqrt(np.diag(self.covariance)[:3])

    @property
    def turn_doubt_deg(self) -> Array:
        """(3,) standard deviations about the apartment's axes, degrees."""
        return np.degrees(np.sqrt(np.diag(self.covariance)[3:6]))


def fit(looks: Sequence[Look], known: Mapping[int, Known], guess: Mount, angle_deg: float = ANGLE_DEG) -> MountFit:
    """The mount that explains the looks best. Of `guess` the kind and the arms count, its place and turn do not.

    `angle_deg`: what the readings are off, one standard deviation.

    ValueError when fewer than three markers were seen, when they stand in a line, or when they explain nothing.
    """
    useful = [look for look in looks if look.marker in known]
    ids = sorted({look.marker for look in useful})
    if len(ids) < FEWEST:
        raise ValueError(f"expected at least {FEWEST} markers at known places, saw {len(ids)}: {ids}")
    said = np.array([known[marker].position for marker in ids], float)
    if np.linalg.svd(said - said.mean(axis=0), compute_uv=False)[1] < FLAT:
        raise ValueError("the markers stand in one line: put one beside it")
    problem = _problem(useful, ids, known, guess, angle_deg)
    best = solved(problem, _start(problem, guess))
    for index in range(len(ids)):
        other = solved(problem, _flipped(problem, best[0], index))
        best = other if other[1] < best[1] else best
    return _told(problem, *best)


def _problem(
    looks: Sequence[Look], ids: list[int], known: Mapping[int, Known], guess: Mount, angle_deg: float
) -> Problem:
    candidates = tuple(_candidates(look, known[look.marker].size_m) for look in looks)
    kept = [(look, one) for look, one in zip(looks, candidates, strict=True) if one]
    if {look.marker for look, _ in kept} != set(ids):
        raise ValueError("expected the corners of squares turned to the camera: no pose explains them")
    return Problem(
        tuple(look for look, _ in kept),
        ids,
        np.array([known[marker].position for marker in ids], float),
        np.array([known[marker].doubt_m for marker in ids], float) / sqrt(3),
        np.array([known[marker].size_m for marker in ids], float),
        guess,
        angle_deg,
        tuple(one for _, one in kept),
    )


def _candidates(look: Look, size: float) -> tuple[Transform, ...]:
    """Both poses of a square that explain its corners, in the camera, the better first."""
    rays = look.lens.rays(look.corners)
    if not np.isfinite(rays).all():
        return ()
    flags = cv2.SOLVEPNP_IPPE_SQUARE
    _, turns, shifts, _ = cv2.solvePnPGeneric(SQUARE * size, rays + 1e-7, np.eye(3), np.zeros(5), flags=flags)
    poses = [
        Transform(turned(np.asarray(r, float)), np.asarray(t, float).ravel())
        for r, t in zip(turns, shifts, strict=True)
    ]
    return tuple(one for one in poses if np.isfinite(one.rotation).all() and one.translation[2] > 0)


def _start(problem: Problem, guess: Mount) -> State:
    """From the markers' places in the base to those in the apartment: the rigid motion that most of them agree on."""
    heads = [camera_in_base(guess, look.pan, look.tilt) for look in problem.looks]
    seen = [head.apply(one[0].translation) for head, one in zip(heads, problem.candidates, strict=True)]
    which = np.array(problem.which)
    places = np.array([np.median(np.array(seen)[which == m], axis=0) for m in range(len(problem.ids))])
    tried = [_rigid(places[list(three)], problem.said[list(three)]) for three in combinations(range(len(places)), 3)]
    base = min(tried, key=lambda one: float(np.median(np.linalg.norm(one.apply(places) - problem.said, axis=1))))
    near = np.linalg.norm(base.apply(places) - problem.said, axis=1) < 0.3
    base = _rigid(places[near], problem.said[near]) if near.sum() >= FEWEST else base
    first = [int(np.flatnonzero(which == m)[0]) for m in range(len(problem.ids))]
    markers = tuple(base @ heads[i] @ problem.candidates[i][0] for i in first)
    return State(base, axes_of(guess), markers)


def _rigid(places: Array, said: Array) -> Transform:
    """The motion that brings points (n, 3) nearest to others (Kabsch 1976)."""
    middle, aim = places.mean(axis=0), said.mean(axis=0)
    u, _, v = np.linalg.svd((places - middle).T @ (said - aim))
    turn = v.T @ np.diag([1, 1, np.sign(np.linalg.det(v.T @ u.T))]) @ u.T
    return Transform(turn, aim - turn @ middle)


def _flipped(problem: Problem, state: State, index: int) -> State:
    """With one marker's orientation as the second pose of its picture has it."""
    markers, mount = list(state.markers), with_axes(problem.guess, state.axes)
    look, poses = next(
        (look, one) for look, one, m in zip(problem.looks, problem.candidates, problem.which, strict=True) if m == index
    )
    here = state.base @ camera_in_base(mount, look.pan, look.tilt)
    now = here.rotation.T @ markers[index].rotation
    other = max(poses, key=lambda one: float(np.linalg.norm(one.rotation - now)))
    markers[index] = Transform(here.rotation @ other.rotation, markers[index].translation)
    return replace(state, markers=tuple(markers))


def _told(problem: Problem, state: State, cost: float, information: Array) -> MountFit:
    mount = _mount(problem.guess, state)
    off = np.array([_off_px(problem, state, mount, index) for index in range(len(problem.looks))])
    shift = np.array([one.translation for one in state.markers]) - problem.said
    which = np.array(problem.which)
    markers = {
        marker: Placed(
            shift[m],
            bool(np.linalg.norm(shift[m]) > MISPLACED * problem.doubt[m]),
            int((which == m).sum()),
            float(np.sqrt((off[which == m] ** 2).sum(axis=-1).mean())),
        )
        for m, marker in enumerate(problem.ids)
    }
    freedom = 8 * len(problem.looks) + 3 * len(problem.ids) - CAMERA - 6 * len(problem.ids) + 8
    grown = max(1.0, cost / max(freedom, 1))  # where they disagree by more than they should
    covariance = np.asarray(grown * np.linalg.inv(information)[:CAMERA, :CAMERA], float)
    return MountFit(mount, covariance, markers, problem.looks, off)


def _off_px(problem: Problem, state: State, mount: Mount, index: int) -> Array:
    look, which = problem.looks[index], problem.which[index]
    camera = camera_in_apartment(mount, look.pan, look.tilt)
    points = camera.inverse().apply(state.markers[which].apply(SQUARE * problem.sizes[which]))
    return look.corners - look.lens.project(points)


def _mount(guess: Mount, state: State) -> Mount:
    """Place and turn as the configuration writes them: T_AB = Rz(yaw) [Rx(180)] Rx(lean x) Ry(lean y)."""
    turn = state.base.rotation
    sign = -1.0 if guess.kind == "ceiling" else 1.0
    # With S = diag(1, sign, sign): T = S' Rz(sign yaw) Rx Ry, and the product of the three is read off.
    plain = np.diag([1.0, sign, sign]) @ turn
    yaw = sign * degrees(atan2(-plain[0, 1], plain[1, 1]))
    lean_x = degrees(asin(max(-1.0, min(1.0, float(plain[2, 1])))))
    lean_y = degrees(atan2(-plain[2, 0], plain[2, 2]))
    x, y, z = (float(value) for value in state.base.translation)
    made = with_axes(guess, state.axes)
    return replace(made, position=(x, y, z), yaw_deg=yaw, lean_deg=(lean_x, lean_y))
