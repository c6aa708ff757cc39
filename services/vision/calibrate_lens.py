"""The lens from pictures of a board: the fit, the views that it leaves out, and how sure each number is.

Finding the board in a picture is in `board`, whether enough of the picture was covered in `coverage`. A view that was
blurred, bent or mixed up shows by its residuals; it is left out, and so is a single corner that jumped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.board import FEWEST_CORNERS, Seen
from services.vision.lens import COEFFICIENTS, Lens

Array = NDArray[np.float64]
Model = Literal["plumb_bob", "rational_polynomial"]

FEWEST_VIEWS = 4
WORSE = 3.0  # a view whose middle residual is so many times the median view's is left out
FAIR_PX = 0.15  # but none with one below this
OUTLIER = 4.5  # standard deviations of a corner that is left out
WORST_PX = 1.0  # of noise: a board that is printed and held flat gives a tenth of it
LEAST_PX = 0.02  # no corner is known better than this
LEFT_OUT = 0.4  # of the views at most; if more disagree, nothing is known
ROUNDS = 8
STEPS = 400  # of the least squares: the rational model's coefficients make a long valley
STARTS = (0.5, 0.8, 1.3, 0.35, 2.2)  # focal lengths tried first, in widths of the picture: 90, 64, 42, 110, 26 degrees
BETTER = 0.95  # the rational model is taken when it leaves so much less
UNKNOWN = 1e-13  # what the views say so much less about than about the rest is not known at all
GRID = (16, 9)  # where it is asked how far off a pixel may be
NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


@dataclass(frozen=True, eq=False)
class Fit:
    """A lens, and what came of each view: `used` by its number, `left_out` by number with the reason.

    `covariance` is that of fx, fy, cx, cy and the coefficients in their order; `residuals` holds (n, 2) pixels and
    `seen` the corners of each used view, `poses` its board in the camera (rotation vector and translation).
    """

    lens: Lens
    covariance: Array
    used: tuple[int, ...]
    left_out: Mapping[int, str]
    seen: tuple[Seen, ...]
    residuals: tuple[Array, ...]
    poses: tuple[tuple[Array, Array], ...]

    @property
    def model(self) -> Model:
        """The distortion model by ROS's name."""
        return "plumb_bob" if len(self.lens.distortion) == COEFFICIENTS["plumb_bob"] else "rational_polynomial"

    @property
    def rms_px(self) -> float:
        """Of all residuals, both directions together."""
        return float(np.sqrt((np.concatenate(self.residuals) ** 2).sum(axis=1).mean()))

    @property
    def values(self) -> dict[str, tuple[float, float]]:
        """Every number with its standard deviation."""
        matrix = self.lens.matrix
        numbers = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *self.lens.distortion]
        sigma = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return {name: (float(a), float(b)) for name, a, b in zip(NAMES, numbers, sigma, strict=False)}

    @property
    def focal_doubt(self) -> float:
        """The standard deviation of the focal length, as a part of it."""
        (fx, sx), (fy, sy) = self.values["fx"], self.values["fy"]
        return max(sx / fx, sy / fy)


def fit(views: Sequence[Seen], size: tuple[int, int], model: Model | Literal["auto"] = "auto") -> Fit:
    """The lens of a picture of `size` (width, height) that explains the views best.

    `auto`: ROS's plumb_bob, unless the rational model explains clearly more. ValueError when there are too few views,
    or they do not fit together.
    """
    if len(views) < FEWEST_VIEWS:
        raise ValueError(f"expected at least {FEWEST_VIEWS} views of the board, got {len(views)}")
    plain = _robust(views, size, 0)
    if model == "plumb_bob":
        return plain.told()
    rational = _robust(views, size, cv2.CALIB_RATIONAL_MODEL)
    better = rational.noise < BETTER * plain.noise and len(rational.kept) >= len(plain.kept)
    return (rational if model == "rational_polynomial" or better else plain).told()


