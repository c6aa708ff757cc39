"""What goes on on the bus, gathered into batches: of each state the latest, of events all, and how many there were.

Pure. Not here: who is shown what (`hub.py`).
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from services import topics
from services.bus import Message
from services.errors import BadMessage
from services.topic import Kind, Topic

BATCH_S = 0.1  # at most ten batches a second; a change after a pause goes out at once
MOST_EVENTS = 2000  # in a batch; the oldest go
LONGEST = 16 * 1024  # characters of a text; more is cut, it is for reading. JSON is whole, since half of it is none
RATES = "/dashboard/rates"  # our own topic: messages per second, by the first level of their topics
RATES_S = 2.0
KINDS = {Kind.STATE: "s", Kind.EVENT: "e", Kind.COMMAND: "c", Kind.BLOB: "b"}


class Entry(NamedTuple):
    """One message as pages get it: `kind` is the first letter of the topic's, `at` milliseconds since 1970."""

    topic: str
    text: str
    at: int
    kind: str

    @property
    def json(self) -> str:
        """As it travels."""
        return json.dumps(self, ensure_ascii=False, separators=(",", ":"))


class View:
    """Takes messages, gives batches."""

    def __init__(self) -> None:
        self.due: float | None = None
        self._states: dict[str, Entry] = {}
        self._events: list[Entry] = []
        self._counts: Counter[str] = Counter()
        self._counted_from = 0.0
        self._last = 0.0

    def take(self, message: Message, now: float) -> None:
        """Notes a message; BadMessage when it is not what the table of topics says, so that pages may trust it."""
        row = _row(message, now)
        kind = KINDS[row.kind]
        text = f"{len(message.payload):,} bytes" if kind == "b" else message.payload.decode("utf-8", "replace")
        self._counts[message.topic.partition("/")[0]] += 1
        shown = text[:LONGEST] if row.payload is str else text
        entry = Entry(message.topic, shown, round(message.received * 1000), kind)
        if kind in "sb":
            self._states[entry.topic] = entry
        else:
            self._events.append(entry)
        self.due = self.due or max(now, self._last + BATCH_S)

    def tell(self, topic: str, text: str, now: float) -> None:
        """Puts in a word of the dashboard's own."""
        self._states[topic] = Entry(topic, text, round(now * 1000), "s")
        self.due = self.due or max(now, self._last + BATCH_S)

    def batch(self, now: float) -> tuple[Entry, ...]:
        """What is to go out now: nothing, when it is not yet time."""
        if now - self._counted_from >= RATES_S:
            self._rates(now)
        if self.due is None or now < self.due:
            return ()
        out = (*self._states.values(), *self._events[-MOST_EVENTS:])
        self._states, self._events = {}, []
        self._last, self.due = now, None
        return out

    def _rates(self, now: float) -> None:
        span = now - self._counted_from
        rates = {level: round(count / span, 2) for level, count in sorted(self._counts.items())}
        if self._counted_from:
            self.tell(RATES, json.dumps(rates), now)
        self._counts = Counter(dict.fromkeys(rates, 0))
        self._counted_from = now


def _row(message: Message, now: float) -> Topic:
    """Its topic's; an empty message takes away what was retained, also when it says so to those who listen already."""
    if not message.payload:
        row = topics.find(message.topic)[0]
        if message.retain or row.kind is Kind.STATE:
            return row
    return topics.read(message, now).topic


def heard(account: str = "dashboard") -> tuple[str, ...]:
    """The filters of all that the dashboard's account may read, but pictures: those are fetched when wanted.

    An analysed picture of a scan cannot be fetched; it is said once, and only while somebody wants them (ScanImgPub).
    """
    rows = (row for row in topics.TABLE if row.kind is not Kind.BLOB or row is topics.CAMERA_SCAN_IMAGE)
    return tuple(row.filter for row in rows if account in row.readers)


def sayable(message: Message, account: str = "dashboard") -> Message:
    """A message as the topic's row says it, for an account that may; BadMessage when it may not, or is not right."""
    row, levels = topics.find(message.topic)
    own = "<service>" in row.writers and levels.get("service") == account
    if not own and account not in row.writers:
        raise BadMessage(f"{message.topic}: the dashboard's account may not say that; {_may(account)}")
    topics.read(message, message.received)
    return row.message(message.payload, **levels)


def _may(account: str) -> str:
    patterns: Iterable[str] = (row.pattern for row in topics.TABLE if account in row.writers)
    return f"it may say {', '.join(patterns)}"
