"""Zoom from one end to the other and back, looked at whenever it probably enters another step of its coarse reading.

By the firmware's own moves where these take zoom along, otherwise by start and stop. What the looks tell:
`zoom_rate.py`.
"""

from __future__ import annotations

from math import hypot, inf
from typing import cast

import numpy as np

from services.camera.device import Direction, MoveOver, Reading, Reply, Request, Start, Status
from services.camera.plan import Plan, ask, wait
from services.camera.ptz import drive
from services.camera.ptz.course import END, PAN, TILT, ZOOM
from services.camera.ptz.goal import Limits, Pose
from services.camera.ptz.pace import HALF_CHANGE
from services.camera.ptz.scale import zooms
from services.camera.ptz.skill import OTHER_PART, Skill
from services.camera.ptz.stand import settle, stop
from services.camera.ptz.zoom_rate import ZoomRate

SWEEPS = 15  # from end to end
MORE_SWEEPS = 36  # where hops begin while zoom turns: how far they go depends on where it is then
LOOKS = 20  # at one of them
LEAST_DOUBT, DOUBTS = 0.05, 3.0  # of its rate before the first look, at least; times what was doubted before
SPARE = 1.2  # of a way by the relative form, so that the end is met exactly


def sweep(limits: Limits, skill: Skill) -> Plan[float]:
    """Learns the rate of zoom; it is left at an end of its range. Returns when that was."""
    own = not isinstance(_request(limits, skill, (0.0, 0.0, limits.zoom[0]), limits.zoom[1]), Start)
    pace = skill.drive(ZOOM) if own else skill.paces[ZOOM]
    known = ZoomRate(pace.rate(1), max(LEAST_DOUBT, DOUBTS * pace.doubt(1) / pace.rate(1)))
    for number in range(1 + (MORE_SWEEPS if skill.hops else SWEEPS)):  # the first one begins anywhere
        now, there = yield from _once(limits, skill, known, limits.zoom[number % 2])
        if not there:
            return now
    known.teach(pace)
    if own:
        skill.zoom_rate = known
        part = hypot(pace.doubt(1) / pace.rate(1), OTHER_PART)
        skill.paces[ZOOM].suppose(pace.rate(1), part, pace.other(HALF_CHANGE))
    return now


def _request(limits: Limits, skill: Skill, here: Pose, to: float) -> Request:
    """What lets zoom go from a pose to a level."""
    way = drive.find(here, (here[PAN], here[TILT], to), limits, skill, {})
    if way is not None and drive.honoured(skill, way):
        return way.request
    if drive.pan_only(skill):
        return drive.to_pan(here, (here[PAN], here[TILT], to))
    for form in skill.scales:
        if skill.honours.get(form) == skill.honours.get(zooms(form)) == "yes":
            return MoveOver(0.0, 0.0, SPARE * (to - here[ZOOM]), form)
    return Start(Direction.ZOOM_IN if to > here[ZOOM] else Direction.ZOOM_OUT)


def _once(limits: Limits, skill: Skill, known: ZoomRate, end: float) -> Plan[tuple[float, bool]]:
    """To one end; when that was, and whether it was read to come there."""
    reading, _ = yield from settle()
    here, step = skill.zoom_truth(reading.zoom), skill.zoom_step
    begun = yield from _send(skill, _request(limits, skill, limits.pose(reading), end))
    way, now = abs(end - here), begun.received
    for _ in range(LOOKS):
        comes = known.comes(np.arange(step / 2, way, step), now - begun.received)
        yield from wait(now if comes is None else begun.received + comes)
        reply = yield from _send(skill, Status())
        now, reading = reply.received, cast(Reading, reply.result)
        skill.see_zoom(reading.zoom, limits.zoom)
        seen = skill.seen_at(reply) - begun.received
        if here in limits.zoom and seen > 0:
            came = abs(reading.zoom - here)
            known.see(seen, came - step / 2 if came else -inf, came + step / 2 if came < way else inf)
        if abs(reading.zoom - end) < END:
            break
    now = yield from wait(now + step / skill.paces[ZOOM].rate(1))  # to the very end, which a coarse reading leaves open
    if isinstance(begun.request, Start):
        now = (yield from stop(now)).received
    there = abs(reading.zoom - end) < END
    if there:
        skill.zoomed = (reading.zoom, end)
    return now, there


def _send(skill: Skill, request: Request) -> Plan[Reply]:
    reply = yield from ask(request)
    skill.timed(reply.received - reply.sent)
    return reply
