"""Dark squares on lighter ground: the outlines in a picture that could be markers. What is in them is `reading`'s.

Thresholds are local and their step follows the picture's noise, so that dim and hazy pictures need no other look. A
small window splits a hard shadow's edge off a border, a picture shrunk by half lets it see blurred edges. An outline
with more than four corners (a finger over the border, a shadow grown into it) is tried by every four of its sides.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

WINDOW = 7  # px of the threshold's neighbourhood: wider ones join a small marker to what is beside it
STEPS = (3.0, 8.0)  # least and most grey levels by which a pixel must be darker than its neighbourhood
NOISES = 2.5  # the same in standard deviations of the noise: more lets specks grow into the outline
SPECK_STEPS = (1, 2)  # of so many pixels or fewer is a speck: in this order, since one speck is another's company
ROUGH = 0.03  # of an outline's length: how far it may leave the straight line between two corners
FINEST_PX = 1.0  # and never less: an outline goes from pixel to pixel
PLUMP = 0.015  # least area by the length of the outline squared: 1/16 of a square, 0.04 of one seen at 75 degrees
LEAST_ANGLE = 0.17  # sine between neighbouring sides: a square seen at more than 75 degrees cannot be read
MOST_CORNERS = 12  # of an outline that is worth being tried by its sides
SIDES_TRIED = 7  # the longest of them
ROWS = 60  # of the picture that the noise is measured in
COVERED = 0.5  # share of a square's outline that the four sides must make up
WIDEST = 6.0  # longest by shortest side
FOURS = np.array(list(combinations(range(SIDES_TRIED), 4)))
ONWARD = FOURS * SIDES_TRIED + np.roll(FOURS, -1, axis=1)  # from each of four sides to the next, in a table of sides


def noise(grey: Picture) -> float:
    """The standard deviation of the picture's noise, in grey levels, from neighbours in some of its rows."""
    rows = grey[:: max(1, grey.shape[0] // ROWS)].astype(np.int16)
    bend = np.abs(rows[:, 2:] - 2 * rows[:, 1:-1] + rows[:, :-2])
    if not bend.size:
        return 0.0
    share = np.cumsum(np.bincount(bend.ravel(), minlength=2)) / bend.size
    middle = int(np.searchsorted(share, 0.5))  # the median: edges are rare
    below = float(share[middle - 1]) if middle else 0.0
    return (middle - 0.5 + (0.5 - below) / (share[middle] - below)) / 0.6745 / 6**0.5 if middle else 0.0


def darker_by(noise: float) -> float:
    """The threshold's step, grey levels, in a picture of that noise."""
    return float(np.clip(NOISES * noise, *STEPS))


def squares(grey: Picture, least_px: float, step: float, windows: Sequence[int] = (WINDOW,)) -> Array:
    """Rough outlines (n, 4, 2), clockwise in the picture, of dark squares with sides of at least `least_px`.

    Dark is what is darker by `step` than its neighbourhood, which is a window of so many pixels, one after the other.
    """
    if min(grey.shape) < 8:
        return np.zeros((0, 4, 2))
    return _outlined((_darker(grey, window, step) for window in windows), least_px)


def _darker(grey: Picture, window: int, step: float) -> NDArray[Any]:
    """1 where it is darker than around: what `adaptiveThreshold` does in twice the time."""
    around = cv2.blur(grey, (window, window), borderType=cv2.BORDER_REPLICATE)
    return cv2.threshold(cv2.subtract(around, grey), int(step) - 1, 1, cv2.THRESH_BINARY)[1]


def squares_at_levels(grey: Picture, least_px: float, levels: int) -> Array:
    """The same by so many levels of grey: the outlines of what a shadow's edge crosses, where that is no local one."""
    known = np.unique(np.percentile(grey[::4, ::4], np.linspace(0, 100, levels + 2)[1:-1]).astype(int))
    return _outlined(((grey <= level).view(np.uint8) for level in known), least_px)


def _outlined(pictures: Iterable[NDArray[Any]], least_px: float) -> Array:
    """Every square once, of what is 1, and not 0, in any of the pictures."""
    area = least_px**2 * LEAST_ANGLE
    fours, others = [], []
    for dark in pictures:
        outlines, _ = cv2.findContours(_without_specks(dark), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        longest = 4 * max(dark.shape)
        for outline, length in zip(outlines, map(len, outlines), strict=True):
            large = 3 * least_px < length < longest
            if large and cv2.contourArea(outline, True) < -max(area, PLUMP * length**2):  # above 0: a hole's
                corners = cv2.approxPolyDP(outline, max(ROUGH * length, FINEST_PX), True)[:, 0]
                if len(corners) == 4:
                    fours.append(corners)
                elif 4 < len(corners) <= MOST_CORNERS or len(corners) == 3:
                    finer = cv2.approxPolyDP(outline, max(ROUGH / 2 * length, FINEST_PX), True)[:, 0]
                    others.append(finer if 4 < len(finer) <= MOST_CORNERS else corners)
    found = [np.array(fours, float).reshape(-1, 4, 2)[:, ::-1], _by_sides(others)]
    return _distinct(_sound(np.concatenate(found), least_px))


def _distinct(found: Array) -> Array:
    """Nearly each once: of those whose middle and extent round to the same pixels the first."""
    about = np.rint(np.concatenate((found.mean(axis=1), found.std(axis=1)), axis=1))
    return np.asarray(found[np.sort(np.unique(about, axis=0, return_index=True)[1])])


def _without_specks(dark: NDArray[Any]) -> NDArray[Any]:
    """Only pixels in company: noise alone makes tens of thousands of specks, and each would be an outline.

    From a pixel of something larger, its nearest neighbours in it lie within as many steps as there are of them: no
    outline of anything larger than a speck is changed.
    """
    for steps in SPECK_STEPS:
        window = (2 * steps + 1, 2 * steps + 1)
        company = cv2.boxFilter(dark, -1, window, normalize=False, borderType=cv2.BORDER_CONSTANT)
        dark = cv2.bitwise_and(dark, cv2.threshold(company, steps, 1, cv2.THRESH_BINARY)[1])
    return dark


def _sound(candidates: Array, least_px: float) -> Array:
    """Those that are convex, clockwise, not too small and not too slanted."""
    along = np.roll(candidates, -1, axis=1) - candidates
    length = np.linalg.norm(along, axis=2)
    before = np.roll(along, 1, axis=1)
    turn = before[..., 0] * along[..., 1] - before[..., 1] * along[..., 0]
    sine = turn / np.maximum(length * np.roll(length, 1, axis=1), 1e-9)
    large = length.max(axis=1) >= least_px
    sound: Array = candidates[
        (sine.min(axis=1) > LEAST_ANGLE) & large & (length.max(axis=1) < WIDEST * length.min(axis=1))
    ]
    return sound


def _by_sides(polygons: list[NDArray[Any]]) -> Array:
    """For each outline the two squares that the most of it lies on, each of four of its sides made longer."""
    many = [polygon for polygon in polygons if len(polygon) > 4]
    if not many:
        return np.zeros((0, 4, 2))
    points = np.zeros((len(many), MOST_CORNERS, 2))
    for row, polygon in enumerate(many):
        points[row, : len(polygon)] = polygon[::-1]
    rows, count = np.arange(len(many))[:, None], np.array([len(polygon) for polygon in many])[:, None]
    side = np.arange(MOST_CORNERS)
    extents = np.where((side < count)[..., None], points[rows, (side + 1) % count] - points, 0.0)
    chosen = np.sort(np.argsort(-np.linalg.norm(extents, axis=2), axis=1, kind="stable")[:, :SIDES_TRIED], axis=1)
    start, along = points[rows, chosen], extents[rows, chosen]  # (n, sides, 2)
    ahead = along / np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-9)
    sine = ahead[:, :, None, 0] * ahead[:, None, :, 1] - ahead[:, :, None, 1] * ahead[:, None, :, 0]
    rightward = (sine > LEAST_ANGLE).reshape(len(many), -1)
    around = rightward[:, ONWARD].all(axis=2)  # (n, fours): always to the right
    corners, share = np.zeros((*around.shape, 4, 2)), np.zeros(around.shape)
    corners[around], share[around] = _joined(start[:, FOURS][around], along[:, FOURS][around])
    best = np.argsort(-share, axis=1)[:, :2]
    return corners[rows, best][share[rows, best] > 0]


def _joined(start: Array, along: Array) -> tuple[Array, Array]:
    """Squares (n, 4, 2) of four sides each, made longer, and the share that the sides make up; 0: too little."""
    length = np.linalg.norm(along, axis=2)
    normal = np.stack((-along[..., 1], along[..., 0]), axis=2) / length[..., None]
    distance = (normal * start).sum(axis=2)
    before, before_distance = np.roll(normal, 1, axis=1), np.roll(distance, 1, axis=1)
    slant = before[..., 0] * normal[..., 1] - before[..., 1] * normal[..., 0]
    x = (before_distance * normal[..., 1] - distance * before[..., 1]) / slant
    y = (before[..., 0] * distance - normal[..., 0] * before_distance) / slant
    corners = np.stack((x, y), axis=2)
    sides = np.roll(corners, -1, axis=1) - corners
    onward = ((sides * along).sum(axis=2) > 0).all(axis=1)
    around = np.linalg.norm(sides, axis=2)
    covered = np.minimum(length / np.maximum(around, 1e-9), 1.2)
    share = (covered * around).sum(axis=1) / np.maximum(around.sum(axis=1), 1e-9)
    return corners, np.where(onward & (covered.min(axis=1) > 0.15) & (share >= COVERED), share, 0.0)
