"""Frames of a scan out of the moving picture: quicker than snapshots, but with the encoder's marks on them.

Only pictures that are surely from after the end of the move are taken. Where none comes in time, or the stream has
another shape than the picture that was calibrated, a snapshot is taken instead.
"""

from __future__ import annotations

import logging

from services.camera.plan import Plan, wait
from services.camera.requests import Away
from services.camera.scan.search import snapshot
from services.camera.video import pictures
from services.camera.video.channel import Channel
from services.camera.video.newest import Frame

LONGEST_S = 3.0
STEP_S = 0.03
SAME_SHAPE = 0.01  # of the aspect; the lens refuses more
FINE = 95  # quality: the frame has been through one encoder already

log = logging.getLogger(__name__)


class Streamed:
    """A Take (`search.py`). `aspect`: width by height of the calibrated picture, None: any."""

    def __init__(self, channel: Channel, aspect: float | None) -> None:
        self.channel = channel
        self.aspect = aspect
        self._last = 0
        self._unfit = False

    def __call__(self, after: float, now: float) -> Plan[tuple[bytes, float, float]]:
        """A frame exposed after that moment, and after the one before."""
        until = now + LONGEST_S
        with self.channel.newest.watched():
            while now < until and self.channel.timed and not self._unfit:
                frame = self.channel.newest.frame
                if frame is not None and frame.number > self._last and frame.exposure.after(after):
                    self._last = frame.number
                    data = self._encoded(frame)
                    if data is not None:
                        return data, frame.exposure.at, now
                now = yield from wait(now + STEP_S)
        return (yield from snapshot(after, now))

    def _encoded(self, frame: Frame) -> bytes | None:
        """The frame as the camera delivered it; None when it is broken or its shape is another one."""
        try:
            image = frame.develop()
        except Away:
            return None
        aspect = image.shape[1] / image.shape[0]
        self._unfit = self.aspect is not None and abs(aspect / self.aspect - 1) > SAME_SHAPE
        if self._unfit:
            size = f"{image.shape[1]}x{image.shape[0]}"
            log.warning("the stream's picture of %s has another shape than the calibrated one: snapshots instead", size)
            return None
        return pictures.encode(image, FINE)
