"""Where a marker is: its corners in one or many pictures to a position in the apartment, with what is sure about it.

Frames as in `frames`; the marker's is x right, y up, z out of the print towards the viewer. A marker that was moved
between two sights is not averaged: sights that contradict each other are told apart, and the newer ones count. What
is put together is in `views`, turns are found in `orientation`, places in `fusion`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians

import numpy as np
from numpy.typing import NDArray

from services.vision import fusion
from services.vision.fusion import Place
from services.vision.orientation import ranked, weighed
from services.vision.prior import Prior
from services.vision.views import Sights, View, by_place, gather

Array = NDArray[np.float64]

GATE = 28.0  # squared distance of two places in variances, beyond which they are two: 4 in a million of normal errors
DOUBTED_DEG = 0.1  # readings are taken to be no better than that when two places are compared
MISTAKEN, CONFIRMED = 1, 3  # so few views that contradict so many are a mistake

__all__ = ["Located", "View", "locate", "locate_each"]


@dataclass(frozen=True, eq=False)
class Located:
    """A marker in the apartment: `position` (3,) in metres with its `covariance` (3, 3) in square metres.

    `orientations` holds (rotation 3x3 T_AM, weight), best first, weights adding up to 1: one entry when it is clear,
    two when it is not. `distance` is that from the nearest lens in metres; `used` are the indexes of the views.
    """

    position: Array
    covariance: Array
    orientations: tuple[tuple[Array, float], ...]
    distance: float
    used: tuple[int, ...]

    @property
    def frames(self) -> int:
        """How many views it comes from."""
        return len(self.used)


def locate(views: Sequence[View], prior: Prior | None = None) -> Located:
    """The marker's place from all views of it; where it was moved in between, the newest place.

    ValueError without views, and when no marker whose face is turned to every lens explains them (mirrored corners).
    """
    return locate_each(views, prior)[0]


def locate_each(views: Sequence[View], prior: Prior | None = None) -> tuple[Located, ...]:
    """The same for every marker of this id that is there: the newest first, without places that one has left.

    Two that were seen at the same time are two markers; one that was seen only before the newest has been moved.
    """
    groups = _groups(views, prior)
    if not groups:
        raise ValueError("expected clockwise corners of squares turned to the camera: no pose explains them")
    newest = groups[0]
    present = [one for one in groups if one is newest or one.until(views) > newest.since(views)]
    return tuple(_located(views, one, prior) for one in present)


@dataclass(frozen=True, eq=False)
class _Group:
    """Sights that agree: the indexes of the views of each, and where they have the marker, roughly."""

    places: tuple[tuple[int, ...], ...]
    rough: Place

    @property
    def count(self) -> int:
        return sum(map(len, self.places))

    def since(self, views: Sequence[View]) -> float:
        return min(views[index].at for place in self.places for index in place)

    def until(self, views: Sequence[View]) -> float:
        return max(views[index].at for place in self.places for index in place)


def _groups(views: Sequence[View], prior: Prior | None) -> list[_Group]:
    """The newest first; without single views that many contradict."""
    groups: list[_Group] = []
    for place in sorted(by_place(views), key=lambda place: -max(views[index].at for index in place)):
        single = _roughly(gather([[views[index] for index in place]]), prior)
        if single is None:
            continue
        fits = next((index for index, group in enumerate(groups) if _agree(group.rough, single)), None)
        if fits is None:
            groups.append(_Group((tuple(place),), single))
        else:
            known = groups[fits]
            groups[fits] = _Group((*known.places, tuple(place)), _together(known.rough, single))
    most = max((group.count for group in groups), default=0)
    return [one for one in groups if one.count > MISTAKEN or most < CONFIRMED]


def _roughly(sights: Sights, prior: Prior | None) -> Place | None:
    """Where one sight has the marker; None when no marker explains it."""
    possible = ranked(sights, prior) if np.isfinite(sights.rays).all() else []
    least = radians(DOUBTED_DEG)
    swing = sights.swing if np.abs(sights.swing).max() > least else least * np.eye(3)[None]
    return fusion.fuse(replace(sights, swing=swing), possible[0], prior) if possible else None


def _agree(one: Place, other: Place) -> bool:
    off = one.position - other.position
    return float(off @ np.linalg.solve(one.covariance + other.covariance, off)) < GATE


def _together(one: Place, other: Place) -> Place:
    """The mean of both, weighed by their information."""
    weights = np.linalg.inv(one.covariance), np.linalg.inv(other.covariance)
    covariance = np.linalg.inv(weights[0] + weights[1])
    return Place(covariance @ (weights[0] @ one.position + weights[1] @ other.position), covariance)


def _located(views: Sequence[View], group: _Group, prior: Prior | None) -> Located:
    sights = gather([[views[index] for index in place] for place in group.places])
    best_first = ranked(sights, prior)
    if not best_first:
        raise ValueError("expected sights of one marker: no orientation explains them all")
    orientations = weighed(best_first)
    ways = [fusion.fuse(sights, hypothesis, prior) for hypothesis in best_first[: len(orientations)]]
    shares = [weight for _, weight in orientations]
    position = np.einsum("h,hi->i", shares, [way.position for way in ways])
    offs = [way.position - position for way in ways]
    covariance = sum(w * (way.covariance + np.outer(off, off)) for w, way, off in zip(shares, ways, offs, strict=True))
    distance = float(np.linalg.norm(position - sights.lens_at, axis=1).min())
    used = tuple(sorted(index for place in group.places for index in place))
    return Located(position, np.asarray(covariance, float), orientations, distance, used)
