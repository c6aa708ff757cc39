"""A camera service's own stream, of pictures that are made here: for those who look through the dashboard."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from services.camera.video.newest import Newest, Upright
from services.camera.video.proxy import Proxy
from services.camera.video.settings import StreamSettings
from services.camera.video.timing import Exposure

EVERY_S = 0.05


@dataclass(frozen=True)
class Streaming:
    """Pictures come until `stands` is set."""

    proxy: Proxy
    url: str
    stands: threading.Event = field(default_factory=threading.Event)


@contextmanager
def camera(*, on: bool = True, shade: int = 0) -> Iterator[Streaming]:
    """A picture every 50 ms while somebody looks, all of that grey."""
    newest, ended = Newest(Upright()), threading.Event()
    proxy = Proxy("ip1", StreamSettings(fps=30), newest, lambda _: on, lambda: True)
    made = Streaming(proxy, f"http://127.0.0.1:{proxy.server_port}{proxy.stream_path}")

    def expose() -> None:
        while not ended.wait(EVERY_S):
            if not made.stands.is_set():
                newest.put(
                    lambda: np.full((90, 160, 3), shade, np.uint8), Exposure(newest.clock(), 0.0), newest.clock()
                )

    source = threading.Thread(target=expose)
    source.start()
    try:
        yield made
    finally:
        ended.set()
        source.join()
        proxy.close()
