"""At the helm of one move: sends, keeps the course, comes to rest. Not here: where to turn, how fast, and when."""

from __future__ import annotations

from typing import cast

from services.camera.device import same
from services.camera.plan import Plan, ask, wait
from services.camera.ptz.course import PAN, TILT, ZOOM, Course
from services.camera.ptz.goal import EDGE_DEG, Goal, Limits, Pose
from services.camera.ptz.pace import HALF_CHANGE, READ_LATE, READ_PART
from services.camera.ptz.skill import Skill
from services.camera.ptz.stand import stop as until_confirmed
from services.camera.requests import Direction, Reading, Reply, Request, Start, Status

NEAR_LEVELS = 0.5
END_LEVELS = 0.3  # zoom ends so far from the ends of its range
ODD_DEG = 0.4  # a reading farther from what was reckoned may not be of a camera at rest
LATE_DOUBT_S = 0.15  # the age of readings is not known well: two equal ones, then
LONGEST_DOUBT_S = 0.35
PAIR_S = 0.25  # between two readings that are compared
UNSURE_LEVELS = 0.1  # it is not said to stand at the very end, which it may just have missed
FOREVER = 1e12
WEIGHED_DEG_S, NOISE_DEG = 8.0, 0.1  # slower motions are always reckoned well
LATE_PART = 0.85  # of how late an answer may be, where a motion that it begins is ended only after it
SURPRISES = 0.2  # of what was known before is replaced by each rest
DIRECTIONS = {direction.value: direction for direction in Direction}
PROMISED = 12  # commands
COMMANDS = PROMISED - 2  # a move should need no more: an answer may come late
Levels = tuple[int, int, int]


class Helm:
    """One move. `commands` counts what was sent; `zoom_ends` is when to send what ends zoom, while it turns."""

    def __init__(self, goal: Goal, limits: Limits, skill: Skill) -> None:
        self.goal, self.limits, self.skill = goal, limits, skill
        ends = zip(goal.pose[:ZOOM], limits.ranges, strict=False)
        pan, tilt = (min(high - EDGE_DEG, max(low + EDGE_DEG, value)) for value, (low, high) in ends)
        self.aim: Pose = (pan, tilt, goal.pose[ZOOM])
        self.commands = 0
        self.turned: set[int] = {PAN, TILT}  # since it was last judged where they rest
        self.zoom_ends: float | None = None
        self.quiet = 0.0  # until then the firmware drives by itself
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
        return any(abs(self.goal.pose[axis] - pose[axis]) > self.near for axis in (PAN, TILT))

    def stand(self, reading: Reading) -> None:
        """It was read at rest."""
        self.skill.see_zoom(reading.zoom, self.limits.zoom)
        self.course.stand(self.pose(reading))

    def send(self, request: Request) -> Plan[Reply]:
        """Sends, counts, and takes in how long it took."""
        self.commands += 1
        reply = yield from ask(request)
        self.skill.timed(reply.received - reply.sent)
        if isinstance(reply.result, Reading) and reply.result.moving:
            self.skill.says_moving = True
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
        usual = self.skill.timing.usual
        pace, settled = self.skill.paces[PAN], self._settled()
        if self.zoom_ends is not None and self.zoom_ends < max(now, settled) + usual + self.skill.timing.spread:
            now = yield from self.stop((yield from wait(max(now, self.zoom_ends))))
            settled = self._settled()
        now = yield from wait(max(now, settled))
        self.rests = max(self.quiet, self.course.rests_at())
        reply = yield from self.send(Status())
        reading = cast(Reading, reply.result)
        self._weigh(reading)
        self._see_still(reading)
        self.course.read(reply, reading)
        while self.zoom_ends is None and (
            pace.other_doubt(READ_LATE) > LATE_DOUBT_S or self._odd(reading) or self._moves(reading)
        ):
            yield from wait(reply.sent + PAIR_S)
            again = yield from self.send(Status())
            before, reading, reply = reading, cast(Reading, again.result), again
            if same(before, reading):
                self.skill.always_moving = reading.moving is True
                break
        if self.zoom_ends is not None:
            self.time_zoom(reply.received)
        self._place_zoom(reading)
        self.stand(reading)
        return reading, reply.received

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
            if not self.course.told[axis] and not self.quiet:
                self.skill.see_still(pose[axis] - self.course.origin[axis])

    def reckoned(self, axis: int) -> float:
        """How far off the reckoned place of rest of an axis may be, degrees."""
        return 2 * self.skill.surprise * self._fastest(axis)

    def fastest(self, axis: int, left: float) -> float:
        """The rate with which an axis that turns may go on, so many degrees before its stop.

        The answer to that may come late, and only then it can be ended.
        """
        timing, rate = self.skill.timing, self.skill.paces[axis].rate(abs(self.course.levels[axis]))
        return (left - LATE_PART * timing.tail * rate) / timing.usual

    def _fastest(self, axis: int) -> float:
        """The highest speed that an axis was told since it last stood."""
        told, pace = self.course.told[axis], self.skill.paces[axis]
        return max((pace.rate(abs(one.level)) for one in told if one.level), default=0.0)

    def _odd(self, reading: Reading) -> bool:
        """Whether a reading at rest is not what was reckoned: it may not be at rest."""
        pose = self.limits.pose(reading)
        return any(
            abs(pose[axis] - self.course.stopped(axis, FOREVER)) > ODD_DEG
            for axis in (PAN, TILT)
            if self.course.told[axis]
        )

    def _moves(self, reading: Reading) -> bool:
        """Whether the camera says that it moves; some firmware says so for ever."""
        return reading.moving is True and not self.skill.always_moving

    def _settled(self) -> float:
        """When a reading has to be asked for that shows everything at rest."""
        pace = self.skill.paces[PAN]
        doubt = 2 * pace.other_doubt(READ_LATE) + pace.other(READ_PART) * self.skill.timing.spread
        doubt += max(self.skill.paces[axis].other_doubt(HALF_CHANGE) * self._fastest(axis) for axis in (PAN, TILT))
        return max(self.quiet, self.course.rests_at()) - self.skill.read_late + min(LONGEST_DOUBT_S, doubt)

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

    def least(self, axis: int) -> float:
        """The smallest step: a start, and its end as soon as it was answered."""
        return self.skill.paces[axis].rate(1) * self.skill.timing.usual

    def zoom_aim(self) -> float:
        """Where zoom should end: a late end does no harm there, and its coarse reading is the goal's."""
        low, high = self.limits.zoom
        return min(high - END_LEVELS, max(low + END_LEVELS, self.goal.pose[ZOOM]))

    @property
    def zoom_near(self) -> float:
        """As near as that zoom has arrived: its coarse reading is the goal's then."""
        return max(NEAR_LEVELS, self.skill.zoom_grid / 2)

    def time_zoom(self, now: float) -> None:
        """When zoom has to be ended, by what is known of its rate."""
        self.zoom_ends = max(now, self.course.end_for(ZOOM, self.zoom_aim(), now) - self.skill.timing.usual)


def levels_of(turning: dict[int, int]) -> Levels:
    """The levels of all axes."""
    return turning.get(PAN, 0), turning.get(TILT, 0), turning.get(ZOOM, 0)


def sign(value: float) -> int:
    """-1, 0 or 1."""
    return (value > 0) - (value < 0)
