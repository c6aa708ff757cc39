"""A camera's moving picture for everybody who watches here: one connection to the camera service, whoever looks.

Each viewer is sent the newest picture whenever it is ready for one: a slow one skips pictures, and delays nobody.
Not here: getting pictures out of a camera (`services/camera/video/`).
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import suppress

import httpx

from services.errors import Unavailable

BOUNDARY = "picture"
LENGTH = re.compile(rb"content-length:\s*(\d{1,8})", re.I)
LARGEST = 4 * 1024 * 1024
FIRST_S = 5.0  # until the first picture
QUIET_S = 12.0  # without a picture the stream ends, and the page tries again
LINGER_S = 5.0  # after somebody last asked for a picture: one who changes views comes back
SNAPSHOT_S = 25.0  # the camera may take 20 s


class Video:
    """One camera's stream, while somebody looks."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.picture: bytes | None = None
        self.number = 0
        self.ended = ""
        self._asked = asyncio.get_running_loop().time()
        self._changed = asyncio.Condition()
        self.task = asyncio.create_task(self._fetch())

    async def after(self, number: int, timeout_s: float) -> tuple[int, bytes]:
        """The newest picture, when it is newer than that number; Unavailable when there will be none."""
        self._asked = asyncio.get_running_loop().time()
        try:
            async with asyncio.timeout(timeout_s), self._changed:
                await self._changed.wait_for(lambda: self.number > number or self.ended)
        except TimeoutError as error:
            raise Unavailable("the camera gives no picture") from error
        if self.number <= number or self.picture is None:
            raise Unavailable(self.ended)
        return self.number, self.picture

    async def _fetch(self) -> None:
        try:
            async with _client() as client, client.stream("GET", self.url) as answer:
                if answer.status_code != 200:
                    self.ended = (await answer.aread()).decode("utf-8", "replace").strip()[:200]
                else:
                    await self._read(answer)
                    self.ended = "the stream ended"
        except httpx.HTTPError as error:
            self.ended = f"the camera service does not answer: {type(error).__name__}"
        finally:
            self.ended = self.ended or "nobody looked"
            with suppress(asyncio.CancelledError):
                async with self._changed:
                    self._changed.notify_all()

    async def _read(self, answer: httpx.Response) -> None:
        data = bytearray()
        async for part in answer.aiter_raw():
            data += part
            while (found := _cut(data)) is not None:
                self.picture, self.number = found, self.number + 1
                async with self._changed:
                    self._changed.notify_all()
            if len(data) > LARGEST or asyncio.get_running_loop().time() - self._asked > LINGER_S:
                return


class Videos:
    """The streams that are watched, by their address."""

    def __init__(self) -> None:
        self._open: dict[str, Video] = {}

    async def watch(self, url: str) -> AsyncIterator[bytes]:
        """The parts of a multipart answer; Unavailable, before the first, when there is no picture."""
        video = self._open.get(url)
        if video is None or video.ended:
            video = self._open[url] = Video(url)
        number, picture = await video.after(0, FIRST_S)
        return self._parts(video, number, picture)

    async def _parts(self, video: Video, number: int, picture: bytes) -> AsyncIterator[bytes]:
        """The boundary follows each picture at once: a browser shows it when it knows where it ends."""
        try:
            yield f"--{BOUNDARY}\r\n".encode()
            while True:
                head = f"Content-Type: image/jpeg\r\nContent-Length: {len(picture)}\r\n\r\n"
                yield head.encode() + picture + f"\r\n--{BOUNDARY}\r\n".encode()
                number, picture = await video.after(number, QUIET_S)
        except Unavailable:
            return  # the page sees the end, and asks again

    async def snapshot(self, url: str) -> bytes:
        """One picture; Unavailable when there is none."""
        try:
            async with _client(SNAPSHOT_S) as client:
                answer = await client.get(url)
        except httpx.HTTPError as error:
            raise Unavailable(f"the camera service does not answer: {type(error).__name__}") from error
        if answer.status_code != 200:
            raise Unavailable(answer.text.strip()[:200])
        return answer.content

    async def close(self) -> None:
        """Ends all streams."""
        tasks = [video.task for video in self._open.values()]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _client(timeout_s: float = QUIET_S) -> httpx.AsyncClient:
    return httpx.AsyncClient(timeout=httpx.Timeout(timeout_s, connect=3.0), trust_env=False, follow_redirects=False)


def _cut(data: bytearray) -> bytes | None:
    """Takes the next whole picture off the front of what has come; None while there is none."""
    end = data.find(b"\r\n\r\n")
    if end < 0:
        return None
    length = LENGTH.search(data, 0, end)
    if length is None:
        del data[: end + 4]
        return None
    size = int(length[1])
    if len(data) < end + 4 + size:
        return None
    picture = bytes(data[end + 4 : end + 4 + size])
    del data[: end + 4 + size]
    return picture
