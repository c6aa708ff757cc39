"""A plot of an item's numbers: axes with local times and the unit. Pure; drawn on any sheet.

Not here: the sheets, SVG text (`svg.py`) and a PNG's pixels (`services/paper.py`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, tzinfo
from typing import Protocol

US = 1_000_000
WIDTH, HEIGHT = 960, 360
LEFT, RIGHT, TOP, BOTTOM = 70, 20, 36, 44
MOST_TICKS = 8
MINUTE, HOUR, DAY = 60, 3600, 86_400
STEPS_S = (1, 5, 15, 30, MINUTE, 5 * MINUTE, 15 * MINUTE, 30 * MINUTE, HOUR, 3 * HOUR, 6 * HOUR, 12 * HOUR, DAY,
           2 * DAY, 7 * DAY, 14 * DAY, 30 * DAY, 90 * DAY, 365 * DAY)  # fmt: skip
Colour = tuple[int, int, int]  # red, green, blue
INK, GRID, BAND, LINE = (51, 51, 51), (221, 221, 221), (155, 196, 226), (31, 95, 139)
XY = tuple[float, float]


class Sheet(Protocol):
    """Something to draw on, WIDTH x HEIGHT, the origin at the top left."""

    def line(self, points: Sequence[XY], colour: Colour, width: float = 1.0) -> None:
        """Straight from point to point."""

    def shape(self, points: Sequence[XY], colour: Colour) -> None:
        """A filled polygon."""

    def text(
        self, at: XY, words: str, colour: Colour = INK, size: float = 12.0, weight: int = 400, align: str = "left"
    ) -> None:
        """One line of words, `at` the left (or right, or middle) end of its foot."""


@dataclass(frozen=True)
class Curve:
    """What is drawn: `points` are time (microseconds) and value; `band` time, least, greatest.

    Steps hold a value until the next one, as states do; means are joined by straight lines.
    """

    title: str
    unit: str | None
    points: Sequence[tuple[int, float]]
    since: int
    until: int
    steps: bool = True
    band: Sequence[tuple[int, float, float]] = ()


def draw(sheet: Sheet, curve: Curve, zone: tzinfo) -> None:
    """The plot."""
    frame = _Frame(curve)
    sheet.text((LEFT, 20), _title(curve), INK, 14, 700)
    _value_axis(sheet, frame)
    _time_axis(sheet, frame, curve, zone)
    if curve.band:
        sheet.shape(list(_outline(frame, curve)), BAND)
    if curve.points:
        sheet.line(list(_line(frame, curve)), LINE, 1.5)


def _title(curve: Curve) -> str:
    return f"{curve.title}, {curve.unit}" if curve.unit else curve.title


class _Frame:
    """From times and values to the place on the paper."""

    def __init__(self, curve: Curve) -> None:
        values = [value for _, value in curve.points] + [v for _, lo, hi in curve.band for v in (lo, hi)] or [0.0]
        self.step = _nice((max(values) - min(values)) / 5 or abs(values[0]) / 5 or 1.0)
        self.low = math.floor(min(values) / self.step) * self.step
        self.high = max(math.ceil(max(values) / self.step) * self.step, self.low + self.step)
        self._since, self._span = curve.since, max(curve.until - curve.since, 1)

    def x(self, time: int) -> float:
        share = (min(max(time, self._since), self._since + self._span) - self._since) / self._span
        return round(LEFT + share * (WIDTH - LEFT - RIGHT), 1)

    def y(self, value: float) -> float:
        return round(HEIGHT - BOTTOM - (value - self.low) / (self.high - self.low) * (HEIGHT - TOP - BOTTOM), 1)


def _nice(step: float) -> float:
    """The next of 1, 2, 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(float(nice * power) for nice in (1, 2, 5, 10) if nice * power >= step * 0.999)


def _value_axis(sheet: Sheet, frame: _Frame) -> None:
    for number in range(round((frame.high - frame.low) / frame.step) + 1):
        value = frame.low + number * frame.step
        y = frame.y(value)
        sheet.line([(LEFT, y), (WIDTH - RIGHT, y)], GRID)
        sheet.text((LEFT - 8, y + 4), f"{value:.6g}", INK, 12, 400, "right")
    sheet.line([(LEFT, TOP), (LEFT, HEIGHT - BOTTOM)], INK)


def _time_axis(sheet: Sheet, frame: _Frame, curve: Curve, zone: tzinfo) -> None:
    bottom = HEIGHT - BOTTOM
    sheet.line([(LEFT, bottom), (WIDTH - RIGHT, bottom)], INK)
    span_s = (curve.until - curve.since) / US
    step_s = next((step for step in STEPS_S if span_s / step <= MOST_TICKS), STEPS_S[-1])
    form = "%Y-%m-%d" if step_s >= DAY else "%H:%M" if step_s >= MINUTE else "%H:%M:%S"
    for moment in _ticks(curve.since, curve.until, step_s, zone):
        x = frame.x(round(moment.timestamp() * US))
        sheet.line([(x, bottom), (x, bottom + 5)], INK)
        sheet.text((x, bottom + 18), moment.strftime(form), INK, 12, 400, "middle")
    first, last = (datetime.fromtimestamp(time / US, zone) for time in (curve.since, curve.until))
    days = f"{first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} {last.tzname() or ''}".rstrip()
    sheet.text((WIDTH - RIGHT, bottom + 36), days, INK, 12, 400, "right")


def _ticks(since: int, until: int, step_s: int, zone: tzinfo) -> Iterator[datetime]:
    """Round local times of the span."""
    offset = datetime.fromtimestamp(since / US, zone).utcoffset()
    shift = int(offset.total_seconds()) if offset else 0
    first = -(-(since // US + shift) // step_s) * step_s - shift
    for second in range(first, until // US + 1, step_s):
        yield datetime.fromtimestamp(second, zone)


def _line(frame: _Frame, curve: Curve) -> Iterator[XY]:
    before: float | None = None
    for time, value in curve.points:
        if curve.steps and before is not None:
            yield frame.x(time), before
        before = frame.y(value)
        yield frame.x(time), before
    if curve.steps and before is not None:
        yield frame.x(curve.until), before


def _outline(frame: _Frame, curve: Curve) -> Iterator[XY]:
    yield from ((frame.x(time), frame.y(hi)) for time, _, hi in curve.band)
    yield from ((frame.x(time), frame.y(lo)) for time, lo, _ in reversed(curve.band))
