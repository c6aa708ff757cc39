"""What was: asked of the history service over the bus, which makes as many points as a plot has pixels."""

from __future__ import annotations

import math
import time

from pydantic import BaseModel, Field
from starlette.responses import Response

from services.dashboard.house import House
from services.dashboard.http.endpoint import Asked, Endpoint
from services.errors import BadMessage
from services.payloads import seconds, stamp
from services.payloads.history import TOO_LONG, HistoryReply
from services.payloads.robot import MissionResult
from services.states import base_type

POINTS = 800  # of a plot, when nobody says how many
MOST_POINTS = 1500  # more do not fit into an answer of the bus
PAST_MISSIONS = 40  # of all robots; each with its story
EARLIEST = seconds("0001-01-01T00:00:00Z")  # there is no day before
PIECE = 2000  # changes in one answer of the bus; of long texts fewer fit
MOST_PIECES = 60  # of one item, and a look at 10,000 samples each: a year of one a minute
MOST_STATES, MOST_LINES = 20_000, 100_000  # at once: for a page, in a table
NUMBERS = ("Number", "Dimmer", "Rollershutter")
WIDTHS_S = (
    1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400,
    172800, 604800,
)  # fmt: skip


class Series(BaseModel):
    """What was of an item. A row of numbers is time (s since 1970), least, mean and greatest of `every` seconds; a
    row of states is time and state, at each change, first of all the state as of `known`."""

    item: str
    unit: str | None
    every: int | None = Field(description="Seconds per row; null: states, each as it was said.")
    since: float
    until: float
    known: float = Field(description="From when on it is told: later than `since` where there was too much to tell.")
    rows: list[tuple[float, float, float, float]] | list[tuple[float, str | float]]


class Missions(BaseModel):
    """What `mission/<robot>/result` told of each."""

    missions: list[MissionResult]


def endpoints(house: House) -> list[Endpoint]:
    """The rows."""

    async def history(asked: Asked) -> BaseModel:
        return await _series(house, asked, MOST_STATES)

    async def missions(asked: Asked) -> BaseModel:
        robot = asked.path("robot")
        reply = _good(await house.ask(what="missions", limit=PAST_MISSIONS))
        return Missions(missions=[result for name, result in reply.missions or () if name == robot])

    async def table(asked: Asked) -> Response:
        series = await _series(house, asked, MOST_LINES)
        if series.known > series.since:
            raise BadMessage(f"too much for one table: ask from since={stamp(series.known)} on, or a part at a time")
        return Response(
            _csv(series), 200, {"content-disposition": f'attachment; filename="{series.item}.csv"'}, "text/csv"
        )

    span = (("since", "ISO 8601 with an offset; a day ago without."), ("until", "The same; now without."),
            ("points", f"How many at most; {POINTS} without."))  # fmt: skip
    return [
        Endpoint("GET", "/api/history/{item}.csv", "viewer", "What was of an item, as a table.", table,
                 answer="text/csv", query=span),
        Endpoint("GET", "/api/history/{item}", "viewer", "What was of an item.", history, answer=Series, query=span),
        Endpoint("GET", "/api/missions/{robot}/past", "viewer", "The newest missions that have ended, oldest first.",
                 missions, answer=Missions),
    ]  # fmt: skip


async def _series(house: House, asked: Asked, most: int) -> Series:
    item, since, until = asked.path("item"), *_span(asked)
    about = house.config.home.items.get(item)
    if about is None:
        raise BadMessage(f"the home has no item {item[:80]!r}")
    if base_type(about.type) in NUMBERS:
        return await _numbers(house, item, since, until, _points(asked))
    changes, known = await _changes(house, item, since, until, most)
    before = _good(await house.ask(item=item, what="last", until=stamp(known)))
    rows: list[tuple[float, str | float]] = [(known, value) for _, value in before.samples]
    return Series(item=item, unit=None, every=None, since=since, until=until, known=known, rows=rows + changes)


async def _changes(
    house: House, item: str, since: float, until: float, most: int
) -> tuple[list[tuple[float, str | float]], float]:
    """The newest changes, and from when on these are all; asked for in pieces, from the newest one back."""
    found: list[tuple[float, str | float]] = []
    end, piece = stamp(until), PIECE
    for _ in range(MOST_PIECES):
        reply = await house.ask(item=item, what="changes", since=stamp(since), until=end, limit=piece)
        if reply.error == TOO_LONG and piece > 1:
            piece //= 2
            continue
        begin = _good(reply).since
        found[:0] = [(seconds(when), value) for when, value in reply.samples if begin is None or when >= begin]
        if begin is None:
            return found, since
        if len(found) >= most or begin == end:
            return found, seconds(begin)
        end = begin
    return found, seconds(end)


async def _numbers(house: House, item: str, since: float, until: float, points: int) -> Series:
    every = width(until - since, points)
    reply = _good(await house.ask(item=item, since=stamp(since), until=stamp(until), every=float(every)))
    rows = [(seconds(when), lo, mean, hi) for when, _, lo, mean, hi in reply.buckets or ()]
    return Series(item=item, unit=reply.unit, every=every, since=since, until=until, known=since, rows=rows)


def width(span_s: float, points: int) -> int:
    """Seconds per point: the least round number that gives no more than that many."""
    return next((one for one in WIDTHS_S if span_s / one <= points), math.ceil(span_s / points / 86400) * 86400)


def _good(reply: HistoryReply) -> HistoryReply:
    if reply.error and "nothing is stored" not in reply.error:
        raise BadMessage(reply.error)
    return reply


def _span(asked: Asked) -> tuple[float, float]:
    until = _time(asked, "until", time.time())
    since = _time(asked, "since", max(EARLIEST, until - 86400.0))
    if not 0 < until - since < 1e10:
        raise BadMessage("since: expected a time before until")
    return since, until


def _time(asked: Asked, name: str, default: float) -> float:
    text = asked.query(name)
    try:
        return seconds(text) if text else default
    except (ValueError, OverflowError) as error:
        raise BadMessage(f"{name}: expected a time like 2026-01-31T07:05:00Z, got {text[:80]!r}") from error


def _points(asked: Asked) -> int:
    text = asked.query("points", str(POINTS))
    if not text.isdecimal() or not 1 <= int(text[:9]) <= MOST_POINTS:
        raise BadMessage(f"points: expected 1 to {MOST_POINTS}, got {text[:20]!r}")
    return int(text)


def _csv(series: Series) -> str:
    head = "time,least,mean,greatest" if series.every else "time,state"
    lines = [head]
    for when, *values in series.rows:
        lines.append(",".join([stamp(float(when)), *(_cell(value) for value in values)]))
    return "\r\n".join(lines) + "\r\n"


def _cell(value: object) -> str:
    """Quoted as RFC 4180 wants; a text that a spreadsheet would take for a formula is shown as text."""
    if isinstance(value, float | int):
        return repr(float(value)).removesuffix(".0")  # every digit
    text = str(value)
    if text[:1] in "=+-@\t\r":
        text = f"'{text}"
    return '"' + text.replace('"', '""') + '"' if any(sign in text for sign in ',"\r\n') else text
