"""A goal by the relative form: each hop goes on by a part of the picture, all axes at once, and ends by itself.

A hop may begin while the last one, or a start at full speed, still turns. Where it leads depends on where the camera
was just then: that is known when it was answered, not before, so the last hop of a long way leaves some degrees to
one more that begins at rest. A late hop pushes nothing against a stop. Zoom turns by hops only, so where it takes
long they begin sooner. A look on the last part of the way tells whether to go on from where that leads. Not here: the
start at full speed before hops (`rush.py`), how an axis glides (`glide.py`), where it will rest (`landing.py`), how
large the scale is (`planes.py`), what hops teach (`scale.py`).
"""

from __future__ import annotations

from dataclasses import replace
from math import copysign, hypot
from typing import cast

from services.camera.device import MoveOver, Reading, Refused, Reply, Status
from services.camera.plan import Plan, wait
from services.camera.ptz import landing, scale, zoom_drive
from services.camera.ptz.arriving import Arriving
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.glide import Glide
from services.camera.ptz.goal import Pose
from services.camera.ptz.helm import RESTS_S, Helm
from services.camera.ptz.pace import ACT_PART
from services.camera.ptz.planes import Planes, Scale
from services.camera.ptz.rush import rush
from services.camera.ptz.scale import Hop, Turned
from services.camera.ptz.skill import RelativeForm

MOST = 6  # hops without a rest
TURNS = 4  # of them in one move
MIDDLE = 0.95  # of the whole is gone in one hop at most
SPARE_LEVELS = 1.0  # beyond an end of zoom's range, so that it is met exactly
ABOUT_DEG = 3.0  # a hop that ends so far from where it should is followed by another at once
EXACT_DEG = 0.4  # what ends so near needs one look that is as reckoned, where none tells of rest
MIDST_DEG = 6.0  # what is farther off was out of reach, and not the fault of a late answer
SHARP_DEG = 0.05  # what the reckoning leaves open, at least
FAR_DEG = 360.0  # no hop goes farther
TRY_DEG = 12.0  # a first hop, whose scale is a guess
SHORT, KNOWN = 0.5, 0.4  # spreads: a hop in flight ends before its goal, where no more of the doubt is left
FEW, LAST = 2, 1  # commands, for a hop from rest and a look; for a look, which has to be one at rest then


