"""The dashboard's part on the bus: what comes goes to the view and in batches to the pages, what they want goes out.

Not here: HTTP (`http/`), which runs in a thread of its own and meets this one by `/dashboard/say` and by batches.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

from services import topics
from services.bus import LOST_TOPIC, Message
from services.dashboard.view import RATES_S, Entry, View, heard
from services.payloads.history import HistoryReply

SAY_TOPIC = "/dashboard/say"  # `value`: a Message that a page wants on the bus
LINK = "/dashboard/broker"  # what pages hear of our own connection: `online`, `offline`
Spread = Callable[[tuple[Entry, ...]], None]
Answered = Callable[[HistoryReply], None]
Pictured = Callable[[str, bytes], None]  # camera, JPEG


class Dashboard:
    """The service; see `services.runner.Service`. `spread`, `answered`, `pictured` are called from its thread alone."""

    def __init__(self, spread: Spread, answered: Answered, pictured: Pictured, addresses: dict[str, str | int]) -> None:
        self.subscribes = (*heard(), SAY_TOPIC, LOST_TOPIC)
        self.due: float | None = 0.0
        self.counters: Counter[str] = Counter(said=0, batches=0)
        self.addresses = addresses
        self.view = View()
        self._spread, self._answered, self._pictured = spread, answered, pictured
        self._rates_at = 0.0
        self._online = False

    def handle(self, message: Message, now: float) -> Iterator[Message]:
        """Takes a message; BadMessage when the table of topics does not know it."""
        if message.topic == SAY_TOPIC:
            assert isinstance(message.value, Message)
            self.counters["said"] += 1
            yield message.value
            return
        self._linked(message.topic != LOST_TOPIC, now)
        if message.topic == LOST_TOPIC:
            return
        if message.topic.startswith("history/reply/"):
            self._answered(topics.read(message, now).payload)
            return
        self.view.take(message, now)
        if message.topic.endswith("/scan/image"):
            self._pictured(topics.find(message.topic)[1]["cam"], message.payload)

    def _linked(self, online: bool, now: float) -> None:
        """That something comes shows that the broker is there: our own diagnostics do, every second."""
        if online != self._online:
            self._online = online
            self.view.tell(LINK, "online" if online else "offline", now)

    def tick(self, now: float) -> tuple[Message, ...]:
        """Hands on what changed, when that is due."""
        if batch := self.view.batch(now):
            self.counters["batches"] += 1
            self._spread(batch)
        if now >= self._rates_at:
            self._rates_at = now + RATES_S
        self.due = self._rates_at if self.view.due is None else min(self._rates_at, self.view.due)
        return ()
