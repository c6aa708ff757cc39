"""Whether two pictures of a camera were taken from the same pose: small grey copies of them, laid over each other.

Light that changes is no motion, and neither is what an encoder makes of a still picture after a turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from services.camera.video.pictures import Image

WIDTH = 288  # of the small copy, pixels
SHIFT_PX = 0.1  # of the small copy: under one pixel of a large picture. Measured at rest: at most 0.05
RESPONSE = 0.5  # of the phase correlation. Measured: at rest over 0.9, also while it grows lighter; turning under 0.4
EVEN = 0.6  # mean difference, grey levels: pictures that hardly differ show no motion, or show nothing at all

Likeness = Literal["same", "moved", "unclear"]


@dataclass(frozen=True, eq=False)
class Thumb:
    """A small grey copy, and how light it is."""

    grey: NDArray[np.float32]
    light: float


def thumb(image: Image) -> Thumb:
    """The small copy of a picture (BGR)."""
    step = max(1, image.shape[1] // (4 * WIDTH))  # what is left out is noise only
    height = max(2, round(WIDTH * image.shape[0] / image.shape[1]))
    grey = cv2.cvtColor(np.ascontiguousarray(image[::step, ::step]), cv2.COLOR_BGR2GRAY)
    small = cv2.resize(grey, (WIDTH, height), interpolation=cv2.INTER_AREA).astype(np.float32)
    return Thumb(small, float(small.mean()))


def likeness(before: Thumb, after: Thumb) -> Likeness:
    """Whether both were taken from the same pose; "unclear": there is too little to be seen."""
    if before.grey.shape != after.grey.shape:
        return "moved"
    one, other = before.grey - before.light, after.grey - after.light
    (right, down), response = cv2.phaseCorrelate(one, other)
    if response > RESPONSE:
        return "same" if hypot(right, down) < SHIFT_PX else "moved"
    return "unclear" if float(np.abs(one - other).mean()) < EVEN else "moved"