def doubt_px(found: Fit) -> Array:
    """How far off a pixel may be, one standard deviation, at a grid over the picture (rows, columns).

    A turn of the whole picture does not count: the mount takes it up.
    """
    width, height = found.lens.width, found.lens.height
    x, y = ((np.arange(n) + 0.5) / n * extent - 0.5 for n, extent in zip(GRID, (width, height), strict=True))
    rays = found.lens.rays(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    reached = np.isfinite(rays[:, 0] + rays[:, 1])
    points = np.column_stack((np.where(reached[:, None], rays, 0.0), np.ones(len(rays))))
    slopes = _slopes(points, np.zeros(3), np.zeros(3), found.lens)
    inner, turns = slopes[:, 6:], slopes[:, :3]
    kept = np.flatnonzero(np.repeat(reached, 2))
    inner = inner - turns @ np.linalg.lstsq(turns[kept], inner[kept], rcond=None)[0]
    variance = np.einsum("ij,jk,ik->i", inner, found.covariance, inner).reshape(-1, 2).sum(axis=1)
    doubt = np.where(reached, np.sqrt(np.maximum(variance, 0.0)), np.nan)
    return np.asarray(doubt.reshape(GRID[1], GRID[0]), float)


@dataclass(frozen=True, eq=False)
class _Draft:
    """A fit on the way: views that are still in, by their numbers, and what they leave."""

    size: tuple[int, int]
    kept: dict[int, Seen]
    left_out: dict[int, str] = field(default_factory=dict)
    lens: Lens | None = None
    poses: tuple[tuple[Array, Array], ...] = ()
    residuals: tuple[Array, ...] = ()

    @property
    def noise(self) -> float:
        """Of one coordinate, pixels."""
        free = sum(2 * len(r) - 6 for r in self.residuals) - 9
        return float(np.sqrt(sum((r**2).sum() for r in self.residuals) / max(free, 1)))

    def told(self) -> Fit:
        """With its covariance."""
        assert self.lens is not None
        seen = tuple(self.kept.values())
        covariance = _covariance(seen, self.poses, self.lens, self.noise)
        used = tuple(self.kept)
        return Fit(self.lens, covariance, used, self.left_out, seen, self.residuals, self.poses)


def _robust(views: Sequence[Seen], size: tuple[int, int], flags: int) -> _Draft:
    draft = _fitted(_Draft(size, dict(enumerate(views))), flags)
    for _ in range(ROUNDS):
        cleaned = _cleaned(draft)
        if cleaned is draft:
            break
        if len(cleaned.kept) < max(FEWEST_VIEWS, (1 - LEFT_OUT) * len(views)):
            raise ValueError(f"the views do not fit together: {draft.noise:.1f} px remain, is it the right board?")
        draft = _fitted(cleaned, flags)
    if draft.noise > WORST_PX:
        raise ValueError(f"the views do not fit together: {draft.noise:.1f} px remain, is it the right board?")
    return draft


def _fitted(draft: _Draft, flags: int) -> _Draft:
    """The least squares over what is kept, from where it stands; a first one from several focal lengths."""
    if draft.lens is not None:
        return _from(draft, draft.lens.matrix, flags)
    width, height = draft.size
    best, why = None, ValueError()
    for share in STARTS:
        matrix = np.array([[share * width, 0, (width - 1) / 2], [0, share * width, (height - 1) / 2], [0, 0, 1]])
        try:
            tried = _from(draft, matrix, flags)
        except ValueError as error:
            why = error
            continue
        if best is None or tried.noise < best.noise:
            best = tried
        if best.noise < FAIR_PX:
            break
    if best is None:
        raise why
    return best


def _from(draft: _Draft, matrix: Array, flags: int) -> _Draft:
    points = [one.points.astype(np.float32) for one in draft.kept.values()]
    pixels = [one.pixels.astype(np.float32) for one in draft.kept.values()]
    count = COEFFICIENTS["rational_polynomial" if flags else "plumb_bob"]
    ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, STEPS, 1e-12)
    start = cv2.CALIB_USE_INTRINSIC_GUESS | flags
    try:
        _, found, distortion, turns, shifts = cv2.calibrateCamera(
            points, pixels, draft.size, matrix.copy(), np.zeros(count), flags=start, criteria=ends
        )
    except cv2.error as error:
        raise ValueError(f"the views do not give a lens: {error.err}") from error
    lens = Lens(*draft.size, np.asarray(found, float), np.asarray(distortion, float).ravel()[:count])
    if not (np.isfinite(lens.matrix).all() and np.isfinite(lens.distortion).all() and lens.matrix[0, 0] > 0):
        raise ValueError("the views do not give a lens: show the board tilted and in other places")
    pairs = zip(turns, shifts, strict=True)
    poses = tuple((np.asarray(r, float).ravel(), np.asarray(t, float).ravel()) for r, t in pairs)
    residuals = tuple(
        one.pixels - _projected(one.points, pose, lens) for one, pose in zip(draft.kept.values(), poses, strict=True)
    )
    return replace(draft, lens=lens, poses=poses, residuals=residuals)


