"""What travels on `history/#`: a question about what was stored, and its answer. The others: the package itself."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from services.payloads import Payload
from services.payloads.robot import MissionResult

TOO_LONG = "too long an answer: ask for less"  # the `error` of a reply that the bus would not carry


class HistoryGet(Payload):
    """`history/get`: a question. Times are ISO 8601 with an offset; no `until` is now, no `since` is from ever.

    `what`: the newest `limit` `samples` of a span, or with `every` (seconds) one mean per bucket; the `last` sample
    before `until`; the `changes` in a span, of all items when none is named; the `durations` of each state; the newest
    `limit` `missions` that ended, of those that began in the span.
    """

    id: str = Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")
    item: str | None = None
    what: Literal["samples", "last", "changes", "durations", "missions"] = "samples"
    since: str | None = None
    until: str | None = None
    limit: int | None = Field(default=None, ge=1)
    every: float | None = Field(default=None, gt=0)


class HistoryReply(Payload):
    """`history/reply/<id>`: the answer; samples oldest first, `unit` that of their numbers.

    `buckets` with `every`: begin, count, least, mean, greatest. `changes`: item, time, state; `since`: from when on
    they are all there, where the span has more: ask again `until` then, and leave out what is older here. `durations`:
    seconds.
    `missions`: the robot, and the result as it was told on `mission/<robot>/result`.
    """

    id: str
    item: str | None
    samples: list[tuple[str, float | str]]
    unit: str | None = None
    buckets: list[tuple[str, int, float, float, float]] | None = None
    changes: list[tuple[str, str, float | str]] | None = None
    since: str | None = None
    durations: dict[str, float] | None = None
    missions: list[tuple[str, MissionResult]] | None = None
    error: str | None = None