class Hopping:
    """The hops of one move."""

    def __init__(self, helm: Helm) -> None:
        self.helm = helm
        self.form: RelativeForm = "Position"  # the one of the latest hops
        self.turns = 0
        self.zooms = False  # whether zoom is to change
        self.glides: list[Glide] = []
        self.zooming = Glide(0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0)  # zoom's since it last stood, or turned round
        self.hops: list[Hop] = []
        self.foretold = 0.0  # degrees: doubt of where the hops began, where that was foretold

    def hop(self, now: float) -> Plan[tuple[Reading, float] | None]:
        """Goes to the goal, or near; None where the firmware has no such form, or it did not help."""
        if not all(one.sure for one in self.helm.skill.senses):
            return None
        here = self.helm.course.origin
        self.zooms = abs(self.helm.aim[ZOOM] - here[ZOOM]) > self.helm.zoom_near / 2
        for form in self._forms():
            self.form = form
            if self.turns >= TURNS or (self.helm.left < FEW and self._honoured != "yes"):
                break
            if not self.helm.beside(here) and not self._takes_zoom():
                continue  # zoom alone is missing, and hops leave it
            try:
                return (yield from self._go(now))
            except Refused:
                self.helm.skill.honours[form] = "no"
        return None

    def _forms(self) -> list[RelativeForm]:
        """Those that it honours; where none is known, those that it may."""
        honours = {form: self.helm.skill.honours.get(form, "unknown") for form in self.helm.skill.scales}
        how = "yes" if "yes" in honours.values() else "unknown"
        return [form for form in honours if honours[form] == how]

    def _go(self, now: float) -> Plan[tuple[Reading, float]]:
        """A chain of hops, or one that is a try, to rest."""
        certain = self._honoured == "yes"
        self.turns += 1
        self.glides, self.hops, self.foretold = [], [], 0.0
        now = yield from (self._chain(now) if certain else self._send(now, TRY_DEG))
        landed = (yield from self._land(now)) if certain else None
        if landed is not None:
            return landed
        pan, tilt, zoom = self.glides
        to = (pan.goal, tilt.goal, zoom.goal)
        arrives = max(self._ends(), zoom.ends)
        self.helm.rests = arrives
        about = 0.0 if self._exact(to) else ABOUT_DEG
        end = Arriving(self.helm, to, self.zooming, certain, about, hops=True)
        reading, now, _ = yield from end.at_rest(arrives, arrives, now)
        if reading is end.seen[-1]:
            self._learn(reading, to, certain=certain)
        else:  # one on its last bit of way teaches nothing
            self.helm.skill.lead_zoom(reading.zoom, to[ZOOM])
        self.helm.stand(reading)
        return reading, now

    def _learn(self, reading: Reading, to: Pose, *, certain: bool) -> None:
        """What a reading at rest tells of the hops that should lead `to` there."""
        if certain:
            known = landing.doubts(self.helm.skill, self.form, self.hops, self.foretold)
            rest = [landing.read(*one) for one in zip(self.helm.limits.pose(reading), known, strict=False)]
            landing.stray(scale.strays(self._scale, self.hops), self.glides, known, rest)
        scale.learn(self.helm.skill, self.form, self.hops, to, self.helm.limits, reading)

    def _exact(self, to: Pose) -> bool:
        """Whether it surely ends at the goal, so that a look on its last bit of way is enough."""
        off = max(abs(self.helm.aim[axis] - to[axis]) for axis in (PAN, TILT))
        skill, unsure = self.helm.skill, scale.unsure(self._scale, self.hops)
        return not skill.says_late and off + 2 * unsure <= EXACT_DEG and scale.timed(skill, self.hops)

    def _land(self, now: float) -> Plan[tuple[Reading, float] | None]:
        """Looks near the end of the way, and hops on where that leads beside the goal; None: it is not sure where."""
        helm = self.helm
        while helm.left > LAST:
            doubts = landing.doubts(helm.skill, self.form, self.hops, self.foretold)
            look = landing.sight(helm.skill, self.glides, doubts)
            if look is None:
                break
            yield from wait(max(now, look))
            reply = yield from helm.send(Status())
            reading, now = cast(Reading, reply.result), reply.received
            zoom_drive.see(helm.skill, self.zooming, reply)
            arrives = max(self._ends(), self.glides[ZOOM].ends)
            ends = landing.ends(helm.skill, self.glides, doubts, reply, helm.limits.pose(reading))
            landing.stray(scale.strays(self._scale, self.hops), self.glides, doubts, ends)
            if zoom_drive.comes(helm.skill, self.zooming, reading, helm.skill.seen_at(reply)):
                reading = zoom_drive.at_end(helm.skill, self.zooming, reading)
            zoomed = abs(helm.goal.pose[ZOOM] - reading.zoom) <= helm.zoom_near or not self._takes_zoom()
            sure = zoomed and zoom_drive.sure(helm.skill, self.zooming, now)
            verdict = landing.judge(helm.aim, helm.near, ends) if sure else "unsure"
            if verdict == "unsure":
                break
            landing.learn(helm.skill, self.form, self.hops, self.glides, helm.limits, reading, ends)
            reading = landing.at_end(reading, ends)
            helm.stand(reading)
            helm.rests = arrives
            if verdict == "there" or helm.left < FEW or not helm.beside(helm.limits.pose(reading)):
                rests = max(arrives + landing.late(doubts), zoom_drive.rests(helm.skill, self.zooming))
                return reading, (yield from wait(max(now, rests + RESTS_S)))
            began = min(arrives, now)
            for axis, end in enumerate(ends):
                self.glides[axis] = replace(self.glides[axis], began=began, place=end.at, speed=0.0, goal=end.at)
            self.hops, self.foretold = [], max(end.doubt for end in ends)
            now = yield from self._send((yield from wait(max(now, arrives - helm.skill.timing.usual))))
        return None

    @property
    def _honoured(self) -> str:
        return self.helm.skill.honours.get(self.form, "unknown")

    @property
    def _scale(self) -> Scale:
        return self.helm.skill.scales[self.form]

    @property
    def _planes(self) -> Planes:
        return self._scale.planes

    def _chain(self, now: float) -> Plan[float]:
        """To where the goal can be reached, there in flight, and from rest what is left then."""
        timing, zoom = self.helm.skill.timing, self.helm.course.origin[ZOOM]
        reaches = (self._reach(PAN, zoom), self._reach(TILT, zoom))
        now = yield from rush(self.helm, reaches, now, zooms=self._takes_zoom())
        for _ in range(MOST):
            now = yield from self._send(now)
            off = {axis: abs(self.helm.aim[axis] - self.glides[axis].goal) for axis in (PAN, TILT)}
            worst = max(off, key=lambda axis: off[axis])
            if off[worst] <= self.helm.near - SHARP_DEG or self.helm.left < FEW:
                break
            far = off[worst] > MIDST_DEG
            follows = self.glides[worst].brakes - timing.spread if far else self._ends()
            now = yield from wait(max(now, follows - timing.usual))
        return now

    def _takes_zoom(self) -> bool:
        return self.zooms and self.helm.skill.honours.get(scale.zooms(self.form)) != "no"

    def _reach(self, axis: int, zoom: float) -> float:
        """How far one hop goes at most, degrees."""
        return self._planes.angle(axis, MIDDLE, zoom)

    def _send(self, now: float, most: float = FAR_DEG) -> Plan[float]:
        """One hop towards the goal, from where it will be when that takes effect."""
        helm = self.helm
        there, speeds = zip(*(self._at(axis, now + helm.skill.timing.usual) for axis in range(3)), strict=True)
        parts = []
        for axis in (PAN, TILT):
            reach = min(most, self._reach(axis, there[ZOOM]))
            short = SHORT * speeds[axis] * helm.skill.timing.spread if self._scale.flying.share < KNOWN else 0.0
            way = min(reach, max(-reach, helm.aim[axis] - short - there[axis]))
            parts.append(helm.skill.senses[axis].sign * self._planes.part(axis, way, there[ZOOM]))
        right, down = (min(1.0, max(-1.0, part)) for part in parts)
        zooms = self._takes_zoom() and most > TRY_DEG
        request = MoveOver(right, down, self._zoom_aim() - there[ZOOM] if zooms else 0.0, self.form)
        self._glide(request, (yield from helm.send(request)))
        return self.glides[0].answered

    def _zoom_aim(self) -> float:
        low, high = self.helm.limits.zoom
        aim = self.helm.aim[ZOOM]
        return aim - SPARE_LEVELS if aim == low else aim + SPARE_LEVELS if aim == high else aim

    def _glide(self, request: MoveOver, reply: Reply) -> None:
        """Where it leads, now that it is known from where."""
        helm = self.helm
        late = helm.skill.timing.late(reply)
        acts = helm.skill.paces[PAN]
        acted = reply.received - acts.other(ACT_PART) * late
        moment = hypot(scale.TIME_S, acts.other_doubt(ACT_PART) * late)
        poses = [self._at(axis, acted) for axis in range(3)]
        pan, tilt = (
            part * sense.sign for part, sense in zip((request.right, request.down), helm.skill.senses, strict=False)
        )
        right, down = (self._planes.angle(axis, part, poses[ZOOM][0]) for axis, part in enumerate((pan, tilt)))
        turned = None if self.glides else self._turned(acted, reply, late)
        rested = max(0.0, acted - self._ends()) if self.glides else 0.0
        self.glides = []
        for axis, (way, (place, speed)) in enumerate(zip((right, down, request.zoom), poses, strict=True)):
            low, high = helm.limits.ranges[axis]
            pace = helm.skill.drive(ZOOM) if axis == ZOOM else helm.skill.paces[axis]
            top = pace.rate(pace.speeds[-1])
            goal = min(high, max(low, place + way))
            self.glides.append(Glide(acted, place, speed, goal, top, 1 / pace.slow, reply.received))
        begun, speeds = ((pan, tilt, zoom) for pan, tilt, zoom in zip(*poses, strict=True))
        tops = (self.glides[PAN].top, self.glides[TILT].top, self.glides[ZOOM].top)
        zoomed = copysign(acted - self.zooming.began, speeds[ZOOM]) if speeds[ZOOM] else 0.0
        unsure = abs(zoomed) * helm.skill.drive(ZOOM).doubt(1)
        self.hops.append(
            Hop(begun, (pan, tilt), (right, down, request.zoom), speeds, tops, turned, rested, zoomed, unsure, moment)
        )
        zoom = self.glides[ZOOM]
        goes_on = zoomed * (zoom.goal - zoom.place) > 0
        self.zooming = replace(self.zooming, goal=zoom.goal) if goes_on else zoom.back
        helm.course.leave(begun)

    def _turned(self, acted: float, reply: Reply, late: float) -> tuple[Turned, Turned]:
        """What pan and tilt did until the first hop acted."""
        course = self.helm.course
        pan, tilt = (
            Turned(
                tuple(told),
                course.origin[axis] + course.shift[axis],
                course.model_doubt(axis, acted),
                reply.received,
                late,
            )
            for axis, told in enumerate(course.told[:ZOOM])
        )
        return pan, tilt

    def _at(self, axis: int, when: float) -> tuple[float, float]:
        """Place and speed of an axis."""
        if self.glides:
            return self.glides[axis].at(when)
        course = self.helm.course
        return course.at(axis, when), self.helm.skill.paces[axis].velocity(course.told[axis], when)

    def _ends(self) -> float:
        """When pan and tilt rest."""
        return max(glide.ends for glide in self.glides[:ZOOM])
