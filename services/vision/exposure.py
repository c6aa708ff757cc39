"""Whether the light or the dark of a marker is cut off in a picture: its edges are not quite where they seem then.

An edge is found where grey is half way from dark to light; with one of them cut off, half way lies elsewhere on the
slope. High contrast does that, and much light. Pure.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

SIDE, RIM = 48, 6  # pixels of the marker as it is looked at, and of the paper around it
ENDS = (2, 253)  # grey levels: the noise of a picture and of its packing does not leave them
SHARE = 0.1  # of the pixels; a few are there by chance


def cut_off(grey: NDArray[np.uint8], corners: NDArray[np.float64]) -> bool:
    """Whether many pixels of a marker, or of the paper beside it, are as dark or as light as can be.

    `grey` is (h, w); `corners` (4, 2) are pixels, clockwise.
    """
    low, high = RIM, SIDE - RIM
    square = np.array([[low, low], [high, low], [high, high], [low, high]], np.float32)
    turned = cv2.getPerspectiveTransform(square, np.asarray(corners, np.float32))
    how = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    flat = cv2.warpPerspective(grey, turned, (SIDE, SIDE), flags=how, borderMode=cv2.BORDER_REPLICATE)
    return bool(max((flat <= ENDS[0]).mean(), (flat >= ENDS[1]).mean()) > SHARE)
