"""Pictures: decoding, setting upright, drawing markers, encoding.

Not here: finding markers (`vision/`), asking for a snapshot (`brands/`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from services.camera.device import Away

Image = NDArray[np.uint8]
QUALITY = 80  # of the JPEGs that we make
BEGINNING, END = b"\xff\xd8", b"\xff\xd9"
LONGEST_TAIL = 4096  # bytes that firmware writes behind the end


def decode(jpeg: bytes) -> Image:
    """The picture as BGR (height, width, 3); Away when it is none, or not whole (the camera sends such at times)."""
    return _decoded(jpeg, cv2.IMREAD_COLOR)


def decode_grey(jpeg: bytes) -> Image:
    """The same in grey (height, width), in three quarters of the time."""
    return _decoded(jpeg, cv2.IMREAD_GRAYSCALE)


def whole(jpeg: bytes) -> bytes:
    """The same; Away when it lacks its beginning or its end. Of half a JPEG OpenCV makes a picture grey below."""
    if not jpeg.startswith(BEGINNING) or END not in jpeg[-LONGEST_TAIL:]:
        raise _no_picture(jpeg)
    return jpeg


def _decoded(jpeg: bytes, how: int) -> Image:
    image = cv2.imdecode(np.frombuffer(whole(jpeg), np.uint8), how)
    if image is None:
        raise _no_picture(jpeg)
    return image.astype(np.uint8, copy=False)


def _no_picture(data: bytes) -> Away:
    return Away(f"expected a whole JPEG, got {len(data)} bytes that are none")


def encode(image: Image, quality: int = QUALITY) -> bytes:
    """The picture as JPEG."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return data.tobytes()


def grey(image: Image) -> Image:
    """The brightness of a picture, (height, width)."""
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)


def thumbnail(image: Image, width: int) -> bytes:
    """The picture as a JPEG of that width."""
    size = (width, max(1, round(image.shape[0] * width / image.shape[1])))
    return encode(cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False))


def upright(image: Image, *, flip: bool, mirror: bool, kind: Literal["ceiling", "shelf"]) -> Image:
    """The picture as somebody standing in the room would see it; `flip` and `mirror` are how it was delivered.

    A ceiling camera hangs head down: its raw picture is turned by 180 degrees, so flipped and mirrored is upright.
    """
    down, across = (not flip, not mirror) if kind == "ceiling" else (flip, mirror)
    if not down and not across:
        return image
    return cv2.flip(image, -1 if down and across else 0 if down else 1).astype(np.uint8, copy=False)


def drawn(image: Image, found: Sequence[tuple[int, NDArray[np.float64]]]) -> Image:
    """A copy with each marker's outline (its first corner dotted) and id."""
    copy = image.copy()
    for marker, corners in found:
        points = np.rint(np.asarray(corners, float)).astype(np.int32)
        cv2.polylines(copy, [points], True, (0, 255, 0), 2)
        first = (int(points[0][0]), int(points[0][1]))
        cv2.circle(copy, first, 4, (0, 0, 255), -1)
        cv2.putText(copy, str(marker), (first[0], first[1] - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (0, 255, 0), 2)
    return copy


def one_thread() -> None:
    """For worker processes: several, each with one thread, are faster than one with several."""
    cv2.setNumThreads(1)
