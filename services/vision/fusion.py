"""Where a marker is, from all sights of it at once: the most likely place, and how sure that is.

Unknown are the place and the turn of the marker and, of each sight, how far the camera looked beside its reading
and by what share its focal length is off, each as far as that is likely. Least squares over all of them (Gauss and
Newton's method) weighs near and far sights, zoomed and wide ones as they deserve; the covariance is the part of the
inverse normal matrix that belongs to the place. Which turns are possible is found by `orientation`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from services.vision.orientation import SQUARE, Hypothesis, turn
from services.vision.prior import Prior
from services.vision.views import Sights

Array = NDArray[np.float64]

STEPS, CONVERGED = 10, 1e-7
TRUSTED = 4.0  # numbers that the assumed corner noise counts as against the residuals seen


@dataclass(frozen=True, eq=False)
class Place:
    """The centre of a marker: `position` (3,) in metres with its `covariance` (3, 3)."""

    position: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class _State:
    """The unknowns: turn and place of the marker; of each sight what is beside its reading and its focal length.

    `beside` is (g, 4) in standard deviations: three of the camera's turns, and the focal length.
    """

    turned: Array
    position: Array
    beside: Array


def fuse(sights: Sights, best: Hypothesis, prior: Prior | None = None) -> Place:
    """The place of a marker turned as `best` says, or nearly so, from sights that agree.

    Where they disagree by more than they should, the covariance grows to match (Birge 1932).
    """
    used = prior if prior is not None and prior.holds(best.orientation[:, 2]) else None
    heard = replace(sights, noise=sights.noise * sqrt(_share(best.cost, 5 * len(sights) - 3)))
    state = _fitted(heard, best, used)
    residuals, slope = _linear(heard, state, used)
    covariance = np.asarray(np.linalg.inv(slope.T @ slope)[3:6, 3:6], float)
    apart = float(residuals @ residuals) - best.cost * float((heard.noise[0] / sights.noise[0]) ** -2)
    return Place(state.position, covariance * max(1.0, _share(apart, 3 * (len(sights) - 1))))


def _share(cost: float, freedom: int) -> float:
    """By what factor the variance is larger than assumed (or smaller), as far as so many numbers tell."""
    return (TRUSTED + cost) / (TRUSTED + freedom)


def _fitted(sights: Sights, best: Hypothesis, prior: Prior | None) -> _State:
    state = _State(best.orientation, best.places.mean(axis=0), np.zeros((len(sights), 4)))
    for _ in range(STEPS):
        residuals, slope = _linear(sights, state, prior)
        step = np.asarray(np.linalg.lstsq(slope, -residuals, rcond=None)[0], float)
        state = _moved(state, step)
        if float(np.abs(step[:6]).max()) < CONVERGED:
            break
    return state


def _moved(state: _State, step: Array) -> _State:
    beside = state.beside + step[6:].reshape(-1, 4)
    return _State(state.turned @ turn(step[:3]), state.position + step[3:6], beside)


def _linear(sights: Sights, state: _State, prior: Prior | None) -> tuple[Array, Array]:
    """All residuals in standard deviations, and their derivative by the 6 + 4 g unknowns."""
    count = len(sights)
    aside = np.einsum("gij,gj->gi", sights.swing, state.beside[:, :3])
    looks = np.array([rotation @ turn(angles) for rotation, angles in zip(sights.rotation, aside, strict=True)])
    corners = SQUARE * sights.size[:, None, None]  # (g, 4, 3) in the marker's frame
    seen = np.einsum("gji,gcj->gci", looks, corners @ state.turned.T + (state.position - sights.lens_at)[:, None])
    x, y, z = np.moveaxis(seen, -1, 0)
    longer = 1 + (sights.focal_doubt * state.beside[:, 3])[:, None]
    rays = np.stack((x / z, y / z), axis=-1) * longer[..., None]
    off = (rays - sights.rays) / sights.noise[:, None, None]
    by_point = np.zeros((count, 4, 2, 3))
    by_point[..., 0, 0] = by_point[..., 1, 1] = longer / z
    by_point[..., :, 2] = -rays / z[..., None]
    by_point /= sights.noise[:, None, None, None]
    by_place = np.einsum("gcki,gji->gckj", by_point, looks)
    by_turn = np.einsum("gckj,jm,gcmn->gckn", by_place, state.turned, -_cross(corners))
    by_focal = np.stack((x / z, y / z), axis=-1) * (sights.focal_doubt / sights.noise)[:, None, None]
    by_swing = np.einsum("gcki,gcij,gjn->gckn", by_point, _cross(seen), sights.swing)
    own = np.concatenate((by_swing, by_focal[..., None]), axis=-1)
    slope = np.zeros((count, 8, 6 + 4 * count))
    slope[..., :3], slope[..., 3:6] = by_turn.reshape(count, 8, 3), by_place.reshape(count, 8, 3)
    for index in range(count):
        slope[index, :, 6 + 4 * index : 10 + 4 * index] = own[index].reshape(8, 4)
    residuals, slope = sights.by_sides @ off.reshape(count, 8, 1), sights.by_sides @ slope
    return _with_priors(state, prior, residuals.ravel(), slope.reshape(8 * count, -1))


def _with_priors(state: _State, prior: Prior | None, off: Array, slope: Array) -> tuple[Array, Array]:
    """The residuals of what is known besides: the readings, the focal lengths, the marker's normal."""
    rows = np.hstack((np.zeros((state.beside.size, 6)), np.eye(state.beside.size)))
    residuals, slopes = [off, state.beside.ravel()], [slope, rows]
    if prior is not None:
        leaning = prior.slope(state.turned)
        residuals.append(prior.residuals(state.turned[:, 2]))
        slopes.append(np.hstack((leaning, np.zeros((len(leaning), slope.shape[1] - 3)))))
    return np.concatenate(residuals), np.vstack(slopes)


def _cross(vectors: Array) -> Array:
    """The matrices (..., 3, 3) that make the cross product of these vectors with another from the left."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = ((zero, -z, y), (z, zero, -x), (-y, x, zero))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
