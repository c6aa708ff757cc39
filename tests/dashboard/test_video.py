"""The picture for all viewers by one connection: a real camera proxy, and people who look through the dashboard."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from services.dashboard.http.video import Flow, Videos
from services.errors import Unavailable
from tests.dashboard.streaming import camera

LIMIT_S = 20.0


class Watched:
    """The dashboard's end, and what it tells of the flow."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.told: list[Flow | None] = []
        self.videos = Videos(lambda _, flow: self.told.append(flow))

    async def watch(self) -> Any:
        """Somebody looks."""
        return await self.videos.watch("ip1", lambda: self.url)

    @property
    def flows(self) -> list[bool | None]:
        """What was told, in short."""
        return [None if one is None else one.flows for one in self.told]


def watching(url: str, look: Callable[[Watched], Coroutine[None, None, None]]) -> None:
    """Looks, within the limit."""

    async def all_of_it() -> None:
        watched = Watched(url)
        await look(watched)
        await watched.videos.close()

    asyncio.run(asyncio.wait_for(all_of_it(), LIMIT_S))


async def until(come_true: Callable[[], bool]) -> None:
    """The limit of the test is the deadline."""
    while not come_true():
        await asyncio.sleep(0.05)


def test_all_viewers_share_one_connection_to_the_camera_service() -> None:
    with camera() as source:
        proxy = source.proxy

        async def look(watched: Watched) -> None:
            streams = [await watched.watch() for _ in range(5)]
            for stream in streams:
                assert (await anext(stream)).startswith(b"--picture\r\n")
                for _ in range(2):
                    part = await anext(stream)
                    assert b"Content-Type: image/jpeg" in part
                    assert b"\xff\xd8" in part
                    assert part.endswith(b"\r\n--picture\r\n")
            assert proxy.seats._value == proxy.settings.viewers - 1
            for stream in streams:
                await stream.aclose()
            await until(lambda: proxy.seats._value == proxy.settings.viewers)  # nobody asks any more
            await until(lambda: watched.flows == [True, None])

        watching(source.url, look)


def test_a_stream_that_is_off_is_told_in_the_camera_services_words() -> None:
    async def look(watched: Watched) -> None:
        for _ in range(2):  # and so is whoever asks again
            with pytest.raises(Unavailable, match="the stream is off"):
                await watched.watch()

    with camera(on=False) as source:
        watching(source.url, look)


def test_a_stream_that_ends_is_asked_for_again_and_whoever_looks_keeps_the_answer() -> None:
    """A camera service that was started again streams from another port."""

    async def look(watched: Watched) -> None:
        with camera() as source:
            watched.url = source.url
            stream = await watched.watch()
            for _ in range(3):
                await anext(stream)
        with camera() as source:
            watched.url = source.url
            while watched.flows != [True, False, True]:
                assert (await anext(stream)).endswith(b"\r\n--picture\r\n")

    watching("", look)


def test_pictures_that_come_no_more_are_told_with_the_time_of_the_last_one() -> None:
    with camera() as source:

        async def look(watched: Watched) -> None:
            stream = await watched.watch()
            await anext(stream)
            await anext(stream)
            source.stands.set()
            waiting = asyncio.ensure_future(read(stream))
            await until(lambda: watched.flows == [True, False])
            first, stands = watched.told
            assert first is not None
            assert stands is not None
            assert first.since <= stands.since
            assert stands.why == "the camera gives none"
            assert not waiting.done()
            source.stands.clear()
            await until(lambda: watched.flows == [True, False, True])
            waiting.cancel()

        watching(source.url, look)


async def read(stream: Any) -> None:
    """Reads on and on."""
    async for _ in stream:
        pass


def test_a_snapshot_is_a_picture_and_a_service_that_is_away_is_told() -> None:
    async def look(watched: Watched) -> None:
        snapshot = watched.url.replace("stream.mjpg", "snapshot.jpg")
        still = await watched.videos.snapshot(snapshot)
        assert still.jpeg.startswith(b"\xff\xd8")
        assert abs(time.time() - still.exposed) < 30.0
        with pytest.raises(Unavailable, match="does not answer"):
            await watched.videos.snapshot("http://127.0.0.1:9/snapshot.jpg")

    with camera() as source:
        watching(source.url, look)
