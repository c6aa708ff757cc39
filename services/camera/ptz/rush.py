"""The start at full speed that begins a way of several hops: one command, where hops would be many.

It goes on until the goal is within reach of a hop, that takes its place in flight. Not here: the hops (`hopping.py`).
"""

from __future__ import annotations

from typing import cast

from services.camera.plan import Plan, wait
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.helm import Helm, levels_of, sign
from services.camera.ptz.pace import Pace
from services.camera.requests import Reading, Status

FEARED = 1.0  # of the doubt about a rate, where a stop is near
MOST_HOPS = 4  # are left, although zoom has to wait for them
BULK = 1.5  # answers: one that is shorter is not worth it
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
    turning = {axis: _along(helm, axis, way, held) * sign(way) for axis, way in ways.items() if helm.skill.diagonals}
    turning[lead] = pace.speeds[-1] * sign(way)
    now = (yield from helm.start(levels_of(turning))).received
    level = pace.speeds[-1]
    end = helm.course.origin[lead] + sign(way) * (held * rates[lead] + pace.change(level) * pace.rate(level) / 2)
    for early in (True, False):  # once soon, as long as the speed is not known, and once before the end
        ends = helm.course.end_for(lead, end, now)
        unsure = helm.course.model_doubt(lead, ends) / rates[lead]
        latest = ends - 2 * timing.usual - min(timing.tail, LATE_LOOK * timing.usual)
        look = max(now, latest - unsure)
        if latest < now or (early and pace.known(level)):
            continue
        yield from wait(min(look, now + timing.usual) if early else look)
        reply = yield from helm.send(Status())
        now = reply.received
        helm.course.read(reply, cast(Reading, reply.result))
    return (yield from wait(max(now, helm.course.end_for(lead, end, now) - timing.usual)))


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


def _along(helm: Helm, axis: int, way: float, held: float) -> int:
    """The speed of an axis beside the other: it stays before its goal, and if that ends late before its stop."""
    pace, room = helm.skill.paces[axis], helm.room(axis, way)
    for speed in reversed(pace.speeds):
        late = _most(pace, speed) * (held + helm.skill.timing.tail)
        if pace.rate(speed) * held <= abs(way) and late <= abs(way) + room:
            return speed
    return 0
