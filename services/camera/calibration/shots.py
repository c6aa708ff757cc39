"""Pictures for a calibration: taken at the widest zoom, set upright, and looked at beside the main thread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from services.camera.calibration.study import study
from services.camera.device import Picture, Snapshot
from services.camera.plan import Plan, ask, attempt, wait
from services.camera.video import pictures
from services.vision.board import Board, Seen, find
from services.vision.calibrate_lens import Array
from services.vision.detect import detect
from services.vision.frames import Kind
from services.vision.lens import Lens
from services.vision.views import straight
from services.vision.zoom import Magnification, measure

TRIES, AGAIN_S = 3, 0.3  # of a picture: the camera sometimes closes without an answer
THUMB_PX = 960  # width of what the report shows


@dataclass(frozen=True)
class How:
    """How the camera delivers its picture."""

    picture: Picture
    kind: Kind

    def upright(self, jpeg: bytes) -> pictures.Image:
        """Decoded and set upright; Away when it is no picture."""
        image = pictures.decode(jpeg)
        return pictures.upright(image, flip=self.picture.flip, mirror=self.picture.mirror, kind=self.kind)


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture of `size` (width, height), small for the report."""

    size: tuple[int, int]
    thumbnail: bytes


@dataclass(frozen=True, eq=False)
class BoardShot(Shot):
    """What is seen of the board; None: nothing of use."""

    seen: Seen | None


@dataclass(frozen=True, eq=False)
class MarkerShot(Shot):
    """The markers' corners (4, 2), by id, put right for how the lens bends them."""

    markers: dict[int, Array]


def taken(now: float) -> Plan[tuple[bytes, float]]:
    """A snapshot, and the time when it had come; DeviceError when there is none."""
    for _ in range(TRIES - 1):
        reply = yield from attempt(Snapshot())
        if reply.error is None:
            return cast(bytes, reply.result), reply.received
        yield from wait(reply.received + AGAIN_S)
    reply = yield from ask(Snapshot())
    return cast(bytes, reply.result), reply.received


def board_in(jpeg: bytes, how: How, board: Board) -> BoardShot:
    """Looks for a board."""
    image = how.upright(jpeg)
    seen = find(pictures.grey(image), board)
    return BoardShot((image.shape[1], image.shape[0]), pictures.thumbnail(image, THUMB_PX), seen)


def compared(wide: bytes, zoomed: bytes, how: How) -> Plan[tuple[Magnification, float]]:
    """How much the second picture is magnified over the first, and the time then; Refused when it cannot be told."""
    return study(lambda: measure(how.upright(wide), how.upright(zoomed)))


def markers_in(
    jpegs: Sequence[bytes], how: How, dictionary: str, known: Sequence[int], wanted: int | None, lens: Lens
) -> MarkerShot:
    """Looks for known markers in pictures of the same; corners are their mean, of markers that the first shows once.

    A marker that is hard to see is only looked for, which takes long, when it is the `wanted` one; None: all are.
    """
    first = how.upright(jpegs[0])
    through = lens.scaled(first.shape[1], first.shape[0])
    seen = {marker: corners for marker, corners in _once(first, dictionary, None, through).items() if marker in known}
    if wanted is None or wanted not in seen:
        seen = {**seen, **_once(first, dictionary, known if wanted is None else [wanted], through)}
    found = {marker: [corners] for marker, corners in seen.items()}
    for jpeg in jpegs[1:] if found else ():
        for marker, corners in _once(how.upright(jpeg), dictionary, sorted(found), through).items():
            found[marker].append(corners)
    mean = {marker: np.mean(corners, axis=0) for marker, corners in found.items() if 2 * len(corners) > len(jpegs)}
    return MarkerShot((first.shape[1], first.shape[0]), pictures.thumbnail(first, THUMB_PX), mean)


def _once(image: pictures.Image, dictionary: str, targets: Sequence[int] | None, lens: Lens) -> dict[int, Array]:
    seen = [one for one in detect(image, dictionary, targets) if one.whole(image.shape[1], image.shape[0])]
    ids = [one.marker for one in seen]
    once = [one for one in seen if ids.count(one.marker) == 1]
    return {one.marker: straight(one.corners, one.sides, lens) for one in once}
