"""`apartment history`: a question from the terminal, and its answer as a table, CSV, JSON or a plot.

It opens the database itself, so that it works while nothing runs. The options: `command_line/stored.py`.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from datetime import datetime, tzinfo

from services.errors import BadMessage, ConfigError
from services.history import answers
from services.history.plot import HEIGHT, WIDTH, Curve, draw
from services.history.svg import Svg
from services.payloads import seconds, stamp
from services.payloads.history import HistoryGet, HistoryReply
from services.storage import Address, Item, Mission, Storage, open_ready, reading

UNITS_S = {"s": 1, "m": 60, "h": 3600, "d": 86_400, "w": 604_800}
POINTS = 1000  # of a plot
KEPT_S = 300  # the usual width of means that outlive their samples
SUFFIXES = (".png", ".svg")  # of plots
US = 1_000_000


def length_s(text: str) -> float | None:
    """Seconds of `90s`, `5m`, `1h`, `7d`, `2w`; None when it is no such text."""
    match = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)([smhdw])", text)
    return float(match[1]) * UNITS_S[match[2]] if match else None


def moment(text: str, now: float, zone: tzinfo) -> str | None:
    """A time from the terminal as payloads carry it: how long ago (`24h`), or a date and time.

    Without an offset it is the home's clock.
    """
    if not text:
        return None
    try:
        if (ago := length_s(text)) is not None:
            return stamp(now - ago)
        when = datetime.fromisoformat(text)
        return stamp((when if when.tzinfo else when.replace(tzinfo=zone)).timestamp())
    except (ValueError, OverflowError, OSError) as error:
        raise ConfigError([f"expected how long ago (24h) or a time (2026-01-31T07:05), got {text!r}"]) from error


def every_s(text: str) -> float | None:
    """The width of a bucket from the terminal."""
    if not text:
        return None
    if (seconds := length_s(text)) is None:
        raise ConfigError([f"expected a length such as 5m or 1h, got {text!r}"])
    return seconds


def ask(address: Address, asked: HistoryGet) -> HistoryReply:
    """The answer; BadMessage when there is none."""
    with closing(open_ready(address)) as storage:
        reply = _answer(storage, asked)
    if reply.error:
        raise BadMessage(reply.error)
    return reply


def _answer(storage: Storage, asked: HistoryGet) -> HistoryReply:
    """Changes come in pieces, as one answer looks at so many samples only; the newest piece first."""
    reply, most = answers.answer(storage, asked, time.time()), asked.limit or answers.USUAL
    while reply.changes is not None and reply.since is not None and len(reply.changes) < most:
        later = [row for row in reply.changes if row[1] >= reply.since]
        further = asked.model_copy(update={"until": reply.since, "limit": most - len(later)})
        before = answers.answer(storage, further, time.time())
        if before.since == reply.since:  # more within a millisecond than it looks at
            break
        both = [*(before.changes or ()), *later]
        found = {"samples": [row[1:] for row in both], "changes": both, "since": before.since}
        reply = reply.model_copy(update=found)
    return reply


def missions(address: Address, since: str | None, until: str | None, limit: int) -> list[dict[str, object]]:
    """The newest missions that began in a span, oldest first: what, how it ended, where, how long in seconds."""
    begin = round(seconds(since) * US) if since else US
    end = round((seconds(until) if until else time.time()) * US)
    with closing(open_ready(address)) as storage:
        return [_told(one) for one in reading.missions(storage, begin, end, limit)]


def _told(one: Mission) -> dict[str, object]:
    at = " ".join(f"{part:.2f}" for part in (one.x, one.y, one.z) if part is not None)
    took = "" if one.ended is None else f"{(one.ended - one.started) / US:.1f}"
    return {
        "time": stamp(one.started / US), "robot": one.robot, "marker": one.marker, "state": one.state,
        "seconds": took, "place": one.place or "", "position": at, "reason": one.reason or "", "mission": one.mission,
    }  # fmt: skip


def is_empty(reply: HistoryReply) -> bool:
    """Whether nothing was found."""
    return not (reply.samples or reply.durations)


def rows(reply: HistoryReply, number: Callable[[float], str]) -> Iterator[tuple[str, ...]]:
    """The answer as rows of text, the first with the names of the columns; `number` is the form of a mean."""
    unit = f" [{reply.unit}]" if reply.unit else ""
    if reply.durations is not None:
        yield "state", "seconds"
        yield from ((state, f"{spent:.3f}") for state, spent in reply.durations.items())
    elif reply.buckets is not None:
        yield "time", "count", f"min{unit}", f"mean{unit}", f"max{unit}"
        for start, n, *numbers in reply.buckets:
            yield start, str(n), *map(number, numbers)
    elif reply.changes is not None:
        yield "time", "item", "state"
        yield from ((when, item, str(state)) for item, when, state in reply.changes)
    else:
        yield "time", f"state{unit}"
        yield from ((when, str(value)) for when, value in reply.samples)


def table(reply: HistoryReply, zone: tzinfo) -> Iterator[str]:
    """The answer as aligned lines, times on the home's clock; nothing where nothing was found."""
    if not is_empty(reply):
        yield from aligned(rows(reply, "{:.6g}".format), zone)


