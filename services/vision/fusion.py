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
EXACT = 1e-9  # of angles and focal lengths that are said to be exact: keeps the normal matrix regular
TRUSTED = 4.0  # numbers that the assumed corner noise counts as against the residuals seen


@dataclass(frozen=True, eq=False)
class Place:
    """The centre of a marker: `position` (3,) in metres with its `covariance` (3, 3)."""

    position: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class _State:
    """The unknowns: turn and place of the marker; of each sight the camera's turn (g, 3) and the focal share (g,)."""

    turned: Array
    position: Array
    aside: Array
    longer: Array


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
    count = len(sights)
    state = _State(best.orientation, best.places.mean(axis=0), np.zeros((count, 3)), np.zeros(count))
    for _ in range(STEPS):
        residuals, slope = _linear(sights, state, prior)
        step = np.asarray(np.linalg.lstsq(slope, -residuals, rcond=None)[0], float)
        state = _moved(state, step)
        if float(np.abs(step[:6]).max()) < CONVERGED:
            break
    return state


def _moved(state: _State, step: Array) -> _State:
    beside = step[6:].reshape(-1, 4)
    return _State(
        turned=state.turned @ turn(step[:3]),
        position=state.position + step[3:6],
        aside=state.aside + beside[:, :3],
        longer=state.longer + beside[:, 3],
    )


def _linear(sights: Sights, state: _State, prior: Prior | None) -> tuple[Array, Array]:
    """All residuals in standard deviations, and their derivative by the 6 + 4 g unknowns."""
    count = len(sights)
    looks = np.array([rotation @ turn(aside) for rotation, aside in zip(sights.rotation, state.aside, strict=True)])
    corners = SQUARE * sights.size[:, None, None]  # (g, 4, 3) in the marker's frame
    seen = np.einsum("gji,gcj->gci", looks, corners @ state.turned.T + (state.position - sights.lens_at)[:, None])
    x, y, z = np.moveaxis(seen, -1, 0)
    longer = 1 + state.longer[:, None]
    rays = np.stack((x / z, y / z), axis=-1) * longer[..., None]
    off = (rays - sights.rays) / sights.noise[:, None, None]
    by_point = np.zeros((count, 4, 2, 3))
    by_point[..., 0, 0] = by_point[..., 1, 1] = longer / z
    by_point[..., :, 2] = -rays / z[..., None]
    by_point /= sights.noise[:, None, None, None]
    by_place = np.einsum("gcki,gji->gckj", by_point, looks)
    by_turn = np.einsum("gckj,jm,gcmn->gckn", by_place, state.turned, -_cross(corners))
    by_focal = (np.stack((x / z, y / z), axis=-1) / sights.noise[:, None, None])[..., None]
    own = np.concatenate((np.einsum("gcki,gcin->gckn", by_point, _cross(seen)), by_focal), axis=-1)
    slope = np.zeros((count, 8, 6 + 4 * count))
    slope[..., :3], slope[..., 3:6] = by_turn.reshape(count, 8, 3), by_place.reshape(count, 8, 3)
    for index in range(count):
        slope[index, :, 6 + 4 * index : 10 + 4 * index] = own[index].reshape(8, 4)
    return _with_priors(sights, state, prior, off.ravel(), slope.reshape(8 * count, -1))


def _with_priors(sights: Sights, state: _State, prior: Prior | None, off: Array, slope: Array) -> tuple[Array, Array]:
    """The residuals of what is known besides: the readings, the focal lengths, the marker's normal."""
    known = np.column_stack([sights.angle_noise] * 3 + [sights.focal_doubt]) + EXACT
    beside = np.column_stack((state.aside, state.longer)) / known
    rows = np.hstack((np.zeros((known.size, 6)), np.diag(1 / known.ravel())))
    residuals, slopes = [off, beside.ravel()], [slope, rows]
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
