"""The start at full speed that begins a way of several hops: one command, where hops would be many.

It goes on until the goal is within reach of a hop, that takes its place in flight. One axis leads; the other one has a
speed with which it stays before its goal, and in the course of it another one, where that saves hops. Not here: the
hops (`hopping.py`).
"""

from __future__ import annotations

from math import inf
from typing import cast

from services.camera.device import Reading, Status
from services.camera.plan import Plan, wait
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.helm import Helm, levels_of, sign
from services.camera.ptz.pace import Pace
from services.camera.ptz.skill import AGAIN_PART

FEARED = 1.0  # of the doubt about a rate, where a stop is near
MOST_HOPS = 3  # are left, although zoom has to wait for them: more of them cost commands and win no time
BULK = 1.5  # answers: one that is shorter is not worth it
SHARES = (0.3, 0.4, 0.5, 0.6, 0.7)  # of it, the axis beside may have its first speed; then another one,
FARTHER = 0.6  # where that leads it so much farther, of what a hop reaches
LOOKS = 4.0  # answers that the looks before its end take
LATE_LOOK = 2.0  # answers: a look as late as that does not delay what it is for


def rush(helm: Helm, reaches: tuple[float, float], now: float, *, zooms: bool) -> Plan[float]:
    """Turns as long as a late answer does no harm, and a hop reaches no farther; `reaches`: of pan and tilt, degrees.

    `zooms`: hops are to take zoom along, which this puts off. Returns when the first hop has to be sent.
    """
    timing, ways = helm.skill.timing, {axis: helm.aim[axis] - helm.course.origin[axis] for axis in (PAN, TILT)}
    rates = {axis: _top(helm.skill.paces[axis]) for axis in ways}
    lead = max(ways, key=lambda axis: abs(ways[axis]) / rates[axis])
    pace, way = helm.skill.paces[lead], ways[lead]
    safe = (abs(way) + helm.room(lead, way) - _brakes(pace)) / _most(pace, pace.speeds[-1]) - timing.tail
    held = min((abs(way) - _before(pace, reaches[lead], timing.spread)) / rates[lead], safe)
    early = _whole(pace, way) - (_zooming(helm) if zooms else 0.0)  # so that zoom is there as soon
    held = min(held, max(early, (abs(way) - MOST_HOPS * reaches[lead]) / rates[lead]))
    if held < BULK * timing.usual:
        return now
    level, other = pace.speeds[-1], TILT if lead == PAN else PAN
    first = _first(helm, other, ways[other], held, reaches[other]) if pace.known(level) else held
    beside = _along(helm, other, ways[other], first)
    now = (yield from helm.start(levels_of({lead: level * sign(way), other: beside * sign(ways[other])}))).received
    shows = now + timing.usual
    end = helm.course.origin[lead] + sign(way) * (held * rates[lead] + pace.change(level) * pace.rate(level) / 2)
    if first < held:
        now = yield from wait(now + first - timing.usual)
        left = helm.way(other, now)
        beside = _along(helm, other, left, held - first, beside)
        now = (yield from helm.start(levels_of({lead: level * sign(way), other: beside * sign(left)}))).received
    for early in (True, False):  # as soon as it shows how fast it is, where that is not known, and before the end
        ends = min(helm.course.end_for(lead, end, now), _safe(helm, other, now))
        unsure = helm.course.model_doubt(lead, ends) / rates[lead]
        latest = ends - 2 * timing.usual - min(timing.tail, LATE_LOOK * timing.usual)
        if latest < now or (early and pace.known(level)):
            continue
        yield from wait(min(latest, shows) if early else max(now, latest - unsure))
        reply = yield from helm.send(Status())
        now = reply.received
        helm.course.read(reply, cast(Reading, reply.result))
    ends = min(helm.course.end_for(lead, end, now), _safe(helm, other, now))
    return (yield from wait(max(now, ends - timing.usual)))


def _safe(helm: Helm, axis: int, now: float) -> float:
    """Until when the axis beside may turn."""
    level = abs(helm.course.levels[axis])
    return helm.safe(axis, helm.skill.paces[axis].rate(level), now) if level else inf


def _top(pace: Pace) -> float:
    return pace.rate(pace.speeds[-1])


def _most(pace: Pace, speed: int) -> float:
    """The rate that a speed may have."""
    return pace.rate(speed) + FEARED * pace.doubt(speed)


def _whole(pace: Pace, way: float) -> float:
    """How long an axis takes from rest to rest."""
    return abs(way) / _top(pace) + pace.change(pace.speeds[-1])


def _brakes(pace: Pace) -> float:
    """How far it goes while it brakes from its top speed."""
    return pace.braking(_top(pace))


def _before(pace: Pace, reach: float, spread: float) -> float:
    """How far before its goal a hop should begin that leads there: within its reach, and before it would brake."""
    return max((reach + _brakes(pace)) / 2, reach - _top(pace) * spread)


def _zooming(helm: Helm) -> float:
    """How long zoom takes, which a start at full speed puts off."""
    return abs(helm.aim[ZOOM] - helm.course.origin[ZOOM]) / helm.skill.drive(ZOOM).rate(1)


def _first(helm: Helm, axis: int, way: float, held: float, reach: float) -> float:
    """For how long the axis beside has its first speed: all the time, or until another one leads it clearly farther."""
    timing = helm.skill.timing
    last = max(LOOKS * timing.usual, timing.usual + timing.tail)  # a late answer delays nothing that comes after it
    parts = [share * held for share in SHARES if (1 - share) * held >= last and share * held >= 2 * timing.usual]
    covers = {first: _covered(helm, axis, way, held, first) for first in (held, *parts)}
    best = max(covers, key=lambda first: covers[first])
    return best if covers[best] > covers[held] + FARTHER * reach else held


def _covered(helm: Helm, axis: int, way: float, held: float, first: float) -> float:
    """How far the axis beside goes that has its first speed for so long."""
    pace, one = helm.skill.paces[axis], _along(helm, axis, way, first)
    goes = pace.rate(one) * first if one else 0.0
    other = _along(helm, axis, way - sign(way) * goes, held - first, one) if first < held else 0
    return goes + (pace.rate(other) * (held - first) if other else 0.0)


def _along(helm: Helm, axis: int, way: float, held: float, before: int = 0) -> int:
    """The speed of an axis beside the other: it stays before its goal, and if that ends late before its stop.

    `before`: the speed that it has until then, and longer if that is late.
    """
    if not helm.skill.diagonals:
        return 0
    pace, tail = helm.skill.paces[axis], helm.skill.timing.tail
    room = helm.room(axis, way) - (AGAIN_PART * tail * pace.rate(before) if before else 0.0)
    for speed in reversed(pace.speeds):
        late = _most(pace, speed) * (held + tail)
        if pace.rate(speed) * held <= abs(way) and late <= abs(way) + room:
            return speed
    return 0