def _cleaned(draft: _Draft) -> _Draft:
    """Without the views that disagree as a whole, or else without corners that jumped; the same when there are none."""
    sizes = [np.abs(r).max(axis=1) for r in draft.residuals]
    middle = np.array([np.median(one) for one in sizes])
    limit = max(WORSE * float(np.median(middle)), FAIR_PX)
    why = {n: f"{off:.2f} px off" for n, off in zip(draft.kept, middle, strict=True) if off > limit}
    if why:
        kept = {number: one for number, one in draft.kept.items() if number not in why}
        return replace(draft, kept=kept, left_out={**draft.left_out, **why})
    spread = OUTLIER * max(1.4826 * float(np.median(np.abs(np.concatenate(draft.residuals)))), LEAST_PX)
    fine = [one <= max(spread, float(one.max()) / 2) for one in sizes]  # one that jumped pulls its neighbours too
    if all(one.all() or one.sum() < FEWEST_CORNERS for one in fine):
        return draft
    pairs = zip(draft.kept.items(), fine, strict=True)
    return replace(draft, kept={n: one.only(good) if good.sum() >= FEWEST_CORNERS else one for (n, one), good in pairs})


def _projected(points: Array, pose: tuple[Array, Array], lens: Lens) -> Array:
    pixels, _ = cv2.projectPoints(points, *pose, lens.matrix, lens.distortion)
    return np.asarray(pixels, float).reshape(-1, 2)


def _slopes(points: Array, turn: Array, shift: Array, lens: Lens) -> Array:
    """Of the pixels (2 n, 6 + p): by turn, shift, then fx, fy, cx, cy and the coefficients."""
    _, slopes = cv2.projectPoints(points, turn, shift, lens.matrix, lens.distortion)
    return np.asarray(slopes, np.float64)[:, : 10 + len(lens.distortion)]


def _covariance(seen: Sequence[Seen], poses: Sequence[tuple[Array, Array]], lens: Lens, noise: float) -> Array:
    """Of the lens's numbers; the boards' poses are free in each view (Schur complement)."""
    count = 4 + len(lens.distortion)
    information = np.zeros((count, count))
    for one, pose in zip(seen, poses, strict=True):
        slopes = _slopes(one.points, *pose, lens)
        outer, inner = slopes[:, :6], slopes[:, 6:]
        information += inner.T @ inner - inner.T @ outer @ np.linalg.solve(outer.T @ outer, outer.T @ inner)
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-12))
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    spread = vectors * scale[:, None] / np.sqrt(np.maximum(values, UNKNOWN * values.max()))
    return np.asarray(noise**2 * spread @ spread.T, float)
