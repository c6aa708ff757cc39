"""Answers `history/get` in `handle`, and keeps house in `tick`, a small piece at a time.

While the database is away a question is answered with that. Questions are asked under an account that can only read;
keeping house has a connection of its own, under another account (`keeper`). Not here: the answers (`answers.py`).
"""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Self

from pydantic import SecretStr, model_validator
from pydantic_core import from_json

from services import topics
from services.apartment.home import Home
from services.bus import Message
from services.errors import BadMessage, ConfigError, Unavailable
from services.history import answers, keeping
from services.history.keeping import Keep
from services.payloads.history import TOO_LONG, HistoryGet, HistoryReply
from services.runner import Post
from services.section import Section
from services.storage import Storage, ahead, open_ready
from services.storage.address import Address
from services.storage.settings import DatabaseSection
from services.topic import LEVELS

log = logging.getLogger(__name__)

AGAIN_S = 1.0  # between attempts to open the database
COUNTERS = ("questions", "unanswered", "pieces")
ROUND_EVERY_S = 600.0  # of keeping house
PAUSE_S = 0.02  # between its pieces: the writer and questions come first
LONGEST_ITEM = 200  # characters of what is no item's name, in an answer
SETTLE_S = 60.0  # after the database was opened


class Keeper(Section):
    """The account that keeps house: it may sum up and delete samples, and nothing else."""

    user: str
    password: SecretStr


class Config(DatabaseSection):
    """The section `history`, with the database of the section persistence; without one the service does not run."""

    keeper: Keeper | None = None  # None: whoever asks keeps house too, and has to be allowed to
    keep: tuple[Keep, ...] = ()  # how long; an item that no line names is kept for ever
    home: Home

    @model_validator(mode="after")
    def keeps_known_items(self) -> Self:
        keeping.by_item(self.keep, self.home)
        return self

    @property
    def keeping_address(self) -> Address:
        """The database, for who keeps house."""
        if self.keeper is None:
            return self.address
        return replace(self.address, user=self.keeper.user, password=self.keeper.password.get_secret_value())


@contextmanager
def start(config: Config, post: Post) -> Iterator[History]:
    """The service; a database that is away is waited for."""
    lines = keeping.by_item(config.keep, config.home)
    service = History(lambda: open_ready(config.address), lines, lambda: open_ready(config.keeping_address))
    try:
        yield service
    finally:
        service.close()


class Opened:
    """A connection that is made when it is wanted, and after a failure not again before AGAIN_S have passed."""

    def __init__(self, opener: Callable[[], Storage]) -> None:
        self._opener = opener
        self._storage: Storage | None = None
        self._not_before = 0.0
        self._reason = ""
        self.since: float | None = None

    def get(self, now: float) -> Storage:
        """The storage; Unavailable when there is none."""
        if self._storage is None:
            if now < self._not_before:
                raise Unavailable(self._reason)
            try:
                self._storage = self._opener()
            except ConfigError as error:
                raise Unavailable(str(error)) from error
            self._reason, self.since = "", now
        return self._storage

    def lost(self, error: Unavailable, now: float) -> None:
        """It is of no use any more."""
        self.close()
        if not self._reason:
            log.warning("no answers: %s", error)
        self._reason, self._not_before = str(error), now + AGAIN_S

    def close(self) -> None:
        """Ends it."""
        if self._storage is not None:
            self._storage.close()
        self._storage = self.since = None


def _object(payload: bytes) -> dict[str, Any]:
    """What can be read of a message that makes no sense."""
    try:
        told = from_json(payload)
    except ValueError:
        return {}
    return told if isinstance(told, dict) else {}


