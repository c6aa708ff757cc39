"""A move that the firmware makes, followed until it rests. Which moves there are, and what they taught: `drive.py`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

from services.camera.device import Reading, Refused, Request, Status
from services.camera.plan import Plan, wait
from services.camera.ptz import drive as own
from services.camera.ptz.arriving import Arriving
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.goal import Pose
from services.camera.ptz.helm import Helm

MOST_DRIVES = 4  # in one move
TRY_LEFT = 7  # commands; with fewer nothing new is tried
EXACT = 3  # of its moves in a row ended where they should: then it is known where the next one ends,
LEFT_DEG = 2.0  # and a look is enough while so much of it should be left
LONG_S = 2.0  # a drive that takes longer is looked at on the way, which costs no time


class Driving:
    """What the firmware does by itself in one move."""

    def __init__(self, helm: Helm, presets: Mapping[int, Pose]) -> None:
        self.helm, self.presets = helm, presets
        self.drives = 0
        self.tried: list[Request] = []

    def drive(self, reading: Reading, now: float) -> Plan[tuple[Reading, float] | None]:
        """Lets the firmware drive, where it has a way to; None when it has not."""
        skill, here = self.helm.skill, self.helm.pose(reading)
        aim = (self.helm.aim[PAN], self.helm.aim[TILT], self.helm.goal.pose[ZOOM])
        while self.helm.zoom_ends is None and self.drives < MOST_DRIVES:
            way = own.find(here, aim, self.helm.limits, skill, self.presets)
            if way is None or way.request in self.tried:
                break
            if not own.honoured(skill, way) and self._late():
                break
            self.drives += 1
            self.tried.append(way.request)
            try:
                begun = yield from self.helm.send(way.request)
            except Refused:
                own.refuse(skill, way)
                continue
            drive, proven = own.Begun(way, here, begun), own.honoured(skill, way)
            reading, now, rests = yield from follow(self.helm, drive, certain=own.certain(skill, way), proven=proven)
            there = self.helm.limits.pose(reading) if rests else way.to  # one on its last bit of way teaches nothing
            own.judge(skill, here, way, there)
            return reading, now
        return None

    def _late(self) -> bool:
        """Whether there is no time to try something new: one in a move, and while there are commands left."""
        return self.drives > 1 or self.helm.left < TRY_LEFT


def follow(helm: Helm, drive: own.Begun, *, certain: bool, proven: bool) -> Plan[tuple[Reading, float, bool]]:
    """Looks at the firmware's own move until it has ended; once on the way, where its speed is not known well.

    `certain`: it is known where that leads; `proven`: from experience. Returns the reading, when it rests, and whether
    that surely shows the camera at rest; otherwise it leaves open whether it moves, and may be of just before the end.
    """
    now, skill, way = drive.reply.received, helm.skill, drive.drive
    arrives = drive.arrives(skill)
    known = all(skill.drive(axis).known(1) for axis in (PAN, TILT))
    if not drive.ended and arrives - now > (LONG_S if known else 3 * skill.timing.usual):
        now = yield from wait(now + 0.6 * (arrives - now) - skill.timing.usual)
        reply = yield from helm.send(Status())
        now = reply.received
        drive.look(skill, reply, helm.limits.pose(cast(Reading, reply.result)))
        arrives = drive.arrives(skill)
    left = LEFT_DEG if proven and skill.exact >= EXACT else 0.0
    *turning, zooming = drive.ways(skill)
    end = Arriving(helm, way.to, zooming, certain, turning=turning if left else (), ended=drive.ended)
    reading, now, rests = yield from end.at_rest(drive.nears(skill, left), arrives, now)
    helm.rests, helm.foretold = arrives, reading is not end.seen[-1]
    skill.foretold = helm.limits.pose(reading) if helm.foretold else None
    if certain and not helm.foretold:
        skill.ended(end.off)
    skill.lead_zoom(reading.zoom, way.to[ZOOM])
    helm.stand(reading)
    return (reading if rests else replace(reading, moving=None)), now, rests
