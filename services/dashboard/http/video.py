"""A camera's moving picture for everybody who watches here: one connection to the camera service, whoever looks.

Each viewer is sent the newest picture whenever it is ready for one: a slow one skips pictures, and delays nobody. Where
the stream ends it is asked for again, and viewers keep their answer: a browser leaves the last picture of one that has
ended where it is, without a word to its page. So whether pictures come is told, too.
Not here: getting pictures out of a camera (`services/camera/video/`).
"""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager, suppress
from typing import NamedTuple

import httpx

from services.errors import Unavailable

BOUNDARY = "picture"
LENGTH = re.compile(rb"content-length:\s*(\d{1,8})", re.I)
LARGEST = 4 * 1024 * 1024
FIRST_S = 5.0  # until the first picture
LATE_S = 5.0  # without a picture it is told that none comes
QUIET_S = 12.0  # without a word the stream is asked for again
AGAIN_S = 2.0  # after one that has ended
LINGER_S = 5.0  # after somebody last asked for a picture: one who changes views comes back
SNAPSHOT_S = 25.0  # the camera may take 20 s


class Flow(NamedTuple):
    """Whether pictures come; where not, `since` is when the last one came, seconds since 1970."""

    flows: bool
    since: float
    why: str = ""


class Still(NamedTuple):
    """A JPEG, and when it was exposed, as the camera service estimates; seconds since 1970, nan: not told."""

    jpeg: bytes
    exposed: float


Address = Callable[[], str]  # where the stream is now; Unavailable when nobody knows
Tell = Callable[[str, Flow | None], None]  # of a camera; None: nobody looks


class Video:
    """One camera's pictures: fetched while somebody looks, again and again. `tell` is given each change of the flow."""

    def __init__(self, address: Address, tell: Callable[[Flow | None], None]) -> None:
        self.picture = b""
        self.number = 0
        self._address, self._tell = address, tell
        self._flow: Flow | None = None
        self._at = 0.0  # when the newest picture came
        self._why = ""  # none does now
        self._waiting, self._asked = 0, 0.0  # for a picture: how many, and when somebody last did
        self._changed = asyncio.Condition()
        self._again = asyncio.Event()  # somebody new wants the stream: it is asked for now
        self._late: asyncio.TimerHandle | None = None
        self.task: asyncio.Task[None] | None = None

    async def first(self) -> tuple[int, bytes]:
        """A picture that is not old; Unavailable when there is none soon."""
        with self._looking():
            self._why = ""
            self._again.set()
            before = 0 if self._flow is not None and self._flow.flows else self.number
            try:
                async with asyncio.timeout(FIRST_S), self._changed:
                    await self._changed.wait_for(lambda: self.number > before or self._why)
            except TimeoutError as error:
                raise Unavailable("the camera gives no picture") from error
            if self.number <= before:
                raise Unavailable(self._why)
            return self.number, self.picture

    async def after(self, number: int) -> tuple[int, bytes]:
        """The newest picture, once it is newer than that number, however long that takes."""
        with self._looking():
            async with self._changed:
                await self._changed.wait_for(lambda: self.number > number)
            return self.number, self.picture

    @contextmanager
    def _looking(self) -> Iterator[None]:
        """Somebody waits for a picture."""
        self._waiting += 1
        if self.task is None or self.task.done():
            self.task = asyncio.create_task(self._run())
        try:
            yield
        finally:
            self._waiting -= 1
            self._asked = time.monotonic()

    @property
    def _wanted(self) -> bool:
        return self._waiting > 0 or time.monotonic() - self._asked < LINGER_S

    async def _run(self) -> None:
        self._at = time.time()
        try:
            while True:
                self._expect()
                why = await self._fetch()
                if not self._wanted:
                    return
                self._why = why
                self._stands(why)
                async with self._changed:
                    self._changed.notify_all()
                self._again.clear()
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._again.wait(), AGAIN_S)
        finally:
            self._expect_none()
            self._say(None)

    async def _fetch(self) -> str:
        """Takes pictures until there are no more; why."""
        try:
            async with _client() as client, client.stream("GET", self._address()) as answer:
                if answer.status_code != 200:
                    told = (await answer.aread()).decode("utf-8", "replace").strip()[:200]
                    return told or f"the camera service answers {answer.status_code}"
                await self._read(answer)
                return "the stream ended"
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            return f"the camera service does not answer: {type(error).__name__}"
        except Unavailable as error:
            return str(error)

    async def _read(self, answer: httpx.Response) -> None:
        data = bytearray()
        async for part in answer.aiter_raw():
            data += part
            while (found := _cut(data)) is not None:
                self.picture, self.number, self._at = found, self.number + 1, time.time()
                self._expect()
                if self._flow is None or not self._flow.flows:
                    self._say(Flow(True, self._at))
                async with self._changed:
                    self._changed.notify_all()
            if len(data) > LARGEST or not self._wanted:
                return

    def _expect(self) -> None:
        """The next picture has to come soon."""
        self._expect_none()
        self._late = asyncio.get_running_loop().call_later(LATE_S, self._stands, "the camera gives none")

    def _expect_none(self) -> None:
        if self._late is not None:
            self._late.cancel()

    def _stands(self, why: str) -> None:
        self._expect_none()
        self._say(Flow(False, self._at, why))

    def _say(self, flow: Flow | None) -> None:
        if flow != self._flow:
            self._flow = flow
            self._tell(flow)


class Videos:
    """The cameras that are watched."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._videos: dict[str, Video] = {}

    async def watch(self, camera: str, address: Address) -> AsyncIterator[bytes]:
        """The parts of a multipart answer that has no end; Unavailable, before the first, when there is no picture."""
        video = self._videos.get(camera)
        if video is None:
            video = self._videos[camera] = Video(address, lambda flow: self._tell(camera, flow))
        return self._parts(video, *await video.first())

    async def _parts(self, video: Video, number: int, picture: bytes) -> AsyncIterator[bytes]:
        """The boundary follows each picture at once: a browser shows it when it knows where it ends."""
        yield f"--{BOUNDARY}\r\n".encode()
        while True:
            head = f"Content-Type: image/jpeg\r\nContent-Length: {len(picture)}\r\n\r\n"
            yield head.encode() + picture + f"\r\n--{BOUNDARY}\r\n".encode()
            number, picture = await video.after(number)

    async def snapshot(self, url: str) -> Still:
        """One picture; Unavailable when there is none."""
        try:
            async with _client(SNAPSHOT_S) as client:
                answer = await client.get(url)
        except httpx.HTTPError as error:
            raise Unavailable(f"the camera service does not answer: {type(error).__name__}") from error
        if answer.status_code != 200:
            raise Unavailable(answer.text.strip()[:200])
        return Still(answer.content, float(answer.headers.get("X-Timestamp", "nan")))

    async def close(self) -> None:
        """Ends all streams."""
        tasks = [video.task for video in self._videos.values() if video.task is not None]
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
