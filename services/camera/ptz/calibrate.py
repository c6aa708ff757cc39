"""Learning the motors on purpose: every speed of each axis, watched, zoom from end to end, and back to where it looked.

The same filters learn as in every move; this only shows them each speed early, what the moments of answers mean, and
where the firmware goes on by parts of the picture, how large these are at each zoom. How fast zoom is, is told by
looks at chosen moments (`zoom_sweeps.py`). Nothing here pushes against a stop: each leg goes towards the middle of the
range, and no farther than there is room for.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import cast

from services.camera.device import Reading, Status
from services.camera.plan import Plan, wait
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.goal import Goal, Limits
from services.camera.ptz.helm import Helm, levels_of
from services.camera.ptz.move import Arrival, goto
from services.camera.ptz.pace import READ_LATE
from services.camera.ptz.skill import Skill
from services.camera.ptz.stand import settle
from services.camera.ptz.zoom_sweeps import sweep

NAMES = ("pan", "tilt", "zoom")
LEG_S, ROOM = 1.5, 0.3  # each leg turns so long, and through so much of the way to the end stop at most
LONG_S, LONG_ROOM = 3.0, 0.6  # those of the highest speed
AGAIN = (8, 4)  # more of these, of pan and tilt: they tell exactly what the moments of answers mean
FIRST_MOVE_DEG = 12.0  # shows the signs, and what the firmware honours
MOVE_S = 60.0
FIRST_PLACES = 3  # show what the firmware honours
PLACES = 34  # with these, for the relative form, whose scale they teach: some way apart, and each at another zoom
MARGIN = 0.15  # of a range, at either end, in which none of them lies


@dataclass(frozen=True)
class Learnt:
    """One speed of one axis, as it is shown."""

    axis: str
    speed: int
    rate: float
    doubt: float


def calibrate(limits: Limits, skill: Skill) -> Plan[Arrival]:
    """Turns with every speed; ends where it began. DeviceError as in a move."""
    reading, now = yield from settle()
    pan, tilt, zoom = limits.pose(reading)
    began = limits.goal(pan % 360.0, min(limits.tilt[1], max(limits.tilt[0], tilt)), zoom)
    reading = (yield from goto(_aside(limits, began), limits, skill, now + MOVE_S, near=reading)).reading
    for axis in (PAN, TILT):
        *slower, fastest = skill.paces[axis].speeds
        for speed in slower:
            reading = yield from _leg(limits, skill, axis, speed, reading, LEG_S, ROOM)
        for _ in range(1 + AGAIN[axis]):
            reading = yield from _leg(limits, skill, axis, fastest, reading, LONG_S, LONG_ROOM)
    now, places = (yield from wait(0.0)), _places(limits)
    for goal in islice(places, FIRST_PLACES):
        now = (yield from goto(goal, limits, skill, now + MOVE_S)).at
    now = yield from sweep(limits, skill)
    if skill.hops:
        for goal in places:
            now = (yield from goto(goal, limits, skill, now + MOVE_S)).at
    return (yield from goto(began, limits, skill, now + MOVE_S))


def _aside(limits: Limits, began: Goal) -> Goal:
    """A little towards the middle of both ranges, and as much in zoom: the first move tells the signs."""
    aside = []
    for axis, (low, high) in zip((PAN, TILT), limits.ranges, strict=False):
        here = began.pose[axis]
        aside.append(here + (FIRST_MOVE_DEG if here < (low + high) / 2 else -FIRST_MOVE_DEG))
    low, high = limits.zoom
    zoom = began.pose[ZOOM] + (high - low) / 4 * (1 if began.pose[ZOOM] < (low + high) / 2 else -1)
    return Goal((aside[PAN], aside[TILT], zoom))


def _places(limits: Limits) -> Iterator[Goal]:
    """All over the ranges, each a step of both axes and of zoom from the last."""
    for number in range(PLACES):
        parts = [(step * number % PLACES) / (PLACES - 1) for step in (3, 7)]
        pan, tilt = (
            low + (high - low) * (MARGIN + (1 - 2 * MARGIN) * part)
            for part, (low, high) in zip(parts, limits.ranges, strict=False)
        )
        low, high = limits.zoom
        yield Goal((pan, tilt, low + (high - low) * (number % 5) / 4))


def _leg(limits: Limits, skill: Skill, axis: int, speed: int, near: Reading, most: float, part: float) -> Plan[Reading]:
    """One start and stop towards the middle of the range, with readings on the way and one at rest.

    It turns for `most` seconds, or for a part of the time until the end stop; a late stop ends it before that, too.
    """
    reading, now = yield from settle(near)
    helm = Helm(Goal(limits.pose(reading)), limits, skill, now + MOVE_S)
    helm.stand(reading)
    low, high = limits.ranges[axis]
    here = helm.course.origin[axis]
    way = 1 if here < (low + high) / 2 else -1
    room, pace = (high - here) if way > 0 else (here - low), skill.paces[axis]
    stop = room / (pace.rate(speed) + 2 * pace.doubt(speed))  # it turns until there, at the fastest
    held = min(most, part * stop, stop - skill.timing.tail)
    begun = yield from helm.start(levels_of({axis: way * speed}))
    ends, last = begun.received + held - skill.timing.usual, skill.timing.usual + skill.timing.spread
    now = begun.received
    while now + 2 * last < ends:
        now = yield from _look(helm, now)
    now = yield from _look(helm, max(now, ends - last))
    now = yield from helm.stop((yield from wait(max(now, ends))))
    reading, _ = yield from helm.rest(now)
    return reading


def _look(helm: Helm, when: float) -> Plan[float]:
    yield from wait(when)
    reply = yield from helm.send(Status())
    helm.course.read(reply, cast(Reading, reply.result))
    return reply.received


def table(skill: Skill) -> list[Learnt]:
    """Every speed of every axis, degrees/s or levels/s."""
    return [
        Learnt(name, speed, pace.rate(speed), pace.doubt(speed))
        for name, pace in zip(NAMES, skill.paces, strict=True)
        for speed in pace.speeds
    ]


def habits(skill: Skill) -> dict[str, str]:
    """What else is known: delays, accelerations, the smallest step, what the firmware honours."""
    pan, tilt, timing = skill.paces[PAN], skill.paces[TILT], skill.timing
    honoured = [form for form, how in skill.honours.items() if how != "no"]
    return {
        "an answer takes": f"{timing.usual:.2f} s, most within {timing.spread:.2f} s of that",
        "it may be late by": f"{timing.tail:.2f} s",
        "a reading tells of": f"{-pan.other(READ_LATE):+.2f} s before it is asked for",
        "acceleration of pan": f"{1 / pan.slow:.0f} degrees/s^2",
        "acceleration of tilt": f"{1 / tilt.slow:.0f} degrees/s^2",
        "smallest step of pan": f"{pan.rate(1) * timing.usual:.2f} degrees",
        "right is": "growing pan" if skill.senses[PAN].sign > 0 else "falling pan",
        "down is": "growing tilt" if skill.senses[TILT].sign > 0 else "falling tilt",
        "both axes at once": "yes" if skill.diagonals else "no",
        "drives by itself": ", ".join(honoured) or "no",
    }
