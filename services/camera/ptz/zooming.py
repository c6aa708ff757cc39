"""Zoom in a move: its start takes the place of what pan and tilt do, and their next start, or a stop, ends it.

It has one speed and its readings are coarse, so its place is reckoned by time. Not here: when its turn is (`move.py`).
"""

from __future__ import annotations

from typing import cast

from services.camera.device import Direction, Reading, Start, Status
from services.camera.plan import Plan, ask, wait
from services.camera.ptz.course import FOREVER, ZOOM
from services.camera.ptz.goal import Limits
from services.camera.ptz.helm import NEAR_LEVELS, Helm, sign
from services.camera.ptz.skill import Skill
from services.camera.ptz.stand import stop

WIDE_LEVELS, HELD_S = 0.05, 0.2
BEYOND = 0.8  # of what is near enough may be gone beyond the goal
LOOKS = 3  # readings while it turns
SURE = 2.0  # doubts of where it ended
AGAIN = 3  # ends without a look, at most


def widest(limits: Limits, skill: Skill, now: float) -> Plan[float]:
    """Makes sure that zoom is at its very widest, where a place in the picture can be reckoned; mostly it is.

    A move may leave it a little before the end, where its coarse reading says the same. A digital zoom has no end stop
    to be pushed against, so it is held there a moment longer than it needs.
    """
    low = limits.zoom[0]
    if skill.zoomed is None or skill.zoomed[1] <= low + WIDE_LEVELS:
        return now
    way = (skill.zoomed[1] - low) / skill.paces[ZOOM].rate(1)
    begun = yield from ask(Start(Direction.ZOOM_OUT))
    now = (yield from stop((yield from wait(begun.received + 1.5 * way + HELD_S)))).received
    skill.zoomed = (low, low)
    return now


class Zooming:
    """What zoom does in one move."""

    def __init__(self, helm: Helm) -> None:
        self.helm = helm

    def _way(self) -> float:
        """How far zoom has to go, with its sign."""
        return self.helm.goal.pose[ZOOM] - self.helm.course.rests(ZOOM)

    def settle(self, now: float) -> Plan[float]:
        """Ends zoom where that is due before a look; where it surely missed it turns again."""
        for _ in range(AGAIN):
            now = yield from self._end(now)
            if not self.misses():
                return now
            now = yield from self.begin()
        return (yield from self._end(now))

    def _end(self, now: float) -> Plan[float]:
        ends, timing = self.helm.zoom_ends, self.helm.skill.timing
        if ends is None or ends >= max(now, self.helm.settled()) + timing.usual + timing.spread:
            return now
        return (yield from self.helm.stop((yield from wait(max(now, ends)))))

    def misses(self) -> bool:
        """Whether zoom was ended too late, or too soon, as surely as that needs no reading."""
        course = self.helm.course
        if not course.told[ZOOM] or course.levels[ZOOM]:
            return False
        off = abs(self.helm.goal.pose[ZOOM] - course.rests(ZOOM))
        return off > self.helm.zoom_near + SURE * course.doubt(ZOOM, FOREVER)

    def begin(self) -> Plan[float]:
        """Starts zoom; it goes on. A way that is shorter than the smallest step begins the other way."""
        self.helm.course.meet_end(ZOOM)
        way = self._way()
        level = sign(way) or 1
        if self.helm.skill.least(ZOOM) - abs(way) > BEYOND * self.helm.zoom_near:
            yield from self.helm.start((0, 0, -level))
        now = (yield from self.helm.start((0, 0, level))).received
        self.helm.time_zoom(now)
        return now

    def see_through(self, now: float) -> Plan[float]:
        """Zoom alone turns: looks at it while that tells when to end it, and ends it."""
        timing = self.helm.skill.timing
        for _ in range(LOOKS):
            assert self.helm.zoom_ends is not None
            sure = self.helm.course.doubt(ZOOM, self.helm.zoom_ends + timing.usual) < NEAR_LEVELS
            if sure or self.helm.zoom_ends - now < timing.usual + timing.spread:
                break
            now = yield from wait(now + max(0.0, 0.4 * (self.helm.zoom_ends - now - timing.usual)))
            reply = yield from self.helm.send(Status())
            now = reply.received
            self.helm.course.read(reply, cast(Reading, reply.result))
            self.helm.time_zoom(now)
        assert self.helm.zoom_ends is not None
        return (yield from self.helm.stop((yield from wait(max(now, self.helm.zoom_ends)))))
