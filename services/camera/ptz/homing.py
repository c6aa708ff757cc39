"""Legs on firmware that takes a position but ignores its tilt: that position ends tilt, and makes pan and zoom exact.

So only tilt is led to its goal by start and stop, first fast and then slowly, and pan goes along as far as it may.
Legs on other firmware are in `turning.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf

from services.camera.plan import Plan
from services.camera.ptz import drive as own
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.helm import Helm, levels_of, sign
from services.camera.ptz.leg import Leg, choose
from services.camera.ptz.outlook import Way, spread_of

RUNGS = 4  # legs of tilt, one after the other
ALONG = 1.0
SHORT = 0.5
FEW = 5  # commands; with as many left it is ended
AGAIN, FEAR = 0.2, 1.1  # two late answers, one after the other: one leg ends sooner, and the next is slower
LIKELY = 0.5  # a leg that ends so probably at the goal is the last one

Watch = Callable[[Leg, dict[int, int], float], Plan[float]]


class Homing:
    """What pan and tilt do there in one move; `watch` waits for the end of a leg."""

    def __init__(self, helm: Helm, watch: Watch) -> None:
        self.helm, self.watch = helm, watch

    def tilt(self, now: float) -> Plan[float]:
        """Leads tilt to its goal, and pan along; returns when the position was answered that ends both."""
        helm = self.helm
        for _ in range(RUNGS):
            way = self._way(TILT, now)
            if helm.course.told[TILT] and abs(way.distance) <= helm.near:
                break
            leg = self._leg(way)
            turning = {TILT: leg.parts[TILT].speed * (sign(way.distance) or 1), PAN: self._along(leg.held, now)}
            turning = {axis: level for axis, level in turning.items() if level}
            if levels_of(turning) != tuple(helm.course.levels):
                now = (yield from helm.start(levels_of(turning))).received
            now = yield from self.watch(leg, {TILT: turning[TILT]}, now)
            if helm.left < FEW or (leg.chance >= LIKELY and self._meets(now)):
                break
        return (yield from self.home(now))

    def home(self, now: float) -> Plan[float]:
        """Pan and zoom are driven to their goal; tilt ends."""
        helm = self.helm
        pan, tilt, zoom = (helm.course.stopped(axis, now) for axis in range(3))
        here = (pan, tilt, zoom)
        way = own.to_pan(here, (helm.aim[PAN], here[TILT], helm.goal.pose[ZOOM]))
        now = (yield from helm.send(way.request)).received
        here = (pan, helm.course.stopped(TILT, now), zoom)
        helm.course.leave(here)
        helm.quiet = now + own.longest(helm.skill, here, way.to)
        return now

    def _meets(self, now: float) -> bool:
        """Whether tilt will rest at its goal when it is ended now; after a late answer it may be beyond."""
        ends = now + self.helm.skill.timing.usual
        return abs(self.helm.aim[TILT] - self.helm.course.stopped(TILT, ends)) <= self.helm.near

    def _way(self, axis: int, now: float) -> Way:
        helm = self.helm
        distance = helm.aim[axis] - helm.course.stopped(axis, now + helm.skill.timing.usual)
        low, high = helm.limits.ranges[axis]
        room = high - helm.aim[axis] if distance > 0 else helm.aim[axis] - low
        fastest = inf
        if helm.course.levels[axis] * distance > 0:  # it turns on until a start takes effect
            fastest = helm.fastest(axis, abs(distance) + room, AGAIN)
            room -= helm.skill.paces[axis].rate(abs(helm.course.levels[axis])) * helm.skill.timing.spread
        return Way(distance, room, helm.skill.paces[axis], helm.near, fastest, FEAR)

    def _leg(self, way: Way) -> Leg:
        """A leg that will hardly end at the goal ends before it for sure: a slower one goes on from there."""
        helm = self.helm
        leg = choose({TILT: way}, helm.skill, left=helm.left)
        part = leg.parts[TILT]
        if leg.chance >= LIKELY or part.feared:
            return leg
        spread = min(abs(way.distance) / 2, SHORT * spread_of(way.pace, part.speed, part.held, helm.skill))
        held = max(helm.skill.timing.usual, part.held - spread / way.pace.rate(part.speed))
        return replace(leg, parts={TILT: replace(part, held=held, off=part.off - spread)})

    def _along(self, held: float, now: float) -> int:
        """The level of pan meanwhile: so fast that it stays before its goal, and before the stop behind it if late."""
        if not self.helm.skill.diagonals:
            return 0
        way, timing = self._way(PAN, now), self.helm.skill.timing
        for speed in reversed(way.pace.speeds):
            rate = way.pace.rate(speed) + 2 * way.pace.doubt(speed)
            far = abs(way.distance)
            if rate * (held + timing.usual) <= ALONG * far and rate * (held + timing.tail) <= far + way.room:
                return speed * sign(way.distance)
        return 0
