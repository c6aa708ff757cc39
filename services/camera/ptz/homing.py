"""Legs on firmware that takes a position but ignores its tilt: that position ends tilt, and makes pan and zoom exact.

So only tilt is led to its goal by start and stop, first fast and then slowly, and pan goes along as far as it may.
Legs on other firmware are in `turning.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from services.camera.device import Reading, Refused
from services.camera.plan import Plan, wait
from services.camera.ptz import drive as own
from services.camera.ptz.course import PAN, TILT, ZOOM
from services.camera.ptz.driving import follow
from services.camera.ptz.helm import Helm, levels_of, sign
from services.camera.ptz.ladder import Ladder
from services.camera.ptz.leg import Leg, Part
from services.camera.ptz.outlook import Way
from services.camera.ptz.skill import AGAIN_PART, LATE_PART

ALONG = 1.0
BACK_DEG = 10.0  # it goes no farther behind its goal
LOOK = 1  # command, at the end
RETURNS = 2.5  # of the time to slow down: tilt may return to where it was when it was ended
LED_DEG, DOUBTS = 1.0, 2.0  # farther from where it was ended tilt was not, but led by the position
MOST_STEPS = 20  # hardly ever more than eight; then it is ended where it is

Watch = Callable[[Leg, dict[int, int], float], Plan[float]]


class Homing:
    """What pan and tilt do there in one move; `watch` waits for the end of a leg."""

    def __init__(self, helm: Helm, watch: Watch) -> None:
        self.helm, self.watch = helm, watch

    def home(self, axes: list[int], now: float) -> Plan[tuple[Reading, float] | None]:
        """Leads all to their goals, and looks until they rest; None where the firmware is another, or is not needed."""
        helm, sure = self.helm, all(self.helm.skill.senses[axis].sure for axis in axes)
        if not (own.pan_only(helm.skill) and sure and {PAN, ZOOM} & set(axes)):
            return None
        if helm.zoom_ends is not None:
            now = yield from wait(helm.zoom_ends)
        try:
            return (yield from self._end((yield from self._tilt(now)) if TILT in axes else now))
        except Refused:
            if not helm.skill.diagonals or TILT not in axes:
                raise
            helm.skill.diagonals = False
            return (yield from self.home(axes, now))

    def _tilt(self, now: float) -> Plan[float]:
        """Leads tilt to its goal, and pan along; returns when it has to be ended."""
        helm, speed = self.helm, 0
        if abs(self._way(TILT, now).distance) > helm.near or not helm.course.told[TILT]:
            ladder, side, speed = self._set_out(now)
        for _ in range(MOST_STEPS):
            if not speed:
                break
            leg = self._leg(ladder, speed, self._left(side, now), helm.left - LOOK - 1)
            turning = {TILT: speed * side, PAN: self._along(leg.held, now)}
            turning = {axis: level for axis, level in turning.items() if level}
            if levels_of(turning) != tuple(helm.course.levels):
                now = (yield from helm.start(levels_of(turning))).received
            leg = self._leg(ladder, speed, self._left(side, now), helm.left - LOOK)
            now = yield from self.watch(leg, {TILT: turning[TILT]}, now)
            if not ladder.covers(self._left(side, now)):
                ladder, side, speed = self._set_out(now)
                continue
            speed = ladder.next(self._left(side, now), speed, helm.left - LOOK)
            if speed < 0:
                knows = ladder.back is not ladder  # how much room there is on its way back
                ladder, side, speed = (ladder.back, -side, -speed) if knows else self._set_out(now)
        return now

    def _set_out(self, now: float) -> tuple[Ladder, int, int]:
        """From rest, or from where nothing is reckoned for: the way to the goal, its side, and the first speed."""
        way = self._way(TILT, now)
        side = sign(way.distance) or 1
        back = replace(way, distance=-BACK_DEG * side, room=self.helm.room(TILT, -side))
        ladder = Ladder(way, self.helm.skill, Ladder(back, self.helm.skill))
        return ladder, side, ladder.begins(abs(way.distance), self.helm.left - LOOK)

    def _end(self, now: float) -> Plan[tuple[Reading, float]]:
        """Pan and zoom are driven to their goal; tilt ends."""
        helm = self.helm
        pan, tilt, zoom = (helm.course.stopped(axis, now) for axis in range(3))
        request = own.to_pan((pan, tilt, zoom), helm.aim)
        begun = yield from helm.send(request)
        acted, course = begun.received, helm.course
        turns, tilts = (helm.skill.paces[axis].velocity(course.told[axis], acted) for axis in (PAN, TILT))
        ended = acted + RETURNS * helm.skill.paces[TILT].slow * abs(tilts)
        tilt, unsure = course.stopped(TILT, acted), course.doubt(TILT, acted)
        here, speeds = (course.at(PAN, acted), tilt, zoom), (turns, 0.0, 0.0)
        course.leave(here)
        helm.zoom_ends = None
        to = (helm.aim[PAN], tilt, helm.goal.pose[ZOOM])
        drive = own.Begun(own.Drive(request, to), here, begun, speeds, ended)
        reading, now, _ = yield from follow(helm, drive, certain=True, proven=True)
        if abs(reading.tilt - tilt) > LED_DEG + DOUBTS * unsure:
            own.forget_pan_only(helm.skill)
        return reading, now

    def _way(self, axis: int, now: float) -> Way:
        helm = self.helm
        distance = helm.way(axis, now)
        return Way(distance, helm.room(axis, distance), helm.skill.paces[axis], helm.near)

    def _left(self, side: int, now: float) -> float:
        """How far tilt would rest before its goal if it were ended now; below 0: behind it."""
        return side * self.helm.way(TILT, now)

    def _leg(self, ladder: Ladder, speed: int, distance: float, left: int) -> Leg:
        """With a speed from a distance until the next command should act."""
        usual, rate = self.helm.skill.timing.usual, self.helm.skill.paces[TILT].rate(speed)
        before = ladder.acts_at(distance, speed, left)
        return Leg({TILT: Part(speed, max(usual, (distance - before) / rate), -before)})

    def _along(self, held: float, now: float) -> int:
        """The level of pan meanwhile: so fast that it stays before its goal, and before the stop behind it if late.

        It goes on as it does until that is answered, which may be late, and the next answer too.
        """
        if not self.helm.skill.diagonals:
            return 0
        way, timing = self._way(PAN, now), self.helm.skill.timing
        far, level = abs(way.distance), self.helm.course.levels[PAN] * sign(way.distance)
        before = LATE_PART * timing.tail * way.pace.rate(level) if level > 0 else 0.0
        for speed in reversed(way.pace.speeds):
            rate = way.pace.rate(speed) + 2 * way.pace.doubt(speed)
            late = max(rate * (held + timing.tail), before + rate * (timing.usual + AGAIN_PART * timing.tail))
            if rate * (held + timing.usual) <= ALONG * far and late <= far + way.room:
                return speed * sign(way.distance)
        return 0