class History:
    """The service; see `services.runner.Service`. `keeper` opens the database for keeping house, else `opener`."""

    def __init__(
        self,
        opener: Callable[[], Storage],
        lines: Mapping[str, Keep] | None = None,
        keeper: Callable[[], Storage] | None = None,
    ) -> None:
        self._lines = lines or {}
        self._round: Iterator[int] | None = None  # of keeping house, while one is going on
        self.subscribes = (topics.HISTORY_GET.filter,)
        self.due: float | None = 0.0 if self._lines else None
        self.counters: Counter[str] = Counter(dict.fromkeys(COUNTERS, 0))
        self._asked, self._house = Opened(opener), Opened(keeper or opener)
        self._ticked: float | None = None
        self._doubted = False

    def handle(self, message: Message, now: float) -> Iterator[Message]:
        """Answers a question, in every case; one that makes no sense or comes late as far as its id can be read."""
        self.counters["questions"] += 1
        try:
            asked: HistoryGet = topics.read(message, now).payload
        except BadMessage as error:
            yield from self._refused(message, str(error))
            raise
        reply = topics.HISTORY_REPLY.message(self._reply(asked, now), id=asked.id)
        if len(reply.payload) > topics.TEXT_LIMIT:
            reply = topics.HISTORY_REPLY.message(self._told(asked, TOO_LONG), id=asked.id)
        yield reply
        if (also := topics.reply(reply, message)) is not None:
            yield also

    def _refused(self, message: Message, error: str) -> Iterator[Message]:
        """The answers to what is no question; without an id on the MQTT 5 response topic alone."""
        self.counters["unanswered"] += 1
        asked = _object(message.payload)
        name, item = asked.get("id"), asked.get("item")
        known = isinstance(name, str) and re.fullmatch(LEVELS["id"], name) is not None
        told = HistoryReply(
            id=str(name) if known else "", item=item[:LONGEST_ITEM] if isinstance(item, str) else None, samples=[],
            error=error,
        )  # fmt: skip
        reply = topics.HISTORY_REPLY.message(told, id=name if known else "-")
        if known:
            yield reply
        if (also := topics.reply(reply, message)) is not None:
            yield also

    def tick(self, now: float) -> tuple[Message, ...]:
        """One piece of keeping house, when that is due."""
        if self._lines and self._ticked is not None and now - self._ticked > ahead.FAR_S:
            self._doubt("the clock was set on by days", now, ahead.FAR_S)
        self._ticked = now
        if self.due is not None and now >= self.due:
            try:
                self._keep_house(now)
            except Unavailable as error:
                self._house.lost(error, now)
                self._round, self.due = None, now + ROUND_EVERY_S
        return ()

    def _keep_house(self, now: float) -> None:
        if self._house.since is None or now - self._house.since < SETTLE_S:
            self._house.get(now)  # a writer that waited for the database too has rows from before to write
            self.due = (self._house.since or now) + SETTLE_S
            return
        if self._round is None:
            storage = self._house.get(now)
            if ahead.is_alone(storage, now):
                self._doubt("the clock is days ahead of all that is stored", now, ROUND_EVERY_S)
                return
            self._round, self._doubted = keeping.pieces(storage, self._lines, now), False
        rows = next(self._round, None)
        self.counters["pieces"] += rows is not None
        if rows is None:
            self._round = None
        self.due = now + (ROUND_EVERY_S if rows is None else PAUSE_S)

    def _doubt(self, why: str, now: float, wait_s: float) -> None:
        """What a wrong clock calls old would be gone for ever, so keeping house waits."""
        if not self._doubted:
            log.warning("%s: nothing is cleared away meanwhile", why)
        self._round, self._doubted, self.due = None, True, now + wait_s

    def close(self) -> None:
        """Ends the connections."""
        self._round = None
        self._asked.close()
        self._house.close()

    def _reply(self, asked: HistoryGet, now: float) -> HistoryReply:
        try:
            return answers.answer(self._asked.get(now), asked, now)
        except Unavailable as error:
            self._asked.lost(error, now)
            return self._told(asked, f"the database is away: {error}")

    def _told(self, asked: HistoryGet, error: str) -> HistoryReply:
        self.counters["unanswered"] += 1
        return HistoryReply(id=asked.id, item=asked.item, samples=[], error=error)
