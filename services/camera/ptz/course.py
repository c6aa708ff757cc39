"""Where the camera is while it turns: what it was told since it last stood, what was read since, what that teaches.

Pure. Not here: what to tell it next (`leg.py`, `move.py`), what is known of its motors (`pace.py`).
"""

from __future__ import annotations

from math import hypot

from services.camera.device import Reading, Reply
from services.camera.ptz.goal import Limits, Pose
from services.camera.ptz.pace import STOP_LATE, Seen, Told
from services.camera.ptz.skill import ZOOM_SLOWS_S, Skill

PAN, TILT, ZOOM = range(3)
END = 0.15  # degrees or levels: as near as that to an end of its range, an axis may have been stopped by it
READ_DEG = 0.08  # the resolution, and a little dither
COARSE = 0.3  # of a step of its reading: standard deviation
MOVED_DEG = 0.3  # no reading at rest changes as much
CLEAR_DEG = 2.0  # so far the wrong way is not a doubtful reading
FASTER = 3.0  # than is known a motor may be
FOREVER = 1e12
TIME_S = 0.01  # what is left of the timing of a command or a reading when all that is learnt is taken off


class Course:
    """From rest at a pose; levels are speeds with the sign of the reading's change."""

    def __init__(self, limits: Limits, skill: Skill, pose: Pose) -> None:
        self.limits = limits
        self.skill = skill
        self.origin = pose
        self.told: tuple[list[Told], ...] = ([], [], [])
        self.shift = [0.0, 0.0, 0.0]  # what readings say beyond the model
        self.levels = [0, 0, 0]
        self.read_at = 0.0  # when the latest reading came
        self._read: list[Seen | None] = [None, None, None]  # the latest, since it last stood
        self._zoom_at_rest: tuple[float, int] | None = None  # how it was read there, after so many commands

    def tell(self, reply: Reply, levels: tuple[int, int, int]) -> None:
        """A command was answered: from then on it turns like this."""
        self.skill.paces[ZOOM].borrow(self.skill.paces[PAN])
        late = self.skill.timing.late(reply)
        for axis, level in enumerate(levels):
            if level != self.levels[axis]:
                self.told[axis].append(Told(reply.received, late, level))
                self.levels[axis] = level

    def stop_again(self, reply: Reply) -> None:
        """The stop before had no effect: what it was to end went on until this one."""
        last = max((told[-1].at for told in self.told if told and not told[-1].level), default=0.0)
        for axis, told in enumerate(self.told):
            if told and not told[-1].level and told[-1].at == last:
                told[-1] = Told(reply.received, self.skill.timing.late(reply), 0)
                self.shift[axis] = 0.0

    def at(self, axis: int, when: float) -> float:
        """Where an axis is at a time."""
        return self.origin[axis] + self.skill.paces[axis].travel(self.told[axis], when) + self.shift[axis]

    def stopped(self, axis: int, when: float) -> float:
        """Where an axis comes to rest when a command that ends it takes effect at a time."""
        told = [*self.told[axis], Told(when, 0.0, 0)]
        pace = self.skill.paces[axis]
        return self.origin[axis] + pace.travel(told, when + 60.0) + self.shift[axis]

    def rests(self, axis: int) -> float:
        """Where an axis that was ended comes to rest: within its range, however long it was turned."""
        low, high = self.limits.ranges[axis]
        return min(high, max(low, self.stopped(axis, FOREVER)))

    def meet_end(self, axis: int) -> None:
        """The same, for what it is told next."""
        self.shift[axis] += self.rests(axis) - self.stopped(axis, FOREVER)

    def end_for(self, axis: int, goal: float, now: float) -> float:
        """When a command that ends an axis has to take effect for it to rest at the goal; not before now."""
        level = self.levels[axis]
        rate = self.skill.paces[axis].rate(abs(level)) * (1 if level > 0 else -1)
        when = now
        for _ in range(3):
            when = max(now, when + (goal - self.stopped(axis, when)) / rate)
        return when

    def unseen(self, now: float) -> float:
        """Since when an axis turns without a reading that shows it; now, where none does."""
        begun = [told[0].at for told, level in zip(self.told, self.levels, strict=True) if level]
        return max(self.read_at, min(begun, default=now))

    def rests_at(self) -> float:
        """When the axes that were ended stand; those that turn are not asked."""
        ends = [0.0]
        for axis, told in enumerate(self.told):
            pace = self.skill.paces[axis]
            if told and told[-1].level == 0:
                slowing = max(ZOOM_SLOWS_S if axis == ZOOM else 0.0, pace.change(self.ended_from(axis)))
                ends.append(told[-1].at + max(0.0, pace.other(STOP_LATE)) + slowing)
        return max(ends)

    def ended_from(self, axis: int) -> int:
        """The speed that an axis was ended from; 0: none."""
        return abs(self.told[axis][-2].level) if len(self.told[axis]) > 1 else 0

    def doubt(self, axis: int, when: float) -> float:
        """How far from where it is reckoned it may be: no farther than at the last reading, and on the way since."""
        model, read = self.model_doubt(axis, when), self._read[axis]
        if read is None:
            return model
        since = self.skill.paces[axis].apart(self.told[axis], read, Seen(when, 0.0, 0.0, 0.0, acts=True))
        return min(model, hypot(read.noise, since))

    def model_doubt(self, axis: int, when: float) -> float:
        """The same by what is known of its motor alone."""
        return self.skill.paces[axis].expected(self.told[axis], Seen(when, 0.0, 0.0, 0.0))[1]

    def read(self, reply: Reply, reading: Reading) -> None:
        """Takes in a reading."""
        self.read_at = reply.received
        late = self.skill.timing.late(reply)
        pose = self.limits.pose(reading)
        for axis in (PAN, TILT, ZOOM):
            told = self.told[axis]
            if told and not self.skill.senses[axis].sure:
                self._see_sense(axis, pose[axis])
            if not told or not self.skill.senses[axis].sure:
                continue
            if axis != ZOOM:
                self._doubt_sense(axis, reply, late, pose[axis])
            self._learn(axis, reply, late, pose[axis])

    def _learn(self, axis: int, reply: Reply, late: float, value: float) -> None:
        pace, told = self.skill.paces[axis], self.told[axis]
        low, high = self.limits.ranges[axis]
        seen_at = pace.seen_at(reply.sent, late)
        speed = abs(pace.velocity(told, seen_at))
        changes = [abs(one.level) for one in told]
        timing = TIME_S * max((pace.rate(level) for level in changes if level), default=0.0)
        noise = READ_DEG + (COARSE * self.skill.zoom_step if axis == ZOOM else 0.0)
        seen = Seen(reply.sent, late, value - self.origin[axis], (noise**2 + (TIME_S * speed) ** 2 + timing**2) ** 0.5)
        inside = low + END < value < high - END
        farther = abs(seen.travel) > abs(pace.expected(told, seen)[0])
        again = axis == ZOOM and self._again(value, rests=not speed)
        if not again and (inside or farther):  # at an end it may have been stopped, having come at least so far
            pace.learn(told, seen)
            if axis != ZOOM:
                self.skill.paces[TILT if axis == PAN else PAN].agree(pace)
        if axis != ZOOM or not speed:
            model = self.origin[axis] + pace.travel(told, pace.seen_at(reply.sent, late))
            own, read = timing**2 + 0.05**2, noise**2 + (TIME_S * 2 * speed) ** 2
            self.shift[axis] = (value - model) * own / (own + read)
            self._read[axis] = seen._replace(noise=read**0.5)

    def _again(self, value: float, *, rests: bool) -> bool:
        """Whether zoom was read the same at this rest: its coarse reading once more tells nothing new."""
        before, self._zoom_at_rest = self._zoom_at_rest, (value, len(self.told[ZOOM])) if rests else None
        return rests and before == self._zoom_at_rest

    def _see_sense(self, axis: int, value: float) -> None:
        """Which way an axis turns is clear as soon as it has moved."""
        moved = value - self.origin[axis]
        if abs(moved) >= MOVED_DEG:
            self.skill.senses[axis].sure = True
            if moved * next(one.level for one in reversed(self.told[axis]) if one.level) < 0:
                self.flip(axis)

    def _doubt_sense(self, axis: int, reply: Reply, late: float, value: float) -> None:
        """An axis that goes clearly the other way: which way it turns was wrong, or changed.

        Also one that stays where it is at an end of its way, though it should have left that. Not one that turns the
        right way since the last look, or is farther off at the first than it can have come: a stop before had no
        effect, and it has come from elsewhere.
        """
        pace, told, before = self.skill.paces[axis], self.told[axis], self._read[axis]
        expected = pace.travel(told, pace.seen_at(reply.sent, late))
        moved = value - self.origin[axis]
        if len({one.level > 0 for one in told if one.level}) != 1 or abs(expected) <= CLEAR_DEG:
            return
        low, high = self.limits.ranges[axis]
        held = abs(moved) < MOVED_DEG and (value < low + END if expected > 0 else value > high - END)
        way = abs(moved) < FASTER * abs(expected) if before is None else (moved - before.travel) * expected <= 0
        if held or (expected * moved < 0 and abs(moved) > CLEAR_DEG and way):
            self.flip(axis)

    def flip(self, axis: int) -> None:
        """It turns the other way than was thought."""
        self.skill.senses[axis].sign *= -1
        self.told[axis][:] = [one._replace(level=-one.level) for one in self.told[axis]]
        self.levels[axis] = -self.levels[axis]

    def leave(self, pose: Pose) -> None:
        """The firmware drives on by itself: what was told is over, and where it leads will be read."""
        for told in self.told:
            told.clear()
        self._read = [None, None, None]
        self.levels = [0, 0, 0]
        self.origin = pose

    def stand(self, pose: Pose) -> None:
        """Pan and tilt were read at rest: they start anew from there, and zoom too unless it turns."""
        for axis in (PAN, TILT, ZOOM):
            if axis == ZOOM and self.levels[ZOOM]:
                continue
            if self.told[axis]:
                self.skill.paces[axis].age()
            self.told[axis].clear()
            self._read[axis] = None
            self.shift[axis] = 0.0
        zoom = self.origin[ZOOM] if self.levels[ZOOM] else pose[ZOOM]
        self.origin = (pose[PAN], pose[TILT], zoom)
