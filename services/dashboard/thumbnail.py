"""A picture made small. Not here: when that is wanted (`http/thumbnails.py`)."""

from __future__ import annotations

import cv2
import numpy as np

WIDTH = 240
QUALITY = 70


def smaller(jpeg: bytes) -> bytes | None:
    """A JPEG of WIDTH pixels across; None when it is no picture."""
    picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_REDUCED_COLOR_4)
    if picture is None:
        return None
    height = max(1, round(picture.shape[0] * WIDTH / picture.shape[1]))
    small = cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
