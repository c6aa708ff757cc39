"""A plot of an item's numbers as SVG text: axes with local times and the unit. Pure; browsers and editors show it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, tzinfo
from xml.sax.saxutils import escape

US = 1_000_000
WIDTH, HEIGHT = 960, 360
LEFT, RIGHT, TOP, BOTTOM = 70, 20, 36, 44
MOST_TICKS = 8
MINUTE, HOUR, DAY = 60, 3600, 86_400
STEPS_S = (1, 5, 15, 30, MINUTE, 5 * MINUTE, 15 * MINUTE, 30 * MINUTE, HOUR, 3 * HOUR, 6 * HOUR, 12 * HOUR, DAY,
           2 * DAY, 7 * DAY, 14 * DAY, 30 * DAY, 90 * DAY, 365 * DAY)  # fmt: skip
STYLE = (
    "text{font:12px sans-serif;fill:#333}.axis{stroke:#333}.grid{stroke:#ddd}.band{fill:#9bc4e2}"
    ".line{fill:none;stroke:#1f5f8b;stroke-width:1.5}.title{font-size:14px;font-weight:bold}"
)


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


def svg(curve: Curve, zone: tzinfo) -> str:
    """The picture."""
    frame = _Frame(curve)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}">',
        f'<style>{STYLE}</style><rect width="100%" height="100%" fill="#fff"/>',
        f'<text class="title" x="{LEFT}" y="20">{escape(_title(curve))}</text>',
        *_value_axis(frame),
        *_time_axis(frame, curve, zone),
    ]
    if curve.band:
        parts.append(f'<polygon class="band" points="{" ".join(_outline(frame, curve))}"/>')
    if curve.points:
        parts.append(f'<polyline class="line" points="{" ".join(_line(frame, curve))}"/>')
    return "\n".join([*parts, "</svg>", ""])


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


def _value_axis(frame: _Frame) -> Iterator[str]:
    for number in range(round((frame.high - frame.low) / frame.step) + 1):
        value = frame.low + number * frame.step
        y = frame.y(value)
        yield f'<line class="grid" x1="{LEFT}" y1="{y}" x2="{WIDTH - RIGHT}" y2="{y}"/>'
        yield f'<text x="{LEFT - 8}" y="{y + 4}" text-anchor="end">{value:.6g}</text>'
    yield f'<line class="axis" x1="{LEFT}" y1="{TOP}" x2="{LEFT}" y2="{HEIGHT - BOTTOM}"/>'


def _time_axis(frame: _Frame, curve: Curve, zone: tzinfo) -> Iterator[str]:
    bottom = HEIGHT - BOTTOM
    yield f'<line class="axis" x1="{LEFT}" y1="{bottom}" x2="{WIDTH - RIGHT}" y2="{bottom}"/>'
    span_s = (curve.until - curve.since) / US
    step_s = next((step for step in STEPS_S if span_s / step <= MOST_TICKS), STEPS_S[-1])
    form = "%Y-%m-%d" if step_s >= DAY else "%H:%M" if step_s >= MINUTE else "%H:%M:%S"
    for moment in _ticks(curve.since, curve.until, step_s, zone):
        x = frame.x(round(moment.timestamp() * US))
        yield f'<line class="axis" x1="{x}" y1="{bottom}" x2="{x}" y2="{bottom + 5}"/>'
        yield f'<text x="{x}" y="{bottom + 18}" text-anchor="middle">{moment.strftime(form)}</text>'
    first, last = (datetime.fromtimestamp(time / US, zone) for time in (curve.since, curve.until))
    days = f"{first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} {last.tzname() or ''}".rstrip()
    yield f'<text x="{WIDTH - RIGHT}" y="{bottom + 36}" text-anchor="end">{escape(days)}</text>'


def _ticks(since: int, until: int, step_s: int, zone: tzinfo) -> Iterator[datetime]:
    """Round local times of the span."""
    offset = datetime.fromtimestamp(since / US, zone).utcoffset()
    shift = int(offset.total_seconds()) if offset else 0
    first = -(-(since // US + shift) // step_s) * step_s - shift
    for second in range(first, until // US + 1, step_s):
        yield datetime.fromtimestamp(second, zone)


def _line(frame: _Frame, curve: Curve) -> Iterator[str]:
    before: float | None = None
    for time, value in curve.points:
        if curve.steps and before is not None:
            yield f"{frame.x(time)},{before}"
        before = frame.y(value)
        yield f"{frame.x(time)},{before}"
    if curve.steps and before is not None:
        yield f"{frame.x(curve.until)},{before}"


def _outline(frame: _Frame, curve: Curve) -> Iterator[str]:
    yield from (f"{frame.x(time)},{frame.y(hi)}" for time, _, hi in curve.band)
    yield from (f"{frame.x(time)},{frame.y(lo)}" for time, lo, _ in reversed(curve.band))
