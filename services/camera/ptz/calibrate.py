"""Learning the motors on purpose: every speed of every axis once there and back, watched, and back to where it looked.

The same filters learn as in every move; this only shows them each speed early, and where the firmware goes on by parts
of the picture, how large these are at each zoom. Nothing here pushes against a stop: each leg goes towards the middle
of the range, and no farther than there is room for.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

from services.camera.plan import Plan, wait
from services.camera.ptz.course import END, PAN, TILT, ZOOM
from services.camera.ptz.goal import Goal, Limits
from services.camera.ptz.helm import Helm, levels_of
from services.camera.ptz.move import Arrival, goto
from services.camera.ptz.pace import HALF_CHANGE, READ_LATE
from services.camera.ptz.skill import Skill
from services.camera.ptz.stand import settle
from services.camera.requests import Reading, Status

NAMES = ("pan", "tilt", "zoom")
LEG_S = 1.5  # each leg turns so long, or less where there is less room
ROOM = 0.3  # of the way to the end stop that a leg may use
FIRST_MOVE_DEG = 12.0  # shows the signs, and what the firmware honours
MOVE_S = 60.0
ZOOMS = (1, -1, 1, -1)
LOOKS = 20  # on the way of zoom
PLACES = 40  # for the relative form, whose scale they teach: some way from one to the next, and each at another zoom
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
    yield from goto(_aside(limits, began), limits, skill, now + MOVE_S, near=reading)
    for axis in (PAN, TILT):
        for speed in skill.paces[axis].speeds:
            now = yield from _leg(limits, skill, axis, speed)
    now = yield from _zoom(limits, skill, now)
    for goal in _places(limits):
        now = (yield from goto(goal, limits, skill, now + MOVE_S)).at
        if all(skill.honours.get(form) != "yes" for form in skill.scales):
            break
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


def _leg(limits: Limits, skill: Skill, axis: int, speed: int) -> Plan[float]:
    """One start and stop towards the middle of the range, with a reading on the way and one at rest."""
    reading, now = yield from settle()
    helm = Helm(Goal(limits.pose(reading)), limits, skill)
    helm.stand(reading)
    low, high = limits.ranges[axis]
    here = helm.course.origin[axis]
    way = 1 if here < (low + high) / 2 else -1
    room = ROOM * ((high - here) if way > 0 else (here - low))
    held = min(LEG_S, room / (skill.paces[axis].rate(speed) + 2 * skill.paces[axis].doubt(speed)))
    begun = yield from helm.start(levels_of({axis: way * speed}))
    ends = begun.received + held - skill.timing.usual
    now = yield from wait(max(begun.received, ends - skill.timing.usual - skill.timing.spread))
    reply = yield from helm.send(Status())
    helm.course.read(reply, cast(Reading, reply.result))
    now = yield from helm.stop((yield from wait(max(reply.received, ends))))
    _, now = yield from helm.rest(now)
    return now


def _zoom(limits: Limits, skill: Skill, now: float) -> Plan[float]:
    """Zoom from one end to the other and back, looked at all the way: its coarse steps tell its speed by and by."""
    for level in (-1, *ZOOMS):
        reading, now = yield from settle()
        helm = Helm(Goal(limits.pose(reading)), limits, skill)
        helm.stand(reading)
        end, grid = limits.zoom[level > 0], skill.zoom_step
        now = (yield from helm.start((0, 0, level))).received
        for _ in range(LOOKS):
            reply = yield from helm.send(Status())
            now, reading = reply.received, cast(Reading, reply.result)
            helm.course.read(reply, reading)
            if abs(reading.zoom - end) < END:
                break
        last = grid / skill.paces[ZOOM].rate(1)  # to the very end, which a coarse reading does not tell
        now = yield from helm.stop((yield from wait(now + last)))
        if abs(reading.zoom - end) < END:
            skill.zoomed = (reading.zoom, end)
    return now


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
        "acceleration of pan": f"{1 / (2 * pan.other(HALF_CHANGE)):.0f} degrees/s^2",
        "acceleration of tilt": f"{1 / (2 * tilt.other(HALF_CHANGE)):.0f} degrees/s^2",
        "smallest step of pan": f"{pan.rate(1) * timing.usual:.2f} degrees",
        "right is": "growing pan" if skill.senses[PAN].sign > 0 else "falling pan",
        "down is": "growing tilt" if skill.senses[TILT].sign > 0 else "falling tilt",
        "both axes at once": "yes" if skill.diagonals else "no",
        "drives by itself": ", ".join(honoured) or "no",
    }
