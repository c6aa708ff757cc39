"""Pictures that carry a number, as bright and dark blocks that survive JPEG, and a stream of them from our own port."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from services.camera.video.newest import Newest, Upright
from services.camera.video.proxy import Proxy
from services.camera.video.settings import StreamSettings
from services.camera.video.timing import Exposure

BITS, BLOCK = 12, 32  # of the number; pixels
SIZE = (1152, 648)
Pixels = NDArray[np.uint8]


def drawn(number: int, colour: tuple[int, int, int] = (90, 90, 90)) -> bytes:
    """A picture as JPEG that shows a number, on that colour (BGR)."""
    pixels = np.full((SIZE[1], SIZE[0], 3), colour, np.uint8)
    for bit in range(BITS):
        pixels[:BLOCK, bit * BLOCK : (bit + 1) * BLOCK] = 255 * (number >> bit & 1)
    done, jpeg = cv2.imencode(".jpg", pixels)
    assert done
    return bytes(jpeg)


def shown(pixels: Pixels) -> int:
    """The number that a picture shows."""
    middle = BLOCK // 2
    return sum(int(pixels[middle, bit * BLOCK + middle, 0] > 127) << bit for bit in range(BITS))


@dataclass
class Stream:
    """A running stream; `put` when each number came into the slot, seconds of the monotonic clock."""

    url: str
    put: dict[int, float] = field(default_factory=dict)
    jpegs: dict[int, bytes] = field(default_factory=dict)
    watchers: list[int] = field(default_factory=list)


@contextmanager
def stream(fps: float, colour: tuple[int, int, int] = (90, 90, 90)) -> Iterator[Stream]:
    """The camera service's own port, fed with numbers."""
    newest = Newest(Upright(flip=True, mirror=True))
    proxy = Proxy("ip1", StreamSettings(fps=60), newest, lambda key: key == "RTSP", lambda: True)
    running = Stream(f"http://127.0.0.1:{proxy.server_port}/camera/ip1/stream.mjpg")
    stopping = threading.Event()

    def feed() -> None:
        number, due = 0, time.monotonic()
        while not stopping.wait(max(0.0, due - time.monotonic())):
            number, due = number % (2**BITS - 1) + 1, due + 1 / fps
            running.jpegs[number] = drawn(number, colour)
            running.put[number] = time.monotonic()
            running.watchers.append(newest.watchers)
            now = time.time()
            newest.put(lambda: np.zeros((1, 1, 3), np.uint8), Exposure(now, 0.01), now, running.jpegs[number])

    feeder = threading.Thread(target=feed)
    feeder.start()
    try:
        yield running
    finally:
        stopping.set()
        feeder.join()
        proxy.close()
