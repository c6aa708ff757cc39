"""Shadows and glare over a square: how the light changes, from what must be dark and light all around it.

The border of a marker is dark and the paper beside it is light: what changes along both is the light. Where all of the
paper is lighter than all of the border, what lies between tells dark from light, whatever the shadow's shape. Also, the
light is taken for a band with straight edges (or all that lies to one side of one), or for one that changes softly,
and the picture is made as it would be in one light. No code is looked at here: what is read afterwards must stand every
test that others stand (`belief`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from services.vision.corners import sample
from services.vision.reading import place

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
Basis = Callable[[Array], Array]

SPOTS = 14  # along each side
OUTSIDE, OUTSIDE_PX = 0.35, 1.5  # of a cell, and at least: how far from the square the paper is looked at
ANGLES, OFFSETS = 9, 13  # of a band, tried at first
REACH = 0.7  # of the square's side: farther from its middle no edge crosses it
SOFT, SOFTNESS = 0.08, (0.02, 0.08, 0.2)  # width of a band's edges in sides of the square: at first, and then
FINER = (1.0, 0.5, 0.25, 0.12)  # of the first steps: where else the best band's edges are tried
EXPLAINED = 0.6  # share of the change along border and paper that the light must explain
CHANGE = 0.25  # of the contrast: less is lived with
FEW = 10  # percent of the border may be lighter, and of the paper darker, than what is taken for all of it
APART = 0.15  # of the contrast: the darkest paper is so much lighter than the lightest border
BOTTOM, TOP = 40.0, 215.0  # grey levels that dark and light become
LEAST_CONTRAST = 2.0  # grey levels between dark and light that are made as many as elsewhere


@dataclass(frozen=True, eq=False)
class _Ring:
    """Points (n, 2) along a square, in its sides from its middle, and the grey there."""

    at: Array
    grey: Array


def lit(grey: Picture, square: Array, modules: int) -> Iterator[tuple[Picture, Array]]:
    """Pictures of what is around the square (4, 2), clockwise, as if in one light, and where they begin; or none."""
    middle = square.mean(axis=0)
    side = float(np.linalg.norm(np.roll(square, -1, axis=0) - square, axis=1).mean())
    outside = max(OUTSIDE / modules, OUTSIDE_PX / side)
    border, paper = (_ring(grey, square, depth, middle, side) for depth in (0.5 / modules, -outside))
    contrast = float(np.median(paper.grey) - np.median(border.grey))
    if max(np.ptp(border.grey), np.ptp(paper.grey)) < CHANGE * contrast:
        return
    low, high = np.floor(square.min(axis=0) - side / 2), np.ceil(square.max(axis=0) + side / 2) + 1
    x0, y0 = np.maximum(low, 0).astype(int)
    x1, y1 = np.minimum(high, grey.shape[::-1]).astype(int)
    part, begin = grey[y0:y1, x0:x1], np.array([x0, y0], float)
    lowest, highest = np.percentile(border.grey, 100 - FEW), np.percentile(paper.grey, FEW)
    if highest - lowest > APART * contrast:
        yield _stretched(part, lowest, highest), begin
    basis, dark, light, explained = _light(border, paper)
    if explained > EXPLAINED:
        x, y = np.meshgrid(np.arange(x0, x1), np.arange(y0, y1))
        here = basis((np.stack((x.ravel(), y.ravel()), axis=1) - middle) / side)
        yield _stretched(part, (here @ dark).reshape(part.shape), (here @ light).reshape(part.shape)), begin


def _stretched(grey: Picture, dark: Any, light: Any) -> Picture:
    """What is as dark as told at the bottom, what is as light at the top."""
    share = (grey - dark) / np.maximum(light - dark, LEAST_CONTRAST)
    return np.asarray(np.clip(np.rint(BOTTOM + share * (TOP - BOTTOM)), 0, 255), np.uint8)


def _ring(grey: Picture, square: Array, depth: float, middle: Array, side: float) -> _Ring:
    """All around within the square, so many of its sides deep; less than 0: outside."""
    along, near = (np.arange(SPOTS) + 0.5) / SPOTS, np.full(SPOTS, depth)
    u, v = np.concatenate((along, 1 - near, along, near)), np.concatenate((near, along, 1 - near, along))
    x, y = place(square[None], u, v)
    return _Ring((np.stack((x[0], y[0]), axis=1) - middle) / side, sample(grey, x, y)[0].astype(float))


def _soft(at: Array) -> Array:
    """A light that changes softly: a paraboloid's terms at each point."""
    x, y = at.T
    return np.stack((np.ones(len(at)), x, y, x * x, x * y, y * y), axis=1)


def _light(border: _Ring, paper: _Ring) -> tuple[Basis, Array, Array, float]:
    """The light that explains most: how it is described, that of dark and light in it, and the share."""
    band = _band(border, paper)[None]
    fits = []
    for basis in (lambda at: np.stack((np.ones(len(at)), _share(band, at)[0]), axis=1), _soft):
        dark, light = (np.linalg.lstsq(basis(ring.at), ring.grey, rcond=None)[0] for ring in (border, paper))
        left = sum(((ring.grey - basis(ring.at) @ fit) ** 2).sum() for ring, fit in ((border, dark), (paper, light)))
        total = sum(((ring.grey - ring.grey.mean()) ** 2).sum() for ring in (border, paper))
        fits.append((basis, dark, light, 1 - left / max(total, 1e-6)))
    return max(fits, key=lambda fit: fit[3])


@lru_cache(maxsize=1)
def _everywhere() -> Array:
    """Bands (angle, low edge, high edge, softness) all over a square of side 1."""
    offsets = np.append(np.linspace(-REACH, REACH, OFFSETS), 9.0)
    low, high = np.triu_indices(len(offsets), 1)
    angle = np.repeat(np.arange(ANGLES) * np.pi / ANGLES, len(low))
    low, high = np.tile(offsets[low], ANGLES), np.tile(offsets[high], ANGLES)
    return np.stack((angle, low, high, np.full(len(angle), SOFT)), axis=1)


def _share(bands: Array, at: Array) -> Array:
    """How much of each point (p, 2) lies within each band (n, 4): (n, p), 0 to 1."""
    across = np.cos(bands[:, :1]) * at[:, 0] + np.sin(bands[:, :1]) * at[:, 1]
    low, high, soft = bands[:, 1:2], bands[:, 2:3], bands[:, 3:4]
    within: Array = np.clip(np.minimum(across - low, high - across) / soft + 0.5, 0, 1)
    return within


def _band(border: _Ring, paper: _Ring) -> Array:
    """The band that explains most of what changes along both."""
    bands = _everywhere()
    best: Array = bands[_explained(bands, border, paper).argmax()]
    for finer in FINER:
        steps = finer * np.array([-1.0, 0.0, 1.0])
        grids = np.meshgrid(steps * np.pi / ANGLES, *[steps * 2 * REACH / (OFFSETS - 1)] * 2, SOFTNESS, indexing="ij")
        bands = np.stack([grid.ravel() for grid in grids], axis=1) + np.append(best[:3], 0.0)
        best = bands[_explained(bands, border, paper).argmax()]
    return best


def _explained(bands: Array, *rings: _Ring) -> Array:
    found = np.zeros(len(bands))
    for ring in rings:
        share = _share(bands, ring.at)
        share -= share.mean(axis=1, keepdims=True)
        found += (share @ ring.grey) ** 2 / np.maximum((share**2).sum(axis=1), 0.5)
    return found
