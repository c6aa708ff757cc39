"""What the HTTP endpoints share: the settings, who is logged in, what pages know, and the way to the bus.

Everything here is used from the HTTP server's event loop; `post` alone reaches the service's thread.
"""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any, TypeVar

from services import topics
from services.bus import Message
from services.dashboard.aim import Sight
from services.dashboard.hub import Hub
from services.dashboard.service import LINK, SAY_TOPIC
from services.dashboard.sessions import Sessions, Tries
from services.dashboard.settings import Config
from services.dashboard.view import sayable
from services.errors import Unavailable
from services.payloads import Stream
from services.payloads.history import HistoryGet, HistoryReply
from services.runner import Post

Part = TypeVar("Part", str, bytes)
SNAPSHOT = "snapshot.jpg"  # of the camera service, beside its stream
ANSWER_S = 15.0
MOST_QUESTIONS = 50  # that wait for the history at once


@dataclass
class House:
    """See the module."""

    config: Config
    post: Post
    apartment: dict[str, Any]
    maps: dict[str, bytes]
    sights: dict[str, Sight]
    hub: Hub = field(default_factory=Hub)
    tries: Tries = field(default_factory=Tries)
    sessions: Sessions = field(init=False)
    closing: list[Callable[[], Awaitable[None]]] = field(default_factory=list)  # what ends with the server
    running: list[Callable[[], Coroutine[None, None, None]]] = field(default_factory=list)  # what runs as long as it
    scanned: dict[str, bytes] = field(default_factory=dict)  # by camera, the newest analysed picture of its scans
    _questions: dict[str, asyncio.Future[HistoryReply]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.sessions = Sessions(self.config.idle_h * 3600.0)

    @property
    def connected(self) -> bool:
        """Whether the broker is there, as far as we know."""
        link = self.hub.latest.get(LINK)
        return link is not None and link.text == "online"

    def say(self, message: Message) -> None:
        """Puts a message on the bus. BadMessage when we may not say it, Unavailable when the broker is away."""
        checked = sayable(message._replace(received=time.time()))
        if not self.connected:
            raise Unavailable("the broker is away")
        self.post(Message(SAY_TOPIC, value=checked))

    async def ask(self, **question: Any) -> HistoryReply:
        """Asks the history service; Unavailable when it does not answer, or too many ask."""
        if len(self._questions) >= MOST_QUESTIONS:
            raise Unavailable("too many questions at once: try again")
        asked = HistoryGet(id=f"page-{uuid.uuid4().hex[:16]}", **question)
        waiting = self._questions[asked.id] = asyncio.get_running_loop().create_future()
        try:
            self.say(topics.HISTORY_GET.message(asked))
            return await asyncio.wait_for(waiting, ANSWER_S)
        except TimeoutError as error:
            raise Unavailable("the history service does not answer") from error
        finally:
            self._questions.pop(asked.id, None)

    def answered(self, reply: HistoryReply) -> None:
        """Takes an answer of the history service."""
        waiting = self._questions.get(reply.id)
        if waiting is not None and not waiting.done():
            waiting.set_result(reply)

    def pictured(self, camera: str, jpeg: bytes) -> None:
        """Takes an analysed picture of a camera that we have."""
        if camera in self.config.cameras:
            self.scanned[camera] = jpeg

    async def close(self) -> None:
        """Ends what runs for the pages."""
        for one in self.closing:
            await one()

    async def while_logged_in(self, token: str | None, parts: AsyncIterator[Part]) -> AsyncIterator[Part]:
        """A stream that ends with the session that it was opened by; an open page keeps the session from being idle."""
        try:
            async for part in parts:
                if self.config.users and self.sessions.find(token, time.time()) is None:
                    return
                yield part
        finally:
            if isinstance(parts, AsyncGenerator):
                await parts.aclose()

    def picture_of(self, camera: str, name: str) -> str:
        """Where the camera service has the picture of that name; empty: it has not said."""
        text = self.latest(topics.CAMERA_STREAM.name(cam=camera))
        return "" if text is None else Stream.model_validate_json(text).beside(name)

    def latest(self, topic: str) -> str | None:
        """The newest text on a topic."""
        entry = self.hub.latest.get(topic)
        return entry.text if entry else None