def aligned(texts: Iterable[tuple[str, ...]], zone: tzinfo) -> Iterator[str]:
    """Rows of text as lines with columns, times on the home's clock."""
    lines = [tuple(_local(cell, zone) for cell in row) for row in texts]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        yield "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()


def _local(cell: str, zone: tzinfo) -> str:
    if not re.fullmatch(r"[0-9-]{10}T[0-9:.]{12}Z", cell):
        return cell
    return datetime.fromisoformat(cell).astimezone(zone).isoformat(sep=" ", timespec="milliseconds")


def as_csv(reply: HistoryReply) -> str:
    """With a line of names; times in UTC, numbers with every digit."""
    return comma_separated(rows(reply, repr))


def comma_separated(texts: Iterable[tuple[str, ...]]) -> str:
    """Rows of text as comma-separated values."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(texts)
    return text.getvalue()


def as_json(reply: HistoryReply) -> str:
    """The answer as it would be on the bus, without what it has not."""
    return json.dumps(reply.model_dump(exclude_none=True, exclude={"id"}), ensure_ascii=False)


def as_plot(address: Address, asked: HistoryGet, zone: tzinfo, suffix: str) -> bytes:
    """The numbers of the span (a day, when no begin is given) as a file of SUFFIXES; BadMessage when there are none."""
    since, until = answers.span(asked.model_copy(update={"every": 1.0}), time.time())
    with closing(open_ready(address)) as storage:
        curve = _curve(storage, answers.known(storage, asked.item), since, until)
    if not curve.points:
        raise BadMessage(f"{asked.item}: no numbers from {stamp(since / US)} to {stamp(until / US)}")
    return _picture(curve, zone, suffix)


def _picture(curve: Curve, zone: tzinfo, suffix: str) -> bytes:
    if suffix == ".svg":
        sheet = Svg(WIDTH, HEIGHT)
        draw(sheet, curve, zone)
        return sheet.file()
    from services.paper import Paper  # it brings OpenCV

    paper = Paper(WIDTH, HEIGHT)
    draw(paper, curve, zone)
    return paper.png()


def _curve(storage: Storage, item: Item, since: int, until: int) -> Curve:
    """Each sample where there are few, else least, mean and greatest of buckets."""
    samples = storage.samples(item.name, since=since, until=until, limit=POINTS + 1)
    if 0 < len(samples) <= POINTS:
        first = reading.before(storage, item, since)
        held = [(since, first.num)] if first and first.num is not None else []
        points = held + [(one.time, one.num) for one in samples if one.num is not None]
        return Curve(item.name, item.unit, points, since, until)
    found = reading.buckets(storage, item, since, until, width_s(since, until))
    means = [(one.start, one.mean) for one in found]
    band = [(one.start, one.lo, one.hi) for one in found]
    return Curve(item.name, item.unit, means, since, until, steps=False, band=band)


def width_s(since: int, until: int) -> int:
    """The width of buckets that makes POINTS of a span at most; a multiple of the kept means' where it can be."""
    least = max(1, math.ceil((until - since) / US / POINTS))
    return least if least < KEPT_S else math.ceil(least / KEPT_S) * KEPT_S
