"""At the helm of one move: sends, keeps the course, comes to rest. Not here: where to turn, how fast, and when."""

from __future__ import annotations

from dataclasses import replace
from math import hypot
from typing import cast

from services.camera.device import Direction, Reading, Reply, Request, Start, Status
from services.camera.lanes import same
from services.camera.plan import Plan, ask, wait
from services.camera.ptz.course import FOREVER, PAN, TILT, ZOOM, Course
from services.camera.ptz.goal import EDGE_DEG, Goal, Limits, Pose
from services.camera.ptz.pace import ACT_PART, HALF_CHANGE, READ_LATE, READ_PART, STOP_LATE
from services.camera.ptz.skill import LATE_PART, Skill
from services.camera.ptz.stand import LOST
from services.camera.ptz.stand import stop as until_confirmed
from services.errors import DeviceError

NEAR_LEVELS = 0.5
ODD_DEG = 0.4  # a reading farther from what was reckoned may not be of a camera at rest
STRAY_DEG = 2.0  # a reading farther from that, of a camera that says it moves, is none of the last bit of its way
LATE_DOUBT_S = 0.15  # with more doubt about the age of readings, two equal ones
LONGEST_DOUBT_S = 0.35
PAIR_S = 0.25  # between two readings that are compared
UNSURE_LEVELS = 0.1  # it is not said to stand at the very end, which it may just have missed
WEIGHED_DEG_S, NOISE_DEG = 8.0, 0.1  # slower motions are always reckoned well
LAST_DEG, LAST_DOUBT = 0.5, 0.5  # the last bit of way, of which a reading tells the rest; a share of it is doubted
RESTS_S = 0.02  # after it is reckoned to rest, where the camera does not tell it
LONGER = 0.4  # of the time that it brakes, that may be more: what few readings teach of it is surer than true
SLACK = 2.0  # such doubts of the moment that a reading tells of
SURPRISES = 0.2  # of what was known before is replaced by each rest
DIRECTIONS = {direction.value: direction for direction in Direction}
PROMISED = 12  # commands
COMMANDS = PROMISED - 2  # a move should need no more: an answer may come late
Levels = tuple[int, int, int]


