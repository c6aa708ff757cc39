"""The picture for all viewers by one connection: a real camera proxy, and people who look through the dashboard."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from services.camera.video.newest import Newest, Upright
from services.camera.video.proxy import Proxy
from services.camera.video.settings import StreamSettings
from services.camera.video.timing import Exposure
from services.dashboard.http.video import Videos
from services.errors import Unavailable

LIMIT_S = 20.0


@contextmanager
def camera(*, on: bool = True) -> Iterator[tuple[Proxy, str]]:
    """A camera service's own stream, a picture every 50 ms while somebody looks."""
    newest, ended = Newest(Upright()), threading.Event()

    def expose() -> None:
        while not ended.wait(0.05):
            newest.put(lambda: np.zeros((90, 160, 3), np.uint8), Exposure(0, 0), newest.clock())

    proxy = Proxy("ip1", StreamSettings(fps=30), newest, lambda _: on, lambda: True)
    source = threading.Thread(target=expose)
    source.start()
    try:
        yield proxy, f"http://127.0.0.1:{proxy.server_port}{proxy.stream_path}"
    finally:
        ended.set()
        source.join()
        proxy.close()


def test_all_viewers_share_one_connection_to_the_camera_service() -> None:
    async def look(url: str, proxy: Proxy) -> None:
        videos = Videos()
        streams = [await videos.watch(url) for _ in range(5)]
        for stream in streams:
            assert (await anext(stream)).startswith(b"--picture\r\n")
            for _ in range(2):
                part = await anext(stream)
                assert b"Content-Type: image/jpeg" in part
                assert b"\xff\xd8" in part
                assert part.endswith(b"\r\n--picture\r\n")
        assert proxy.seats._value == proxy.settings.viewers - 1
        for stream in streams:
            await stream.aclose()  # type: ignore[attr-defined]
        while proxy.seats._value < proxy.settings.viewers:  # nobody asks any more, so the one connection ends
            await asyncio.sleep(0.05)
        await videos.close()

    with camera() as (proxy, url):
        asyncio.run(asyncio.wait_for(look(url, proxy), LIMIT_S))


def test_a_stream_that_is_off_is_told_in_the_camera_services_words() -> None:
    async def look(url: str) -> None:
        videos = Videos()
        with pytest.raises(Unavailable, match="the stream is off"):
            await videos.watch(url)
        await videos.close()

    with camera(on=False) as (_, url):
        asyncio.run(asyncio.wait_for(look(url), LIMIT_S))


def test_a_snapshot_is_a_picture_and_a_service_that_is_away_is_told() -> None:
    async def look(url: str) -> None:
        videos = Videos()
        assert (await videos.snapshot(url.replace("stream.mjpg", "snapshot.jpg"))).startswith(b"\xff\xd8")
        with pytest.raises(Unavailable, match="does not answer"):
            await videos.snapshot("http://127.0.0.1:9/snapshot.jpg")
        await videos.close()

    with camera() as (_, url):
        asyncio.run(asyncio.wait_for(look(url), LIMIT_S))
