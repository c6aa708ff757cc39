"""Markers in the frames of a camera that stands still: looked for once, in their mean, and then found again in each.

The mean of K frames shows what noise hides in every one of them, and costs one search instead of K. What the frames
do not agree on is no marker, or moved. Whether the camera stands still is known by whoever took the frames; frames
that show something else than most are left out here. One picture alone is `detect`'s.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision import codes, reading
from services.vision.corners import refine_many
from services.vision.detect import Detection, detect
from services.vision.fit import fit

Picture = NDArray[np.uint8]

COARSE = 8  # pixels by pixels that are compared as one
APART = 6.0  # grey levels by which a coarse pixel differs from the others' when something else is there
MOVED = 0.25  # share of the coarse pixels: more is not somebody who walks by but the camera that moved
AGREEING = 0.4  # correlation with the mean's code at which a single frame agrees
AGREED = 2  # frames that must agree, of three or more
LARGEST_GAIN = 4.0  # of a dark mean: its fractions of grey levels are worth keeping
BRIGHT = 235.0  # grey level that the brightest are raised to
BRIGHTEST = 99.5  # percent of the pixels are darker


@dataclass(frozen=True, eq=False)
class Still:
    """A marker seen in the mean, and in single frames: `frames` are their numbers, `each` as it is there."""

    detection: Detection
    frames: tuple[int, ...]
    each: tuple[Detection, ...]


def detect_still(frames: Sequence[Picture], dictionary: str, targets: Collection[int] | None = None) -> list[Still]:
    """What `detect` finds in the mean of these grey frames (h, w), at least one and all of one size; best first."""
    chosen = alike(frames)
    found = detect(mean([frames[index] for index in chosen]), dictionary, targets)
    seen = [_again(one, frames, chosen, dictionary) for one in found]
    least = AGREED if len(chosen) > AGREED else 1
    return [one for one in seen if len(one.frames) >= least]


def alike(frames: Sequence[Picture]) -> list[int]:
    """The numbers of the frames that show what most of them show; the first alone where no two agree."""
    if len(frames) < 2:
        return list(range(len(frames)))
    size = (max(1, frames[0].shape[1] // COARSE), max(1, frames[0].shape[0] // COARSE))
    coarse = [cv2.resize(frame[::2], size, interpolation=cv2.INTER_AREA) for frame in frames]
    groups = np.array([[(cv2.absdiff(one, other) > APART).mean() <= MOVED for other in coarse] for one in coarse])
    return [int(number) for number in np.flatnonzero(groups[groups.sum(axis=1).argmax()])]


def mean(frames: Sequence[Picture]) -> Picture:
    """The mean of the frames; a dark one is made brighter, so that no fraction of a grey level is lost."""
    if len(frames) == 1:
        return frames[0]
    total = np.zeros(frames[0].shape, np.float32)
    for frame in frames:
        cv2.accumulate(frame, total)
    brightest = float(np.percentile(total[::COARSE, ::COARSE], BRIGHTEST)) / len(frames)
    gain = float(np.clip(BRIGHT / max(brightest, 1.0), 1.0, LARGEST_GAIN))
    return np.asarray(cv2.convertScaleAbs(total, alpha=gain / len(frames)), np.uint8)


def _again(found: Detection, frames: Sequence[Picture], chosen: Sequence[int], dictionary: str) -> Still:
    seen = {number: _in_one(found, frames[number], dictionary) for number in chosen}
    agreeing = {number: one for number, one in seen.items() if one is not None}
    return Still(found, tuple(agreeing), tuple(agreeing.values()))


def _in_one(found: Detection, frame: Picture, dictionary: str) -> Detection | None:
    """The marker as it is in one frame; None where that shows something else."""
    book = codes.book(dictionary)
    by_sides = refine_many(frame, found.corners[None], book.modules)
    if np.isnan(by_sides).any():
        return None
    cells = reading.cells(frame, by_sides, book.modules)
    if reading.fits(cells.inner, book.seen[1][found.marker][None])[0, 0] < AGREEING:
        return None
    by_code = fit(frame, found.corners, codes.cells(dictionary, found.marker)) if found.sides is not None else None
    if by_code is None:
        return replace(found, corners=by_sides[0], sides=None)
    return replace(found, corners=by_code, sides=by_sides[0])