class Helm:
    """One move. `commands` counts what was sent, `stuck` legs without effect; `zoom_ends`: when to end a zoom.

    After an answer later than `until`, seconds since 1970, nothing but a stop is sent for it.
    """

    def __init__(self, goal: Goal, limits: Limits, skill: Skill, until: float) -> None:
        self.goal, self.limits, self.skill, self.until = goal, limits, skill, until
        ends = zip(goal.pose[:ZOOM], limits.ranges, strict=False)
        pan, tilt = (min(high - EDGE_DEG, max(low + EDGE_DEG, value)) for value, (low, high) in ends)
        self.aim: Pose = (pan, tilt, goal.pose[ZOOM])
        self.commands = self.stuck = 0
        self._heard = 0.0
        self.turned: set[int] = {PAN, TILT}  # since it was last judged where they rest
        self.zoom_ends: float | None = None
        self.foretold = False  # whether where it stands was
        self.rests = 0.0  # when it came to rest, as is reckoned
        self.course = Course(limits, skill, self.aim)

    @property
    def left(self) -> int:
        """How many commands are left."""
        return COMMANDS - self.commands

    @property
    def near(self) -> float:
        """As near as that a reading of pan or tilt has arrived, degrees."""
        return max(self.skill.near, self.goal.near)

    def pose(self, reading: Reading) -> Pose:
        """A reading as a pose, with what is known better of zoom."""
        pan, tilt, zoom = self.limits.pose(reading)
        return pan, tilt, self.skill.zoom_truth(zoom)

    def beside(self, pose: Pose) -> bool:
        """Whether this is not the goal yet."""
        return bool(self.out(pose))

    def out(self, pose: Pose) -> set[int]:
        """Which of pan and tilt are not where they should be."""
        return {axis for axis in (PAN, TILT) if abs(self.goal.pose[axis] - pose[axis]) > self.near}

    def stand(self, reading: Reading) -> None:
        """It was read at rest."""
        self.skill.see_zoom(reading.zoom, self.limits.zoom)
        self.course.stand(self.pose(reading))

    def send(self, request: Request) -> Plan[Reply]:
        """Sends, counts, and takes in how long it took; DeviceError after the deadline."""
        if self._heard > self.until:
            raise DeviceError(f"did not arrive at {self.goal}, in time")
        self.commands += 1
        reply = yield from ask(request)
        self._heard = reply.received
        self.skill.timed(reply.received - reply.sent)
        if isinstance(reply.result, Reading):
            self.skill.hear(reply.result.moving)
        return reply

    def start(self, levels: Levels) -> Plan[Reply]:
        """Begins a motion, in place of the one that runs."""
        told = tuple(sign(level) * self.skill.senses[axis].sign for axis, level in enumerate(levels))
        pan, tilt, zoom = map(abs, levels)
        request = Start(DIRECTIONS[(told[0], told[1], told[2])], pan or tilt or zoom, tilt or None)
        reply = yield from self.send(request)
        self.course.tell(reply, levels)
        self.turned |= {axis for axis in (PAN, TILT) if levels[axis]}
        if not levels[ZOOM]:
            self.zoom_ends = None
        return reply

    def stop(self, now: float) -> Plan[float]:
        """Ends all motion; returns when that was answered."""
        self.commands += 1
        reply = yield from until_confirmed(now)
        self.skill.timed(reply.received - reply.sent)
        self.course.tell(reply, (0, 0, 0))
        self.zoom_ends = None
        return reply.received

    def rest(self, now: float) -> Plan[tuple[Reading, float]]:
        """The reading of pan and tilt at rest, and of zoom when it does not turn."""
        now = yield from wait(max(now, self.settled()))
        self.rests, known = self.course.rests_at(), self.skill.motors()
        reply, seen, reading = yield from self._look()
        since, unlike = reply.sent, 0
        while reading is None or (self.zoom_ends is None and (self._late_doubted() or self._odd(reading))):
            yield from wait(reply.sent + PAIR_S)
            before = seen
            reply, seen, reading = yield from self._look()
            if not same(before, seen):
                since, unlike = reply.sent, unlike + 1
                if unlike % LOST == 0:  # the stop had no effect, and what was read since teaches nothing
                    again = yield from until_confirmed(reply.received, every=unlike > LOST)
                    self.skill.forget(known)
                    self.course.stop_again(again)
            if reply.sent >= since + PAIR_S and self.zoom_ends is None:
                self.skill.always_moving = seen.moving is True
                reading = seen
                break
        self.foretold = reading is not seen
        rests = 0.0 if self.skill.tells_rest(seen.moving) else self.course.rests_at() + self._longer() + RESTS_S
        if self.zoom_ends is not None:
            self.time_zoom(reply.received)
        self._place_zoom(reading)
        self.stand(reading)
        return reading, (yield from wait(max(reply.received, rests)))

    def _look(self) -> Plan[tuple[Reply, Reading, Reading | None]]:
        """A look where it should rest: the answer, its reading, and that of the rest; None: not known by this one."""
        reply = yield from self.send(Status())
        seen = cast(Reading, reply.result)
        rest = None if self._runs_on(seen) else self._resting(reply, seen)
        self._weigh(rest or seen)
        self._see_still(rest or seen)
        self.course.read(reply, seen)
        return reply, seen, rest

    def _resting(self, reply: Reply, seen: Reading) -> Reading | None:
        """The reading of the rest that follows from one of the last bit of way, or is one; None: it may be neither."""
        pace, late = self.skill.paces[PAN], self.skill.timing.late(reply)
        when, moves = pace.seen_at(reply.sent, late), self.skill.tells_motion(seen.moving) and self.zoom_ends is None
        slack = self._unsure(late)
        if seen.moving is False or any(self.course.levels[:2]) or when > self.course.rests_at() + slack:
            return None if moves else seen
        pose, left = self.limits.pose(seen), [0.0, 0.0]
        for axis in (PAN, TILT):
            if self.course.told[axis]:
                at = self.course.at(axis, when)
                left[axis] = self.course.stopped(axis, FOREVER) - at
                doubt = LAST_DOUBT * abs(left[axis]) + abs(at - self.course.at(axis, when - slack))
                off = abs(self.goal.pose[axis] - pose[axis] - left[axis])
                if abs(left[axis]) > LAST_DEG or off <= self.near < off + doubt:
                    return None
        there = round((seen.pan + left[PAN]) % 360.0, 2), round(seen.tilt + left[TILT], 2)
        return replace(seen, pan=there[PAN], tilt=there[TILT], moving=None)

    def _weigh(self, reading: Reading) -> None:
        """How well the place of rest was reckoned, in seconds of the fastest motion before it."""
        pose = self.limits.pose(reading)
        for axis in (PAN, TILT):
            fastest = self._fastest(axis)
            if fastest > WEIGHED_DEG_S:
                wrong = max(0.0, abs(pose[axis] - self.course.stopped(axis, FOREVER)) - NOISE_DEG) / fastest
                self.skill.surprise += SURPRISES * (wrong - self.skill.surprise)

    def _see_still(self, reading: Reading) -> None:
        """An axis that was not turned shows how well readings repeat."""
        pose = self.limits.pose(reading)
        for axis in (PAN, TILT):
            if not self.course.told[axis] and not self.foretold:
                self.skill.see_still(pose[axis] - self.course.origin[axis])

    def reckoned(self, axis: int) -> float:
        """How far off the reckoned place of rest of an axis may be, degrees."""
        return 2 * self.skill.surprise * self._fastest(axis)

    def way(self, axis: int, now: float) -> float:
        """How far from its goal an axis would rest if its end were sent now, with its sign."""
        return self.aim[axis] - self.course.stopped(axis, now + self.skill.timing.usual)

    def room(self, axis: int, way: float) -> float:
        """How much room there is behind its goal, in the direction in which it is gone to."""
        low, high = self.limits.ranges[axis]
        return high - self.aim[axis] if way > 0 else self.aim[axis] - low

    def fastest(self, axis: int, left: float) -> float:
        """The rate with which an axis that turns may go on, so many degrees before its stop.

        The answer to that may come late, and only then it can be ended.
        """
        timing, rate = self.skill.timing, self.skill.paces[axis].rate(abs(self.course.levels[axis]))
        return (left - LATE_PART * timing.tail * rate) / timing.usual

    def safe(self, axis: int, rate: float, now: float) -> float:
        """Until when an axis that turns may go on, as is known by now: later, a late answer lets it push."""
        low, high = self.limits.ranges[axis]
        before = rate * self.skill.timing.tail
        return self.course.end_for(axis, high - before if self.course.levels[axis] > 0 else low + before, now)

    def _fastest(self, axis: int) -> float:
        """The highest speed that an axis was told since it last stood."""
        told, pace = self.course.told[axis], self.skill.paces[axis]
        return max((pace.rate(abs(one.level)) for one in told if one.level), default=0.0)

    def _runs_on(self, seen: Reading) -> bool:
        """Whether it says that it moves, and is far from where it should rest: the stop may have had no effect."""
        return self.skill.tells_motion(seen.moving) and self.zoom_ends is None and self._off(seen) > STRAY_DEG

    def _late_doubted(self) -> bool:
        """Whether the age of readings is not known well."""
        return self.skill.paces[PAN].other_doubt(READ_LATE) > LATE_DOUBT_S

    def _odd(self, reading: Reading) -> bool:
        """Whether a reading at rest is not what was reckoned: it may not be at rest."""
        return self._off(reading) > ODD_DEG

    def _off(self, reading: Reading) -> float:
        """How far a reading is from where it should rest, degrees."""
        pose, turned = self.limits.pose(reading), [axis for axis in (PAN, TILT) if self.course.told[axis]]
        return max((abs(pose[axis] - self.course.stopped(axis, FOREVER)) for axis in turned), default=0.0)

    def _unsure(self, late: float) -> float:
        """How far off it may be when it rests, over the moment that a look so late tells of, seconds."""
        ended = max((told[-1].late for told in self.course.told[:ZOOM] if told), key=abs, default=0.0)
        parts = (READ_LATE, 1.0), (READ_PART, late), (ACT_PART, ended), (STOP_LATE, 1.0)
        doubts = (self.skill.paces[PAN].other_doubt(which) * part for which, part in parts)
        return SLACK * hypot(*doubts, self._slows())

    def _slows(self) -> float:
        """How much longer it may take to slow down than is reckoned, seconds."""
        return max(self.skill.paces[axis].other_doubt(HALF_CHANGE) * self._fastest(axis) for axis in (PAN, TILT))

    def _longer(self) -> float:
        """How much longer than is reckoned it may turn where nothing tells when it rests, seconds."""
        brakes = (self.skill.paces[axis].change(self.course.ended_from(axis)) for axis in (PAN, TILT))
        return self._unsure(0.0) + LONGER * max(brakes)

    def settled(self) -> float:
        """When a reading has to be asked for that shows everything at rest."""
        doubt = self.skill.paces[PAN].other_doubt(READ_LATE) + self._slows()
        return self.course.rests_at() - self.skill.read_late + min(LONGEST_DOUBT_S, doubt)

    def _place_zoom(self, reading: Reading) -> None:
        """Where zoom truly stands: what was reckoned, as far as its reading and its range allow; as before, at rest."""
        turned = any(one.level for one in self.course.told[ZOOM])
        stayed = not turned and self.skill.zoomed is not None and self.skill.zoomed[0] == reading.zoom
        if self.zoom_ends is None and not stayed:
            half = max(0.1, self.skill.zoom_grid / 2)
            low, high = self.limits.zoom
            reckoned = self.course.stopped(ZOOM, FOREVER)
            off = min(high - UNSURE_LEVELS, max(low + UNSURE_LEVELS, reckoned)) - reading.zoom
            self.skill.zoomed = (reading.zoom, reading.zoom + (off if abs(off) <= half else sign(off) * half / 2))

    @property
    def zoom_near(self) -> float:
        """As near as that zoom has arrived: its coarse reading is the goal's then."""
        return max(NEAR_LEVELS, self.skill.zoom_grid / 2)

    def time_zoom(self, now: float) -> None:
        """When zoom has to be ended, by what is known of its rate; a late end does no harm at the end of its range."""
        self.zoom_ends = max(now, self.course.end_for(ZOOM, self.goal.pose[ZOOM], now) - self.skill.timing.usual)


def levels_of(turning: dict[int, int]) -> Levels:
    """The levels of all axes."""
    return turning.get(PAN, 0), turning.get(TILT, 0), turning.get(ZOOM, 0)


def sign(value: float) -> int:
    """-1, 0 or 1."""
    return (value > 0) - (value < 0)
