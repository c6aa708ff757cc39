"""What the broker does to our messages: whether its queue will do, whether it dropped some or forgot us. Pure.

mosquitto tells of itself on `$SYS`. It drops the newest messages when a queue is full and acknowledges them all the
same, so only its count of dropped ones, which is of all clients, tells that something is missing here.
"""

from __future__ import annotations

from collections import Counter

from services.payloads import Diagnostic

DROPPED = "$SYS/broker/publish/messages/dropped"
HELD = "$SYS/broker/store/messages/count"  # of all clients, the retained ones too
FILTERS = (DROPPED, HELD)
WARN_SHARE = 0.5  # of the queue's limit: as much time is left as it took to fill it so far
TOLD_FOR_S = 3600.0  # so long a loss stands in the diagnostics
RATE_OVER_S = 60.0


class Watch:
    """Of one writer. `limit` is the broker's max_queued_messages; what it had dropped before comes by `learn`."""

    def __init__(self, limit: int, counters: Counter[str]) -> None:
        self._limit = limit
        self._counters = counters
        self._held = 0
        self.dropped: int | None = None  # the broker's own count, as it was told last
        self._loss = ""
        self._loss_until = 0.0
        self._rate = 0.0
        self._counted_from = 0.0
        self._counted = 0
        self._away_since: float | None = None

    def learn(self, dropped: int | None) -> None:
        """What the broker's count was when this writer last looked, before a restart maybe."""
        self.dropped = dropped if self.dropped is None else self.dropped

    def heard(self, topic: str, payload: bytes, now: float) -> str | None:
        """Takes one of FILTERS; the text of a warning when messages were dropped since the last look."""
        if not payload.isdigit():
            return None
        value = int(payload)
        if topic == HELD:
            self._held = value
            return None
        before, self.dropped = self.dropped, value
        if before is None or value == before:
            return None
        lost = value - before if value > before else value  # less than before: it was started anew, and counts from 0
        return self._lost("broker_dropped", lost, f"the broker dropped {lost} messages, for us or for others", now)

    def session(self, *, present: bool, known_before: bool, now: float) -> str | None:
        """At each connection; the text of a warning when the broker has forgotten what it kept for us."""
        if present or not known_before:
            return None
        return self._lost("sessions_lost", 1, "the broker has forgotten our session: what came meanwhile is lost", now)

    def came(self, now: float) -> None:
        """A message came: how many come in a second is what an outage is reckoned by."""
        self._counted += 1
        if now - self._counted_from >= RATE_OVER_S:
            if self._counted_from:
                self._rate = self._counted / (now - self._counted_from)
            self._counted, self._counted_from = 0, now

    def waits(self, now: float) -> str:
        """While the database is away nothing is taken from the broker: how long its queue will do, by reckoning."""
        if self._away_since is None:
            self._away_since = now
        if not self._rate:
            return "the broker keeps what comes"
        waiting = round(self._rate * (now - self._away_since))
        left_s = max(0.0, (self._limit - waiting) / self._rate)
        return f"about {waiting} messages wait at the broker, it drops the newest in {left_s / 3600:.1f} h"

    def goes_on(self) -> None:
        """The database is there."""
        self._away_since = None

    def diagnostic(self, now: float, mark: str | None = None) -> Diagnostic:
        """How the broker's queue is; with a mark that is known when it comes back."""
        values = {"held": str(self._held), "limit": str(self._limit), "dropped": str(self.dropped or 0)}
        values.update({"mark": mark} if mark else {})
        level, text = 0, "no message is missing"
        if now < self._loss_until:
            level, text = 2, self._loss
        elif self._held > WARN_SHARE * self._limit:
            level, text = 1, f"the broker holds {self._held} messages, at {self._limit} it drops the newest"
        return Diagnostic(level=level, message=text, values=values, hardware_id="broker")

    def _lost(self, counter: str, count: int, text: str, now: float) -> str:
        self._counters[counter] += count
        self._loss, self._loss_until = text, now + TOLD_FOR_S
        return text
