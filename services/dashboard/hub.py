"""Everything that pages know, and who is shown what: lives in the HTTP server's event loop, takes batches there.

Pages that ask for the same topics form a group, whose batch is made into text once. A page that does not keep up
loses its queue and is given everything as it is then: nobody waits for it, and it costs a few kilobytes.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from contextlib import contextmanager

from services.bus import topic_matches
from services.dashboard.latest import MOST_TOPICS, Latest
from services.dashboard.view import Entry

QUEUE = 20  # batches that wait for one page: two seconds
QUEUE_TEXT = 2_000_000  # characters of them
PAST_TEXT = 1_000_000  # characters of each of PAST
MOST_PAGES = 100
PAST = {  # what a page is told of what was, when it opens: so many of each
    "camera/+/order_result": 40, "camera/+/scan/result": 40, "camera/+/audio": 20, "home/+/command": 40,
    "/dashboard/rates": 60, "mission/+/result": 20, "mission/+/state": 80, "robot/+/pose": 240,
}  # fmt: skip
BEAT_S = 10.0  # without news a page hears that we are there; its `id`, like that of a snapshot, is our time
Filters = tuple[str, ...]


class Group:
    """Those who see the same topics."""

    def __init__(self, filters: Filters) -> None:
        self.filters = filters
        self.pages: set[Page] = set()
        self._sees: dict[str, bool] = {}

    def sees(self, topic: str) -> bool:
        """Whether a topic is among them; remembered, since it is asked thousands of times a second."""
        known = self._sees.get(topic)
        if known is None:
            if len(self._sees) > MOST_TOPICS:
                self._sees.clear()
            known = self._sees[topic] = any(topic_matches(one, topic) for one in self.filters)
        return known

    def text(self, entries: Iterable[Entry]) -> str:
        """The entries among them as a JSON array; an empty text when there are none."""
        inside = ",".join(entry.json for entry in entries if self.sees(entry.topic))
        return f"[{inside}]" if inside else ""


class Page:
    """One open page."""

    def __init__(self, group: Group) -> None:
        self.group = group
        self.queue: deque[str] = deque()
        self.behind = True  # wants everything
        self.news = asyncio.Event()

    def put(self, text: str) -> None:
        """Adds a batch; when too many wait, they are given up."""
        if len(self.queue) >= QUEUE or sum(map(len, self.queue)) > QUEUE_TEXT:
            self.queue.clear()
            self.behind = True
        if not self.behind:
            self.queue.append(text)
        self.news.set()


class Hub:
    """All calls come from the event loop."""

    def __init__(self) -> None:
        self.latest = Latest()
        self._past = {one: deque[Entry](maxlen=most) for one, most in PAST.items()}
        self.closed = False
        self._groups: dict[Filters, Group] = {}

    @property
    def pages(self) -> int:
        """How many are open."""
        return sum(len(group.pages) for group in self._groups.values())

    def spread(self, batch: Sequence[Entry]) -> None:
        """Takes a batch of the bus and hands it on."""
        for entry in batch:
            self._keep(entry)
        for group in self._groups.values():
            if text := group.text(batch):
                for page in group.pages:
                    page.put(text)

    def snapshot(self, group: Group) -> str:
        """All that a group sees: what was, then what is."""
        current = set(map(id, self.latest.values()))
        before = [entry for kept in self._past.values() for entry in kept if id(entry) not in current]
        return group.text((*before, *self.latest.values())) or "[]"

    async def batches(self, filters: Filters) -> AsyncIterator[str]:
        """What a page is sent: everything at first, then changes, in server-sent events."""
        with self._opened(filters) as page:
            while not self.closed:
                if page.behind:
                    page.behind = False
                    page.queue.clear()
                    yield f"event: snapshot\nid: {_now_ms()}\ndata: {self.snapshot(page.group)}\n\n"
                while page.queue:
                    yield f"data: {page.queue.popleft()}\n\n"
                page.news.clear()
                if page.behind or page.queue:
                    continue
                try:
                    await asyncio.wait_for(page.news.wait(), BEAT_S)
                except TimeoutError:
                    yield f"event: beat\nid: {_now_ms()}\ndata: {{}}\n\n"

    def close(self) -> None:
        """Ends all pages' streams."""
        self.closed = True
        for group in self._groups.values():
            for page in group.pages:
                page.news.set()

    @contextmanager
    def _opened(self, filters: Filters) -> Iterator[Page]:
        group = self._groups.setdefault(filters, Group(filters))
        page = Page(group)
        group.pages.add(page)
        try:
            yield page
        finally:
            group.pages.discard(page)
            if not group.pages:
                self._groups.pop(filters, None)

    def _keep(self, entry: Entry) -> None:
        if not entry.text and entry.kind == "s":
            self.latest.pop(entry.topic, None)  # an empty retained message takes a topic away
            return
        first = entry.topic.partition("/")[0]
        for one, kept in self._past.items():
            if one.startswith(first) and topic_matches(one, entry.topic):
                kept.append(entry)
                while sum(len(past.text) for past in kept) > PAST_TEXT:
                    kept.popleft()
        self.latest[entry.topic] = entry


def _now_ms() -> int:
    return round(time.time() * 1000)
