"""From a question to its answer, on an open storage. Not here: the bus (`service.py`), the terminal (`command.py`)."""

from __future__ import annotations

import json

from services import payloads
from services.errors import BadMessage
from services.payloads import Point, stamp
from services.payloads.history import HistoryGet, HistoryReply
from services.payloads.robot import MissionEvent, MissionResult
from services.storage import Item, Mission, Sample, Storage, reading

US = 1_000_000
MS = 1000  # in microseconds
USUAL = 1000  # samples when nobody says how many
MOST = 5000  # in one answer: it has to fit into a message of 256 KiB
DAY_S = 86_400.0
FROM_EVER = ("samples", "last", "missions")  # the newest of them, when no begin is given
EARLIEST_S, LATEST_S = 1.0, 2.0**31 - 1  # what the databases hold


def answer(storage: Storage, asked: HistoryGet, now: float) -> HistoryReply:
    """The answer; what cannot be answered is told in its `error`."""
    try:
        return _answer(storage, asked, now)
    except BadMessage as error:
        return HistoryReply(id=asked.id, item=asked.item, samples=[], error=str(error))


def _answer(storage: Storage, asked: HistoryGet, now: float) -> HistoryReply:
    since, until = span(asked, now)
    limit = min(asked.limit or USUAL, MOST)
    if asked.what == "changes":
        return _changes(storage, asked, since, until, limit)
    if asked.what == "missions":
        found = reading.missions(storage, since, until, limit)
        missions = [(one.robot, _mission(one, one.ended)) for one in found if one.ended is not None]
        return HistoryReply(id=asked.id, item=None, samples=[], missions=missions)
    item = known(storage, asked.item)
    told = HistoryReply(id=asked.id, item=asked.item, samples=[], unit=item.unit)
    if asked.what == "last":
        last = reading.before(storage, item, until)
        return told.model_copy(update={"samples": [_sample(last)] if last else []})
    if asked.what == "durations":
        spent = reading.durations(storage, item, since, until)
        return told.model_copy(update={"durations": {value: us / US for value, us in spent.items()}})
    if asked.every:
        return _buckets(storage, asked, item, since, until, told)
    return told.model_copy(update={"samples": _samples(storage, item, since, until, limit)})


def span(asked: HistoryGet, now: float) -> tuple[int, int]:
    """What is asked about, in microseconds: until now when no end is given, from a day before that or from ever."""
    until = _seconds(asked.until, "until") if asked.until else now
    if asked.since:
        since = _seconds(asked.since, "since")
    else:
        since = EARLIEST_S if asked.what in FROM_EVER and not asked.every else until - DAY_S
    if since >= until:
        raise BadMessage(f"since: expected a time before {stamp(until)}, got {stamp(since)}")
    return round(since * US), round(until * US) + (not asked.until)


def _seconds(text: str, what: str) -> float:
    try:
        seconds = payloads.seconds(text)
    except (ValueError, OverflowError) as error:
        raise BadMessage(f"{what}: expected a time like 2026-01-31T07:05:00Z, got {text[:80]!r}") from error
    if not EARLIEST_S <= seconds <= LATEST_S:
        raise BadMessage(f"{what}: expected a time from 1970 to 2038, got {text[:80]!r}")
    return seconds


def known(storage: Storage, name: str | None) -> Item:
    """The item of that name; BadMessage when nothing of it was ever stored."""
    items = storage.items if name in storage.items else reading.items(storage)  # the writer may have made it since
    if name is None or name not in items:
        raise BadMessage(f"item: nothing is stored of {name!r}")
    return items[name]


def _buckets(
    storage: Storage, asked: HistoryGet, item: Item, since: int, until: int, told: HistoryReply
) -> HistoryReply:
    assert asked.every is not None
    every_s = max(1, round(asked.every))
    if (until - since) / US / every_s > MOST:
        raise BadMessage(f"every: expected at most {MOST} buckets, got {(until - since) / US / every_s:.0f}")
    found = reading.buckets(storage, item, since, until, every_s)
    return told.model_copy(
        update={
            "samples": [(stamp(one.start / US), one.mean) for one in found],
            "buckets": [(stamp(one.start / US), one.n, one.lo, one.mean, one.hi) for one in found],
        }
    )


def _samples(storage: Storage, item: Item, since: int, until: int, limit: int) -> list[tuple[str, float | str]]:
    return [_sample(one) for one in storage.samples(item.name, since=since, until=until, limit=limit)]


def _changes(storage: Storage, asked: HistoryGet, since: int, until: int, limit: int) -> HistoryReply:
    items = None if asked.item is None else [known(storage, asked.item)]
    found, begin = reading.changes(storage, since, until, items)
    if len(found) > limit:
        found = found[-limit:]
        begin = found[0].time
    changed = [(one.item, *_sample(one)) for one in found]
    whole = None if begin == since else stamp(-(-begin // MS) * MS / US)  # a stamp has milliseconds: the next one
    return HistoryReply(
        id=asked.id, item=asked.item, samples=[row[1:] for row in changed], changes=changed, since=whole
    )


def _mission(one: Mission, ended: int) -> MissionResult:
    """As it was told when it ended."""
    at = None if one.x is None or one.y is None or one.z is None else Point(x=one.x, y=one.y, z=one.z)
    story = [MissionEvent(at_s=at_s, state=state, text=text) for at_s, state, text in json.loads(one.story or "[]")]
    return MissionResult.model_validate(
        {
            "id": one.mission, "marker": one.marker, "state": one.state, "reason": one.reason or "", "place": one.place,
            "position": at, "by": one.seen_by, "elapsed_s": (ended - one.started) / US, "story": story,
            "stamp": stamp(ended / US),
        }
    )  # fmt: skip


def _sample(one: Sample) -> tuple[str, float | str]:
    """The value as people read it: the text where there is one, else the number."""
    value = one.text if one.text is not None else one.num
    assert value is not None
    return stamp(one.time / US), value
