"""Legs of pan and tilt: both axes at once, watched where that helps, ended when the reckoning says so.

Which speeds a leg has is chosen in `leg.py`; what is done after it, in `move.py`.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import cast

from services.camera.device import Reading, Refused, Status
from services.camera.plan import Plan, wait
from services.camera.ptz.course import PAN, TILT
from services.camera.ptz.helm import Helm, levels_of, sign
from services.camera.ptz.leg import DANGER, Leg, choose
from services.camera.ptz.outlook import BLIND_S, Way
from services.camera.ptz.zooming import Zooming

STOPS, STOPS_COMMANDS = 3.0, 2  # answers that a stop and a look at rest take; and commands
RUNGS = 5  # legs without a rest between them
RECKONED_DEG = 0.4
BESIDE_DEG = 0.2  # less is not worth to be put right
LOST_DEG = 1.0  # as much doubt about the place of an axis that turns is usual
ALSO_DEG, FREE_DEG = 0.15, 3.0  # so much nearer an axis is put right with the other; and so far from a stop
SHARP_DEG = 0.05  # what a reckoning leaves open, at least
ZOOM_COMMANDS = 1  # zoom's start is the end of a leg
MANY_COMMANDS = 7  # after so many, a look has to be worth more
FARTHER_DEG = 0.25  # than is reckoned an axis may be, for a look not to be had too late
ENOUGH_DEG = 0.4  # doubt about the place of an end that needs no look
PROBE_S = 0.35  # seen in the readings
PROBE_LONG_S = 1.5  # shows how fast it is, too, and is harmless the wrong way
FASTER = 2.0  # than is guessed, it may be
PROBE_LOOKS = 3
LOOKS = 1  # readings in a leg
MOST_LOOKS = 15
RISK = 3.0  # doubts of where it ends: with less room an axis may be at its stop
LOOK_PART = 1.0  # of what a late end makes of a leg: doubt below that needs no look


class Turning:
    """What pan and tilt do in one move."""

    def __init__(self, helm: Helm, zooming: Zooming) -> None:
        self.helm, self.zooming = helm, zooming

    def turn(self, axes: list[int], now: float, *, zoom: bool) -> Plan[float]:
        """One leg of pan and tilt; it ends with a stop, or with zoom in its place. Returns when that was answered."""
        unsure = [axis for axis in axes if not self.helm.skill.senses[axis].sure]
        if self.helm.zoom_ends is not None:
            now = yield from wait(self.helm.zoom_ends)
        try:
            if unsure:
                now = yield from self._probe(unsure)
                axes = [axis for axis in axes if self.helm.skill.senses[axis].sure] or axes
            return (yield from self._legs(axes, now, zoom=zoom))
        except Refused:
            if not self.helm.skill.diagonals or len(axes) < 2:
                raise
            self.helm.skill.diagonals = False
            return (yield from self.turn(axes, now, zoom=zoom))

    def _legs(self, axes: list[int], now: float, *, zoom: bool) -> Plan[float]:
        """Legs without a reading between them, as long as it is known well enough where each one ends."""
        for _ in range(RUNGS):
            now = yield from self._swing(axes, now)
            leg, turning = self._choose(axes, now, zoom=zoom)
            if any(self.helm.course.levels[:2]) and leg.cost > min(DANGER, self._rested(axes, now, zoom=zoom)):
                return (yield from self.helm.stop(now))
            if levels_of(turning) != tuple(self.helm.course.levels):
                now = (yield from self.helm.start(levels_of(turning))).received
            now = yield from self._see_through(leg, turning, now)
            others = [axis for axis in axes if axis not in leg.parts]
            ahead = others or self._goes_on(leg, now)
            if ahead:
                axes = sorted({*ahead, *self._beside(now)})
                continue
            now = yield from (self.zooming.begin() if zoom or self.zooming.misses() else self.helm.stop(now))
            zoom, axes = False, self._reckon(now)
            if not axes:
                return now
            if self.helm.zoom_ends is not None:
                now = yield from wait(max(now, self.helm.zoom_ends))
        return (yield from self.helm.stop(now)) if any(self.helm.course.levels) else now

    def _reckon(self, now: float) -> list[int]:
        """The axes that will rest beside the goal, where that is reckoned well enough to go on without a reading."""
        turned = [axis for axis in (PAN, TILT) if self.helm.course.told[axis]]
        if any(self.helm.reckoned(axis) > RECKONED_DEG for axis in turned):
            return []
        off = {axis: self._off(axis, now) for axis in turned}
        beside = [axis for axis in turned if off[axis] > self.helm.near + SHARP_DEG]
        if beside and self._free():
            return [axis for axis in turned if off[axis] > self.helm.near - ALSO_DEG]
        return beside

    def _free(self) -> bool:
        """Whether the goal is so far from all stops that a late end does no harm."""
        return all(min(self.helm.room(axis, 1.0), self.helm.room(axis, -1.0)) > FREE_DEG for axis in (PAN, TILT))

    def _beside(self, now: float) -> list[int]:
        """The axes that rest beside the goal as far as is reckoned: while the other goes on, they can be put right."""
        senses = self.helm.skill.senses
        rest = [axis for axis in (PAN, TILT) if senses[axis].sure and not self.helm.course.levels[axis]]
        return [axis for axis in rest if self._off(axis, now) > self.helm.reckoned(axis) + BESIDE_DEG]

    def _off(self, axis: int, now: float) -> float:
        """How far from the goal an axis will rest when it is ended."""
        return abs(self.helm.aim[axis] - self.helm.course.stopped(axis, now))

    def _see_through(self, leg: Leg, turning: dict[int, int], now: float) -> Plan[float]:
        """From the start of a leg to the time for its end; an axis that ends before the other is ended."""
        while not leg.joint and len(turning) > 1:
            now = yield from self.watch(leg, turning, now)
            ends = {axis: self._end(leg, axis, now) for axis in turning}
            if max(ends.values()) <= now + self.helm.skill.timing.usual:
                return now  # so late that both are to end
            del turning[min(ends, key=lambda axis: ends[axis])]
            now = (yield from self.helm.start(levels_of(turning))).received
        return (yield from self.watch(leg, turning, now))

    def _goes_on(self, leg: Leg, now: float) -> list[int]:
        """The axes that need another leg at once: it ended early for fear of a stop, and is known well enough."""
        ahead, ends = [], now + self.helm.skill.timing.usual
        for axis, part in leg.parts.items():
            spread = self.helm.skill.paces[axis].rate(part.speed) * self.helm.skill.timing.spread
            spread += self.helm.course.doubt(axis, ends)
            left = (self.helm.aim[axis] - self.helm.course.stopped(axis, ends)) * sign(self.helm.course.levels[axis])
            if left > spread + self.helm.near:
                ahead.append(axis)
        return ahead if leg.feared else []

    def _swing(self, axes: list[int], now: float) -> Plan[float]:
        """Where even the smallest step is too long, it begins the other way; the leg then turns it round."""
        levels = [0, 0, 0]
        for axis in axes if self.helm.skill.diagonals else axes[:1]:
            distance, least = self.helm.aim[axis] - self.helm.course.stopped(axis, now), self.helm.skill.least(axis)
            if least - abs(distance) > self.helm.near:
                levels[axis] = -sign(distance)
        if any(levels):
            return (yield from self.helm.start((levels[0], levels[1], levels[2]))).received
        return now

    def _rested(self, axes: list[int], now: float, *, zoom: bool) -> float:
        """What it costs to stop first: from rest any speed may be begun."""
        free = {axis: replace(way, fastest=inf) for axis, way in self._ways(axes, now).items()}
        left = self.helm.left - STOPS_COMMANDS - (ZOOM_COMMANDS if zoom else 0)
        return STOPS * self.helm.skill.timing.usual + choose(free, self.helm.skill, left=left).cost

    def _choose(self, axes: list[int], now: float, *, zoom: bool) -> tuple[Leg, dict[int, int]]:
        """The next leg and its levels, from where it stands, or from where it will be when the start takes effect."""
        ways = self._ways(axes, now)
        left = self.helm.left - (ZOOM_COMMANDS if zoom else 0)
        leg = choose(ways, self.helm.skill, left=left, runs=self._runs(ways))
        return leg, {axis: part.speed * (sign(ways[axis].distance) or 1) for axis, part in leg.parts.items()}

    def _ways(self, axes: list[int], now: float) -> dict[int, Way]:
        ways = {}
        for axis in axes:
            distance = self.helm.way(axis, now)
            room = self.helm.room(axis, distance)
            doubt = self.helm.course.doubt(axis, now) if self.helm.course.told[axis] else 0.0
            room -= 2 * max(0.0, doubt - LOST_DEG)
            ways[axis] = Way(
                distance, room, self.helm.skill.paces[axis], self.helm.near, self._begins_at(axis, distance, room)
            )
        return ways

    def _begins_at(self, axis: int, distance: float, room: float) -> float:
        """The rate that it may begin with: after a leg too short for its motor to get going, the lowest there is."""
        if self._runs_to(axis, distance):
            return self.helm.fastest(axis, abs(distance) + room)
        return 0.0 if self.helm.stuck else inf

    def _runs_to(self, axis: int, distance: float) -> bool:
        """Whether an axis turns already, the right way."""
        return self.helm.course.levels[axis] * distance > 0

    def _runs(self, ways: dict[int, Way]) -> dict[int, int]:
        """The speeds of the axes that turn already, the right way."""
        levels = self.helm.course.levels
        return {axis: abs(levels[axis]) for axis, way in ways.items() if self._runs_to(axis, way.distance)}

    def _end(self, leg: Leg, axis: int, now: float) -> float:
        """When the end of an axis has to take effect."""
        goal = self.helm.aim[axis] + leg.parts[axis].off * sign(self.helm.course.levels[axis])
        return self.helm.course.end_for(axis, goal, now)

    def _surely(self, axis: int, now: float) -> float:
        """The same where it is farther than is reckoned; of more doubt than is usual a look is to tell."""
        rate = self._rate(axis)
        ends = self.helm.safe(axis, rate, now)
        return ends - min(FARTHER_DEG, self.helm.course.doubt(axis, ends)) / rate

    def _looks_until(self, leg: Leg, left: dict[int, int], now: float) -> float:
        """Until when a look may be asked for: later, a late answer to it and then to an end lets an axis push."""
        turning, timing = [axis for axis in (PAN, TILT) if self.helm.course.levels[axis]], self.helm.skill.timing
        ends = min(self._surely(axis, now) for axis in turning)
        others = 0 if leg.joint else len(left) - 1  # are ended before it
        return ends - (2 + others) * timing.usual - timing.tail

    def _along(self, left: dict[int, int]) -> list[int]:
        """The axes that turn without being led to an end."""
        return [axis for axis in (PAN, TILT) if self.helm.course.levels[axis] and axis not in left]

    def _rate(self, axis: int) -> float:
        return self.helm.skill.paces[axis].rate(abs(self.helm.course.levels[axis]))

    def _risky(self, ends: float) -> bool:
        """Whether an axis that turns may be at its stop by then, for all that is known of its speed."""
        for axis in (PAN, TILT):
            level, (low, high) = self.helm.course.levels[axis], self.helm.limits.ranges[axis]
            at = self.helm.course.stopped(axis, ends)
            room = high - at if level > 0 else at - low
            if level and room < RISK * self.helm.course.doubt(axis, ends):
                return True
        return False

    def watch(self, leg: Leg, left: dict[int, int], now: float) -> Plan[float]:
        """Waits until the next end has to be sent; reads on the way where that makes the end more certain."""
        usual, spread = self.helm.skill.timing.usual, self.helm.skill.timing.spread
        for look in range(MOST_LOOKS):
            ends = {axis: self._end(leg, axis, now) for axis in left}
            rates = {axis: self.helm.skill.paces[axis].rate(leg.parts[axis].speed) for axis in left}
            if leg.joint:
                together = sum(ends[axis] * rates[axis] for axis in left) / sum(rates.values())
                send = (
                    min([together, *(max(ends[axis], self.helm.safe(axis, rates[axis], now)) for axis in left)]) - usual
                )
            else:
                send = min(ends.values()) - usual
            send = min([send, *(self.helm.safe(axis, self._rate(axis), now) - usual for axis in self._along(left))])
            blind, until = self.helm.course.unseen(now) + BLIND_S, self._looks_until(leg, left, now)
            risky, soon = self._risky(send + usual), send <= blind
            sure = not risky and all(self.helm.skill.paces[axis].known(leg.parts[axis].speed) for axis in left)
            if risky and until < now:
                return now  # a look that came late could leave no time for an end that did, too
            if send - now < usual + spread or (not risky and (until < now or (look >= LOOKS and soon))):
                break
            enough = ENOUGH_DEG if self.helm.commands < MANY_COMMANDS else self.helm.near
            small = {axis: max(LOOK_PART * spread * rate, enough) for axis, rate in rates.items()}
            certain = all(self.helm.course.doubt(axis, ends[axis]) < small[axis] for axis in left)
            if certain and soon:
                break
            latest = min(blind, send - usual - spread, until)
            now = yield from wait(latest if sure else min(latest, now + max(0.3, 0.5 * (latest - now))))
            reply = yield from self.helm.send(Status())
            now = reply.received
            self.helm.course.read(reply, cast(Reading, reply.result))
        return (yield from wait(max(now, send)))

    def _probe(self, axes: list[int]) -> Plan[float]:
        """Turns slowly to see which way that is; it goes on turning, unless a stop may be near."""
        levels, senses = [0, 0, 0], self.helm.skill.senses
        for axis in axes if self.helm.skill.diagonals else axes[:1]:
            levels[axis] = 1 if self.helm.aim[axis] > self.helm.course.origin[axis] else -1
        turning = [axis for axis in (PAN, TILT) if levels[axis]]
        begun = now = (yield from self.helm.start((levels[0], levels[1], levels[2]))).received
        for look in range(PROBE_LOOKS):
            now = yield from wait(now + (PROBE_S if look else self._probes_for(turning)))
            reply = yield from self.helm.send(Status())
            now = reply.received
            self.helm.course.read(reply, cast(Reading, reply.result))
            if all(senses[axis].sure for axis in turning) or not any(self.helm.course.levels):
                break
            if now + PROBE_S > begun + min(map(self._alone, turning)):
                now = yield from self.helm.stop(now)
        for axis in turning:
            if not senses[axis].sure:  # an end stop may be in its way
                self.helm.course.flip(axis)
        return now

    def _probes_for(self, axes: list[int]) -> float:
        """How long a probe turns before it is looked at: where there is time and room it tells its speed, too.

        It is the slowest one, which ends most moves, and known it does so without another look.
        """
        paces, aim, here = self.helm.skill.paces, self.helm.aim, self.helm.course.origin
        way = max(abs(aim[axis] - here[axis]) / paces[axis].rate(1) for axis in axes)
        return max(PROBE_S, min(PROBE_LONG_S, way, *map(self._alone, axes)))

    def _alone(self, axis: int) -> float:
        """How long an axis may turn at its slowest, whichever way, before a look that is in time for its stop."""
        here, (low, high) = self.helm.course.origin[axis], self.helm.limits.ranges[axis]
        timing, rate = self.helm.skill.timing, FASTER * self.helm.skill.paces[axis].guess[0]
        return min(high - here, here - low) / rate - 2 * timing.usual - timing.tail
