"""Gathers rows in `handle`, commits them in `tick`, in one transaction each turn.

Where nothing is lost: the runner acknowledges a turn's messages after its tick, so what is not committed comes
again. While the database is away the gathered rows are kept, with their times, and the tick raises Unavailable.
Not here: what a row is (`rows.py`), which are wanted (`strategies.py`), the SQL (`services/storage/`).
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

from pydantic import Field

from services import topics
from services.apartment.home import Home
from services.bus import SESSION_TOPIC, Message, topic_matches
from services.errors import BadMessage, SettingError, Unavailable
from services.persistence import again, broker, rows, rulebook
from services.persistence.connection import Connection
from services.persistence.decisions import Decisions
from services.persistence.seen import Seen
from services.persistence.strategies import Restore, Rule, Timetable
from services.persistence.writers import Writers
from services.runner import Post
from services.storage import Batch, Row, Storage, ahead, open_storage, reading
from services.storage.settings import DatabaseSection

log = logging.getLogger(__name__)

DIAGNOSTIC_EVERY_S = 1.0
ABOUT_BROKER = (*broker.FILTERS, SESSION_TOPIC)
CLOCK_STEP_US = 1_000_000  # a clock that steps back more than this is told
COUNTERS = ("rows", "batches", "refused", "unit_mismatch", "clock_steps", "restored", "reconnects", "redelivered",
            "deadlocks", "broker_dropped", "sessions_lost")  # fmt: skip


class Config(DatabaseSection):
    """The section `persistence`."""

    restore_after_s: float = Field(default=2.0, ge=0)  # how long retained states may come after all that waited
    broker_queue: int = Field(default=500_000, ge=1)  # the broker's max_queued_messages, as in mosquitto.conf
    name: str = "persistence"
    strategies: Path | None = None  # persistence.yaml; without it `persist` of each item in home.yaml says when
    writers: Writers = Writers()  # one, unless it is said that there are more
    home: Home

    @property
    def rules(self) -> dict[str, Rule]:
        """The rule of every item of this writer; ConfigError when the file of strategies has faults."""
        found = rulebook.rules(self.home, self.folder / self.strategies if self.strategies else None)
        return self.writers.rules(found)


def check(config: Config) -> None:
    """ConfigError with every fault of the strategies, also of those that do not go with several writers."""
    if unfit := config.writers.unfit(config.rules):
        wanted = f"expected item, or everyUpdate alone without a filter for {', '.join(unfit)}"
        raise SettingError(("persistence", "writers", "by"), f"{wanted}, got {config.writers.by}")


@contextmanager
def start(config: Config, post: Post) -> Iterator[Persistence]:
    """The service; ConfigError when its database cannot be used. One that is away is waited for in the turns."""
    check(config)
    address = config.address
    service = Persistence(config, lambda: open_storage(address))
    service.connection.first()
    try:
        yield service
    finally:
        service.connection.close()


class Persistence:
    """The service; see `services.runner.Service`."""

    def __init__(self, config: Config, opener: Callable[[], Storage]) -> None:
        self._name = config.writers.name(config.name)
        self._health = topics.DIAGNOSTICS.name(component=f"{self._name}/broker")  # it carries the mark of `Restore`
        filters = config.writers.filters(config.home)
        heard = any(topic_matches(one, self._health) for one in filters)
        self.subscribes = (*filters, *(() if heard else (self._health,)), *broker.FILTERS, SESSION_TOPIC)
        self.counters: Counter[str] = Counter(dict.fromkeys(COUNTERS, 0))
        self.connection = Connection(opener, self.counters)
        self._home = config.home
        self._writers = config.writers
        rules = config.rules
        self._timetable = Timetable(rules)
        self._decisions = Decisions(config.home, rules, self.counters, config.writers.unknown)
        self._restore = Restore(self._decisions.restored, config.restore_after_s)
        self._restore.begin(uuid4().hex)
        self._gathered: list[tuple[rows.State | Row, Message]] = []
        self._fresh: list[rows.State | Row] = []  # of it what is not there already
        self._seen = Seen(self._name)
        self._broker = broker.Watch(config.broker_queue, self.counters)
        self._noted: int | None = None  # of the broker's count of dropped messages, in the database
        self._next_diagnostic = 0.0
        self._batch = Batch()  # decided, not committed yet
        self._time = 0
        self._learnt = False
        self._connected = False  # once, in this life

    @property
    def due(self) -> float | None:
        """When the database is tried again, or the restoring or a cron strategy is due."""
        if self.connection.due is not None:
            return self.connection.due
        wanted = [when for when in (self._restore.due, self._timetable.due) if when is not None]
        return min(wanted, default=None)

    def handle(self, message: Message, now: float) -> tuple[Message, ...]:
        """Takes a message for the next tick."""
        self._prepare(now)
        if message.topic in ABOUT_BROKER:
            self._about_broker(message, now)
            return ()
        self._broker.came(now)
        known = topics.read(message, now)
        if message.topic == self._health:
            self._restore.heard(known.payload.values.get("mark"), now)
        row = rows.read(known, self._next_time(message.received or now), self._home) if known.topic.stored else None
        if row is None or not self._writers.takes(row):
            return ()
        again = message.token is not None and message.token.again
        if isinstance(row, rows.State) and self._restore.saw(row.item, row.text, again=again):
            self._decisions.heard(row)
        else:
            self._gathered.append((row, message))
        return ()

    def tick(self, now: float) -> list[Message]:
        """Commits what was gathered; Unavailable while the database is away."""
        try:
            storage = self.connection.storage(now)
        except Unavailable as error:
            raise Unavailable(f"{error}; {self._broker.waits(now)}") from error
        try:
            self._learn(storage, now)
            self._decide(storage)
            if fired := self._timetable.fired(now):
                self._batch.extend(self._decisions.fired(fired, storage.items, lambda: self._next_time(now)))
            self._commit(storage)
            self._note(storage)
        except Unavailable as error:
            self.connection.lost(error, now)
            raise
        self.connection.worked()
        self._broker.goes_on()
        return [*self._restored(storage, now), *self._diagnostic(now)]

    def _about_broker(self, message: Message, now: float) -> None:
        if message.topic == SESSION_TOPIC:
            known_before = self._connected or self._seen.any
            told = self._broker.session(present=message.value is True, known_before=known_before, now=now)
            self._connected = True
            self._restore.begin(uuid4().hex)
            self._next_diagnostic = now  # it is said at once
        else:
            told = self._broker.heard(message.topic, message.payload, now)
        if told:
            log.warning("%s", told)

    def _note(self, storage: Storage) -> None:
        """The broker's count outlives us: it may drop messages while we are away."""
        if self._broker.dropped is not None and self._broker.dropped != self._noted:
            self._noted = self._broker.dropped
            storage.note(self._name, "dropped", self._noted)

    def _diagnostic(self, now: float) -> list[Message]:
        if now < self._next_diagnostic:
            return []
        self._next_diagnostic = now + DIAGNOSTIC_EVERY_S
        told = self._broker.diagnostic(now, self._restore.mark)
        return [topics.DIAGNOSTICS.message(told, component=f"{self._name}/broker")]

    def _next_time(self, at: float) -> int:
        """Microseconds, never the same twice and never back: a clock that steps back must not reorder rows.

        From further ahead than is believed it does go back: all rows would be late by that, until that time has come.
        """
        microseconds = round(at * 1e6)
        behind = self._time - microseconds
        if self._time >= ahead.believed(at):
            log.warning("the clock was %.1f days ahead; times go on from %.0f", behind / 86_400e6, at)
            self._time = 0
        elif behind > CLOCK_STEP_US:
            if not self.counters["clock_steps"]:
                log.warning("the clock is %.1f s behind what is stored; times go on from there", behind / 1e6)
            self.counters["clock_steps"] += 1
        self._time = self._writers.next_time(microseconds, self._time)
        return self._time

    def _prepare(self, now: float) -> None:
        """Learns the last values before the first message, where the database is there: its times go on from those."""
        if not self._learnt and (storage := self.connection.opened) is not None:
            try:
                self._learn(storage, now)
            except Unavailable as error:
                self.connection.lost(error, now)

    def _learn(self, storage: Storage, now: float) -> None:
        if self._learnt:
            return
        last, odd = ahead.last_values(storage, now)
        if odd:
            names = ", ".join(sample.item for sample in odd)
            log.warning("rows whose time has not come are left alone, see `apartment db check`: %.200s", names)
        self._decisions.learn(last, storage.last_diagnostics())
        self._decisions.again.learn(reading.open_orders(storage), reading.newest_missions(storage, again.MISSIONS))
        self._time = max([self._time, *(sample.time for sample in last.values())])
        self._seen.learn(storage.seen(self._name))
        self._noted = storage.noted(self._name, "dropped")
        self._broker.learn(self._noted)
        self._learnt = True

    def _decide(self, storage: Storage) -> None:
        """From gathered to decided, once; new items are made before, because MariaDB commits at that."""
        for row, message in self._gathered:
            if self._seen.is_second(message):
                self.counters["redelivered"] += 1
            else:
                self._fresh.append(row)
        self._gathered = []
        if self._fresh:
            storage.add_items(self._decisions.new_items(self._fresh, storage.items))
            self._batch.extend(self._decisions.batch(self._fresh, storage.items))
            self._fresh = []

    def _commit(self, storage: Storage) -> None:
        if len(self._batch):
            self._batch.seen = self._seen.turn()
            before = storage.deadlocks
            self.counters["rows"] += self._write(storage, self._batch)
            self.counters["deadlocks"] += storage.deadlocks - before
            self._seen.committed()
            self.counters["batches"] += 1
            self._batch = Batch()

    def _write(self, storage: Storage, batch: Batch) -> int:
        """How many rows were written: all, but for one that the database refuses, which halving finds."""
        written = 0
        try:
            storage.write(batch)
            return len(batch)
        except BadMessage as error:
            if len(batch) > 1:
                written = sum(self._write(storage, half) for half in batch.halves())
            else:
                log.warning("refused by the database: %s: %.200r", error, batch.samples or batch.rows)
                self.counters["refused"] += 1
        if batch.seen is not None:
            storage.write(Batch(seen=batch.seen))
        return written

    def _restored(self, storage: Storage, now: float) -> list[Message]:
        """The last states of items that the broker does not have, retained, said once."""
        said = []
        for name in self._restore.missing(now):
            text = self._decisions.last_text(name, storage.items)
            if text is not None:
                self._restore.says(name, text)
                said.append(topics.HOME_STATE.message(text, item=name)._replace(once=True))
        self.counters["restored"] += len(said)
        return said
