"""A move that the firmware makes, followed until it rests. Which moves there are, and what they taught: `drive.py`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from services.camera.device import same
from services.camera.plan import Plan, wait
from services.camera.ptz import drive as own
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.glide import Glide
from services.camera.ptz.goal import Pose
from services.camera.ptz.helm import FOREVER, PAIR_S, Helm
from services.camera.ptz.skill import NEARER_DEG
from services.camera.requests import Reading, Refused, Reply, Request, Status

MOST_DRIVES = 4  # in one move
TRY_LEFT = 7  # commands; with fewer nothing new is tried
LOOKS = 30  # less and less often
THERE_DEG = 0.15  # what is farther off is on its last bit of way
LONG_S = 2.0  # a drive that takes longer is looked at on the way, which costs no time


class Driving:
    """What the firmware does by itself in one move."""

    def __init__(self, helm: Helm, presets: Mapping[int, Pose]) -> None:
        self.helm, self.presets = helm, presets
        self.drives = 0
        self.tried: list[Request] = []

    def drive(self, reading: Reading, now: float) -> Plan[tuple[Reading, float] | None]:
        """Lets the firmware drive, where it has a way to; None when it has not."""
        here = self.helm.pose(reading)
        aim = (self.helm.aim[PAN], self.helm.aim[TILT], self.helm.goal.pose[ZOOM])
        while self.helm.zoom_ends is None and self.drives < MOST_DRIVES:
            way = own.find(here, aim, self.helm.limits, self.helm.skill, self.presets)
            if way is None or way.request in self.tried:
                break
            if not own.honoured(self.helm.skill, way) and self._late():
                break
            self.drives += 1
            self.tried.append(way.request)
            try:
                begun = yield from self.helm.send(way.request)
            except Refused:
                own.refuse(self.helm.skill, way)
                continue
            return (yield from self._arrive(way, here, begun))
        return None

    def _late(self) -> bool:
        """Whether there is no time to try something new: one in a move, and while there are commands left."""
        return self.drives > 1 or self.helm.left < TRY_LEFT

    def _arrive(self, way: own.Drive, here: Pose, begun: Reply) -> Plan[tuple[Reading, float]]:
        """Looks at the firmware's own move until it has ended; once on the way, where its speed is not known well."""
        now = begun.received
        zooming = own.zooming(self.helm.skill, here[ZOOM], way.to[ZOOM], now)
        arrives = now + own.longest(self.helm.skill, here, way.to)
        known = all(self.helm.skill.drive(axis).known(1) for axis in (PAN, TILT))
        if arrives - now > (LONG_S if known else 3 * self.helm.skill.timing.usual):
            now = yield from wait(now + 0.6 * (arrives - now) - self.helm.skill.timing.usual)
            reply = yield from self.helm.send(Status())
            now, seen = reply.received, self.helm.limits.pose(cast(Reading, reply.result))
            own.learn_on_the_way(self.helm.skill, here, way, begun, reply, seen)
            own.see_zoom(self.helm.skill, zooming, reply)
            arrives = begun.received + own.longest(self.helm.skill, here, way.to)
        certain = own.certain(self.helm.skill, way)
        reading, now, rests = yield from at_rest(self.helm, arrives, way.to, now, zooming, certain=certain)
        self.helm.rests = arrives
        there = self.helm.limits.pose(reading) if rests else way.to  # one on its last bit of way teaches nothing
        own.judge(self.helm.skill, here, way, there)
        self.helm.skill.lead_zoom(reading.zoom, way.to[ZOOM])
        self.helm.stand(reading)
        return reading, now


def at_rest(
    helm: Helm,
    arrives: float,
    to: Pose,
    now: float,
    zooming: Glide,
    *,
    certain: bool,
    about: float = 0.0,
    hops: bool = False,
) -> Plan[tuple[Reading, float, bool]]:
    """Looks until what the firmware drives has ended, as good as; `certain`: it is known exactly where that leads.

    `about`: that is not known quite exactly, but so few degrees; there one look is enough if it tells of rest. `hops`:
    it may be beyond its end and return, so it is not there while it says that it moves.
    Returns the reading, when it came, and whether it surely shows the camera at rest.
    """
    skill = helm.skill
    yield from wait(max(now, arrives - skill.read_late + skill.arrives_late))
    seen: list[Reading] = []
    before = since = FOREVER
    for _ in range(LOOKS):
        reply = yield from helm.send(Status())
        seen.append(cast(Reading, reply.result))
        own.see_zoom(skill, zooming, reply)
        pose = helm.limits.pose(seen[-1])
        off = max(abs(pose[axis] - to[axis]) for axis in (PAN, TILT))
        if len(seen) > 1 and seen[-2].moving and same(seen[-2], seen[-1]):
            skill.says_late = True
        rests = skill.tells_end(seen[-1].moving)
        goes = hops and seen[-1].moving is True and not skill.always_moving
        there = certain and off <= NEARER_DEG and (rests or not (about or goes))
        on = helm.beside(pose) and off <= about and rests
        since = since if len(seen) > 1 and same(seen[-2], seen[-1]) else reply.sent
        steps = zooming.goal != zooming.place and not skill.tells_rest(seen[-1].moving)
        still = reply.sent >= since + (max(PAIR_S, skill.step_s) if steps else PAIR_S)
        if there or on or still:
            break
        before = reply.sent
        yield from wait(before + min(LONG_S, PAIR_S * (len(seen) - 1)))
    if certain and (there or not same(seen[0], seen[-1])):
        skill.expect_arrival(there=len(seen) == 1 and off <= max(THERE_DEG, about))
    tells = seen[-1].moving is False and not skill.always_moving
    now = yield from wait(reply.received if tells or still else max(reply.received, own.zoomed_by(skill, zooming)))
    return seen[-1], now, rests or still
