"""Answers `history/get` in `handle`, and keeps house in `tick`, a small piece at a time.

While the database is away a question is answered with that. Not here: the answers (`answers.py`).
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Self

from pydantic import model_validator

from services import topics
from services.bus import Message
from services.errors import ConfigError, Unavailable
from services.history import answers, keeping
from services.history.keeping import Keep
from services.history_payloads import HistoryGet, HistoryReply
from services.home import Home
from services.runner import Post
from services.storage import Storage, open_storage
from services.storage.settings import DatabaseSection

log = logging.getLogger(__name__)

AGAIN_S = 1.0  # between attempts to open the database
COUNTERS = ("questions", "unanswered", "pieces")
ROUND_EVERY_S = 600.0  # of keeping house
PAUSE_S = 0.02  # between its pieces: the writer and questions come first
SETTLE_S = 60.0  # after the database was opened


class Config(DatabaseSection):
    """The section `history`, with the database of the section persistence; without one the service does not run."""

    keep: tuple[Keep, ...] = ()  # how long; an item that no line names is kept for ever
    home: Home

    @model_validator(mode="after")
    def keeps_known_items(self) -> Self:
        keeping.by_item(self.keep, self.home)
        return self


@contextmanager
def start(config: Config, post: Post) -> Iterator[History]:
    """The service; a database that is away is waited for."""
    service = History(lambda: open_storage(config.address), keeping.by_item(config.keep, config.home))
    try:
        yield service
    finally:
        service.close()


class History:
    """The service; see `services.runner.Service`."""

    def __init__(self, opener: Callable[[], Storage], lines: Mapping[str, Keep] | None = None) -> None:
        self._lines = lines or {}
        self._round: Iterator[int] | None = None  # of keeping house, while one is going on
        self.subscribes = (topics.HISTORY_GET.filter,)
        self.due: float | None = 0.0 if self._lines else None
        self.counters: Counter[str] = Counter(dict.fromkeys(COUNTERS, 0))
        self._opener = opener
        self._storage: Storage | None = None
        self._opened_at: float | None = None
        self._not_before = 0.0
        self._reason = ""

    def handle(self, message: Message, now: float) -> Iterator[Message]:
        """Answers a question, in every case."""
        asked: HistoryGet = topics.read(message, now).payload
        self.counters["questions"] += 1
        reply = topics.HISTORY_REPLY.message(self._reply(asked, now), id=asked.id)
        if len(reply.payload) > topics.TEXT_LIMIT:
            reply = topics.HISTORY_REPLY.message(self._told(asked, "too long an answer: ask for less"), id=asked.id)
        yield reply
        if (also := topics.reply(reply, message)) is not None:
            yield also

    def tick(self, now: float) -> tuple[Message, ...]:
        """One piece of keeping house, when that is due."""
        if self.due is not None and now >= self.due:
            try:
                self._keep_house(now)
            except Unavailable as error:
                self.close()
                self._lost(error, now)
                self._round, self.due = None, now + ROUND_EVERY_S
        return ()

    def _keep_house(self, now: float) -> None:
        if self._opened_at is None or now - self._opened_at < SETTLE_S:
            self._opened(now)  # a writer that waited for the database too has rows from before to write
            self.due = (self._opened_at or now) + SETTLE_S
            return
        if self._round is None:
            self._round = keeping.pieces(self._opened(now), self._lines, now)
        rows = next(self._round, None)
        self.counters["pieces"] += rows is not None
        if rows is None:
            self._round = None
        self.due = now + (ROUND_EVERY_S if rows is None else PAUSE_S)

    def close(self) -> None:
        """Ends the connection."""
        if self._storage is not None:
            self._storage.close()
        self._storage = self._opened_at = self._round = None

    def _reply(self, asked: HistoryGet, now: float) -> HistoryReply:
        try:
            return answers.answer(self._opened(now), asked, now)
        except Unavailable as error:
            self.close()
            self._lost(error, now)
            return self._told(asked, f"the database is away: {error}")

    def _told(self, asked: HistoryGet, error: str) -> HistoryReply:
        self.counters["unanswered"] += 1
        return HistoryReply(id=asked.id, item=asked.item, samples=[], error=error)

    def _opened(self, now: float) -> Storage:
        """The storage, opened when that is due."""
        if self._storage is None:
            if now < self._not_before:
                raise Unavailable(self._reason)
            try:
                self._storage = self._opener()
            except ConfigError as error:
                raise Unavailable(str(error)) from error
            self._reason, self._opened_at = "", now
        return self._storage

    def _lost(self, error: Unavailable, now: float) -> None:
        if not self._reason:
            log.warning("no answers: %s", error)
        self._reason, self._not_before = str(error), now + AGAIN_S
