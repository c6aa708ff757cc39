"""One slot for the newest picture, between the thread that reads and all who look. There is no queue.

A picture that nobody took before the next one came is dropped and counted. It is decoded and encoded once, when the
first viewer wants it, in that viewer's thread. Not here: where pictures come from (`reader.py`), and who looks
(`proxy.py`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Condition, Lock
from typing import Literal, NamedTuple

from services.camera.device import Away
from services.camera.video import pictures
from services.camera.video.pictures import Image
from services.camera.video.timing import Exposure


@dataclass(frozen=True)
class Upright:
    """How the camera delivers its pictures, and how it hangs."""

    flip: bool = True
    mirror: bool = True
    kind: Literal["ceiling", "shelf"] = "ceiling"

    def turn(self, image: Image) -> Image:
        """The picture upright."""
        return pictures.upright(image, flip=self.flip, mirror=self.mirror, kind=self.kind)

    def jpeg(self, jpeg: bytes) -> bytes:
        """The picture upright as JPEG, as it is where nothing is to be turned; Away when it is no whole JPEG."""
        image = pictures.decode(jpeg)
        turned = self.turn(image)
        return jpeg if turned is image else pictures.encode(turned)


@dataclass(frozen=True)
class Frame:
    """One picture as it was delivered. `arrived` in seconds since 1970; `jpeg` where it came as one."""

    number: int
    develop: Callable[[], Image]  # BGR; Away when the data make no picture
    exposure: Exposure
    arrived: float
    upright: Upright
    jpeg: bytes | None = None

    def encode(self) -> bytes:
        """The upright picture as JPEG; Away when the data make no picture."""
        if self.jpeg is not None:
            return self.upright.jpeg(self.jpeg)
        return pictures.encode(self.upright.turn(self.develop()))


class Encoded(NamedTuple):
    """One picture as JPEG; `exposed` in seconds since 1970. Without data it could not be made."""

    number: int
    data: bytes
    exposed: float


class Newest:
    """The slot. For several threads."""

    def __init__(self, upright: Upright, clock: Callable[[], float] = time.time) -> None:
        self.upright = upright
        self.clock = clock
        self.frames = self.dropped = self.broken = 0
        self._frame: Frame | None = None
        self._taken = 0  # number of the newest frame that somebody took
        self._watchers = 0
        self._taps: list[Callable[[Frame], None]] = []
        self._closed = False
        self._changed = Condition()
        self._encoding = Lock()
        self._encoded = Encoded(0, b"", 0.0)

    @contextmanager
    def watched(self) -> Iterator[None]:
        """While somebody looks, pictures are decoded."""
        with self._changed:
            self._watchers += 1
        try:
            yield
        finally:
            with self._changed:
                self._watchers -= 1

    @contextmanager
    def tapped(self, see: Callable[[Frame], None]) -> Iterator[None]:
        """While it lasts, every picture is shown to `see`, on the thread that brings it."""
        self._taps.append(see)
        try:
            yield
        finally:
            self._taps.remove(see)

    @property
    def wanted(self) -> bool:
        """Whether anybody looks."""
        return self._watchers > 0

    @property
    def watchers(self) -> int:
        """How many look."""
        return self._watchers

    def put(self, develop: Callable[[], Image], exposure: Exposure, arrived: float, jpeg: bytes | None = None) -> None:
        """A new picture; the one before is gone."""
        with self._changed:
            self.frames += 1
            if self._frame is not None and self._taken < self._frame.number and self.wanted:
                self.dropped += 1
            self._frame = frame = Frame(self.frames, develop, exposure, arrived, self.upright, jpeg)
            self._changed.notify_all()
        for see in list(self._taps):
            see(frame)

    @property
    def frame(self) -> Frame | None:
        """The newest picture."""
        return self._frame

    def stale(self, age_s: float) -> int:
        """The number up to which pictures are older than that: a newer one may be shown as how it is now."""
        frame = self._frame
        if frame is None:
            return 0
        return frame.number - 1 if self.clock() - frame.arrived <= age_s else frame.number

    def wait(self, number: int, timeout_s: float) -> Frame | None:
        """A picture newer than that number; None when none came in that time or there will be none."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._newer(number), timeout_s)
            return self._frame if self._newer(number) and not self._closed else None

    def jpeg(self, number: int, timeout_s: float) -> Encoded | None:
        """The newest picture after that number, upright, as JPEG; one encoding serves all who ask. None: see wait."""
        end = time.monotonic() + timeout_s
        while (frame := self.wait(number, max(0.0, end - time.monotonic()))) is not None:
            encoded = self._encode(frame)
            if encoded is not None:
                return encoded
            number = frame.number
        return None

    def close(self) -> None:
        """Wakes all who wait; nobody gets another picture."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _newer(self, number: int) -> bool:
        return self._frame is not None and self._frame.number > number

    def _encode(self, frame: Frame) -> Encoded | None:
        with self._encoding:
            if self._encoded.number < frame.number:
                self._taken = max(self._taken, frame.number)
                self._encoded = Encoded(frame.number, self._jpeg_of(frame), frame.exposure.at)
            return self._encoded if self._encoded.data else None

    def _jpeg_of(self, frame: Frame) -> bytes:
        try:
            return frame.encode()
        except Away:
            self.broken += 1
            return b""
