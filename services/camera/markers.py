"""Finding markers in a picture, for users of the package. The work is in `services.vision`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.vision.detect import detect as _detect

Found = tuple[int, NDArray[np.float64], float]


def detect(image_bgr: NDArray[np.uint8], dictionary_name: str) -> list[Found]:
    """Every marker of that dictionary: id, corners (4, 2) in pixels clockwise from its own top left, confidence."""
    found = _detect(image_bgr, dictionary_name, None)
    return [(one.marker, np.asarray(one.corners, float), one.confidence) for one in found]
