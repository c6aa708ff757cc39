"""The end of what the firmware drives by itself: looks until it rests, as good as, and when that surely is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import sqrt
from typing import cast

from services.camera.device import Reading, Reply, Status
from services.camera.lanes import same
from services.camera.plan import Plan, wait
from services.camera.ptz import zoom_drive
from services.camera.ptz.course import FOREVER, PAN, TILT, ZOOM
from services.camera.ptz.glide import Glide
from services.camera.ptz.goal import Pose
from services.camera.ptz.helm import PAIR_S, Helm
from services.camera.ptz.landing import RESTED_S
from services.camera.ptz.pace import READ_LATE, Pace
from services.camera.ptz.skill import NEARER_DEG, THERE_DEG

FEW = 3  # commands left
LOOKS = 30  # less and less often
LONG_S = 2.0  # apart, at most
MOSTLY = 0.7  # of the spread of answers: one look in six is answered sooner, and tells of a moment before
MOMENT_S = 0.02  # later or sooner a reading on the way may be than is reckoned: networks hold answers up
MOST_DEG = 5.0  # of the way left: more tells nothing of its end
NEWER, NEWEST_S = 2.0, 0.1  # standard deviations that a reading may be newer than is known, and at most
READ_DEG, LONGER = 0.1, 1.3  # of a reading; than is reckoned an axis may take to slow down


@dataclass
class Arriving:
    """One such end. `to`: where it leads; `zooming`: the way of zoom; `certain`: it is known exactly where that leads.

    `about`: that is not known quite exactly, but so few degrees; there one look is enough if it tells of rest. `hops`:
    it may be beyond its end and return, so it is not there while it says that it moves. `turning`: the ways of pan
    and tilt, where the firmware is known to end where it should; there what is on its way, as is reckoned, is as good
    as there. `ended`: tilt does not go there, but rests from then on.
    """

    helm: Helm
    to: Pose
    zooming: Glide
    certain: bool
    about: float = 0.0
    hops: bool = False
    turning: Sequence[Glide] = ()
    ended: float = 0.0
    seen: list[Reading] = field(default_factory=list, init=False)
    arrives: float = field(default=0.0, init=False)  # when it should rest
    now: float = field(default=0.0, init=False)  # when the latest came
    when: float = field(default=0.0, init=False)  # what that tells of
    since: float = field(default=FOREVER, init=False)  # the latest reading is the same since then

    def at_rest(self, nears: float, arrives: float, now: float) -> Plan[tuple[Reading, float, bool]]:
        """Looks from about the moment on when it nears its end.

        Returns the reading, when it rests, and whether that surely shows the camera at rest.
        """
        skill, self.arrives = self.helm.skill, arrives
        late = max(skill.arrives_late, skill.timing.spread if self.helm.left <= FEW else 0.0)  # none of those too soon
        ended = self.ended + MOSTLY * skill.timing.spread if self.ended else 0.0
        yield from wait(max(now, max(ended, nears + late) - skill.read_late))
        for _ in range(LOOKS):
            reply = yield from self._look()
            if self._there or self._beside or self._still(reply.sent):
                break
            yield from wait(reply.sent + min(LONG_S, PAIR_S * (len(self.seen) - 1)))
        if self.certain and (self._there or not same(self.seen[0], self.seen[-1])):
            skill.expect_arrival(there=len(self.seen) == 1 and self._good)
        still = self._still(reply.sent)
        if still or skill.tells_rest(self.seen[-1].moving):
            return self.seen[-1], reply.received, self._rests or still
        return self._last, (yield from wait(max(reply.received, self._rested))), self._rests

    def _look(self) -> Plan[Reply]:
        reply = yield from self.helm.send(Status())
        self.seen.append(cast(Reading, reply.result))
        self.now = reply.received
        self.when = self.helm.skill.seen_at(reply)
        again = len(self.seen) > 1 and same(self.seen[-2], self.seen[-1])
        self.since = self.since if again else reply.sent
        self.helm.skill.says_late |= again and self.seen[-2].moving is True
        zoom_drive.see(self.helm.skill, self.zooming, reply)
        return reply

    @property
    def _last(self) -> Reading:
        """The reading of the rest: where one tells of a moment before that, it surely goes on to its end.

        So it does where that end is beside the goal, and the reading just before it. Whether it moves there nobody has
        told.
        """
        seen = self.seen[-1]
        if self._rests or not self._there:
            return seen
        passes = (self.helm.out(self.to) - self.helm.out(self.helm.limits.pose(seen))) & set(self._axes)
        if self.when >= self.arrives and not passes and not self.helm.skill.tells_motion(seen.moving):
            return seen
        if not self._zoomed:
            seen = zoom_drive.at_end(self.helm.skill, self.zooming, seen)
        if self.off <= THERE_DEG and not passes:
            return seen
        tilt = seen.tilt if self.ended else round(self.to[TILT], 2)
        return replace(seen, pan=round(self.to[PAN] % 360.0, 2), tilt=tilt, moving=None)

    @property
    def _good(self) -> bool:
        """Whether it was not looked at too soon, at the first look."""
        return self.off <= max(THERE_DEG, self.about) or self._on_way

    @property
    def off(self) -> float:
        """How far pan and tilt are from where they should be, degrees."""
        pose = self.helm.limits.pose(self.seen[-1])
        return max(abs(pose[axis] - self.to[axis]) for axis in self._axes)

    @property
    def _axes(self) -> tuple[int, ...]:
        return (PAN,) if self.ended else (PAN, TILT)

    @property
    def _rests(self) -> bool:
        """Whether the camera tells by itself that this is its last position."""
        return self.helm.skill.tells_end(self.seen[-1].moving)

    @property
    def _zoomed(self) -> bool:
        """Whether zoom is read where it should be."""
        return abs(self.seen[-1].zoom - self.to[ZOOM]) <= self.helm.zoom_near

    @property
    def _zooms(self) -> bool:
        """Whether zoom still turns, and will be where it should."""
        return bool(self.turning) and zoom_drive.comes(self.helm.skill, self.zooming, self.seen[-1], self.when)

    @property
    def _there(self) -> bool:
        near = self.certain and self.when > self.ended and self._near and (self._zoomed or self._zooms)
        return near and (self._rests or self._goes_there)

    @property
    def _near(self) -> bool:
        """Whether pan and tilt are where they should be, or on a last bit of way that leads there."""
        return self.off <= NEARER_DEG or self._on_way

    @property
    def _on_way(self) -> bool:
        """Whether pan and tilt still turn, and are where they should be then."""
        if self.when >= self.arrives or self.off > MOST_DEG or self.helm.skill.tells_rest(self.seen[-1].moving):
            return False
        return bool(self.turning) and all(map(self._as_reckoned, self._axes))

    def _as_reckoned(self, axis: int) -> bool:
        """Whether the latest reading shows an axis where it should be on its way."""
        place, speed = self.turning[axis].at(self.when)
        off = self.helm.limits.pose(self.seen[-1])[axis] - place
        return abs(off) <= NEARER_DEG + MOMENT_S * abs(speed)

    @property
    def _goes_there(self) -> bool:
        """Whether what may still turn surely ends there."""
        skill, moving = self.helm.skill, self.seen[-1].moving
        goes_on = skill.tells_motion(moving) and (self.hops or self.when > self.arrives + RESTED_S)
        ends = skill.tells_rest(moving) or zoom_drive.sure(skill, self.zooming, self.now)
        return not self.about and not goes_on and ends

    @property
    def _beside(self) -> bool:
        """Whether it rests where it should, and the goal is elsewhere."""
        beside = self.helm.beside(self.helm.limits.pose(self.seen[-1]))
        return beside and self.off <= self.about and self._rests

    def _still(self, sent: float) -> bool:
        """Whether readings that are the same show that it rests, with its zoom."""
        skill = self.helm.skill
        tells = skill.tells_rest(self.seen[-1].moving)
        return sent >= self.since + PAIR_S and (tells or zoom_drive.shown(skill, self.zooming, sent, self.since))

    @property
    def _rested(self) -> float:
        """When all rests, at the latest, that was seen on its last bit of way."""
        skill, left = self.helm.skill, READ_DEG + self.off
        newer = min(NEWEST_S, NEWER * skill.paces[PAN].other_doubt(READ_LATE))
        slows = max(_last(pace, left) for axis in (PAN, TILT) for pace in (skill.drive(axis), skill.paces[axis]))
        turns = min(self.when + newer, self.now) + LONGER * max(slows, self._before_it_slows)
        return max(zoom_drive.rests(skill, self.zooming), turns)

    @property
    def _before_it_slows(self) -> float:
        """How long pan and tilt take to their rest that were seen before they slow down; 0 where they do by now."""
        ways = [self.turning[axis] for axis in self._axes] if self.turning else []
        return max((way.ends - self.when for way in ways if self.when < way.brakes), default=0.0)


def _last(pace: Pace, left: float) -> float:
    """How long an axis takes to its rest that has so many degrees left, and does not get faster any more."""
    top = pace.rate(pace.speeds[-1])
    return sqrt(2 * pace.slow * left) if left < pace.braking(top) else left / top + pace.slow * top / 2
