"""The regulator as a plan: from readings and the learnt pace to the next request.

Each turn: compare, start the fastest speed that can still be stopped in time, stop where the prediction says, read
until two readings are equal, learn from what happened. Not here: what is learnt (`pace.py`), the ranges
(`goal.py`), coming to rest (`stand.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

from services.camera.plan import Plan, ask, wait
from services.camera.ptz.goal import Goal, Limits, Pose
from services.camera.ptz.pace import Skill
from services.camera.ptz.stand import GAP_S, settle, stop
from services.camera.requests import Direction, Reading, Refused, Reply, Start, Status
from services.errors import DeviceError

TOLERANCE: Pose = (0.4, 0.4, 0.5)  # 0.5 degree promised, 0.1 is the readings' own
SLOP_S = 0.25  # a stop over HTTP can be this late: near an end the motion aims short of the goal
SHORTEST_S = 0.15  # a wait shorter than this is worth a slower speed
PROBE_SPEED, PROBE_S = 3, 0.2  # seen in the readings, and harmless the wrong way
MOST_MOTIONS = 25
STUCK = 4  # motions without effect
PAN, TILT, ZOOM = range(3)
DIRECTIONS = {direction.value: direction for direction in Direction}


@dataclass(frozen=True)
class Motion:
    """One start, wait and stop: a speed for each axis that turns (0: does not), the sign of its travel, the wait."""

    speeds: tuple[int, int, int]
    signs: tuple[int, int, int]
    held: float


@dataclass(frozen=True)
class Arrival:
    """Where a move ended: verified, at rest."""

    reading: Reading
    at: float
    clamped: bool = False


def goto(goal: Goal, limits: Limits, skill: Skill, until: float, *, near: Reading | None = None) -> Plan[Arrival]:
    """Moves there and returns when it rests within tolerance; DeviceError when that does not come to be.

    `until` is the deadline; `near` is a reading of a moment ago, which saves one.
    """
    reading, now = yield from settle(near)
    stuck = 0
    for _ in range(MOST_MOTIONS):
        before = limits.pose(reading)
        axes = _axes(before, goal.pose)
        if not axes:
            return Arrival(reading, now, goal.clamped)
        if now > until or stuck >= STUCK:
            raise DeviceError(_failed(goal, reading, "in time" if now > until else "the camera does not turn"))
        motion = choose(before, goal.pose, axes, limits, skill)
        try:
            turned = yield from turn(motion, goal.pose, limits, skill)
        except Refused:
            if not skill.diagonals or sum(speed > 0 for speed in motion.speeds) < 2:
                raise
            skill.diagonals = False
            continue
        reading, now = yield from settle()
        moved = learn(motion, turned, before, limits.pose(reading), skill)
        stuck = 0 if moved else stuck + 1
    raise DeviceError(_failed(goal, reading, f"with {MOST_MOTIONS} motions"))


def _failed(goal: Goal, reading: Reading, why: str) -> str:
    pan, tilt, zoom = goal.pose
    return (
        f"did not arrive at pan {pan % 360:.1f} tilt {tilt:.1f} zoom {zoom:g}, {why}; "
        f"it is at pan {reading.pan:.1f} tilt {reading.tilt:.1f} zoom {reading.zoom:g}"
    )


def _axes(pose: Pose, goal: Pose) -> list[int]:
    """The axes that still have to turn; zoom comes last, since some firmware turns slower when zoomed in."""
    off = [axis for axis in (PAN, TILT, ZOOM) if abs(goal[axis] - pose[axis]) > TOLERANCE[axis]]
    return [axis for axis in off if axis != ZOOM] or off


def choose(pose: Pose, goal: Pose, axes: list[int], limits: Limits, skill: Skill) -> Motion:
    """The next motion: both axes at once where that is possible, a probe where the direction is not known yet."""
    unsure = [axis for axis in axes if not skill.senses[axis].sure]
    if unsure:
        return _probe(pose, goal, unsure[0], skill)
    if not skill.diagonals:
        axes = axes[:1]
    plans = {axis: _one(pose, goal, axis, limits, skill) for axis in axes}
    longest = max(held for _, held in plans.values())
    speeds, signs = [0, 0, 0], [0, 0, 0]
    for axis, (speed, held) in plans.items():
        distance = goal[axis] - pose[axis]
        speeds[axis] = speed if held == longest else _slower(axis, abs(distance), speed, longest, skill)
        signs[axis] = 1 if distance > 0 else -1
    held = min(skill.paces[axis].held(speeds[axis], abs(goal[axis] - pose[axis])) for axis in axes)
    return _motion(speeds, signs, max(0.0, min(held, longest)))


def _motion(speeds: list[int], signs: list[int], held: float) -> Motion:
    return Motion((speeds[0], speeds[1], speeds[2]), (signs[0], signs[1], signs[2]), held)


def _probe(pose: Pose, goal: Pose, axis: int, skill: Skill) -> Motion:
    speeds, signs = [0, 0, 0], [0, 0, 0]
    speeds[axis] = min(PROBE_SPEED, len(skill.paces[axis].guess))
    signs[axis] = 1 if goal[axis] > pose[axis] else -1
    return _motion(speeds, signs, PROBE_S)


def _one(pose: Pose, goal: Pose, axis: int, limits: Limits, skill: Skill) -> tuple[int, float]:
    """Speed and wait for one axis: the fastest whose wait is long enough, short of the goal where a stop is near."""
    pace = skill.paces[axis]
    distance = goal[axis] - pose[axis]
    for speed in reversed(pace.speeds):
        short = _short(axis, goal[axis], distance, pace.rate(speed), limits)
        held = pace.held(speed, abs(distance) - short)
        if held >= SHORTEST_S:
            return speed, held
    return 1, max(0.0, pace.held(1, abs(distance)))


def _short(axis: int, goal: float, distance: float, rate: float, limits: Limits) -> float:
    """How far before the goal to aim, so that a late stop does not push against the end behind it."""
    low, high = limits.ranges[axis]
    room = (high - goal) if distance > 0 else (goal - low)
    return max(0.0, rate * SLOP_S - max(0.0, room))


def _slower(axis: int, distance: float, most: int, held: float, skill: Skill) -> int:
    """The speed, at most `most`, with which this axis needs about as long as the other."""
    pace = skill.paces[axis]
    return min(range(1, most + 1), key=lambda speed: abs(pace.held(speed, distance) - held))


def start_of(motion: Motion, skill: Skill) -> Start:
    """The request that starts a motion."""
    told = tuple(sign * skill.senses[axis].sign if motion.speeds[axis] else 0 for axis, sign in enumerate(motion.signs))
    pan, tilt, zoom = motion.speeds
    return Start(DIRECTIONS[(told[0], told[1], told[2])], pan or tilt or zoom, tilt or None)


@dataclass(frozen=True)
class Turned:
    """How a motion went: how long it was held, and the last pose and rate read in it with their time."""

    held: float
    stopped: float
    seen: tuple[Pose, float] | None = None


def turn(motion: Motion, goal: Pose, limits: Limits, skill: Skill) -> Plan[Turned]:
    """Starts, watches a long motion, and stops it where the prediction says."""
    started = yield from ask(start_of(motion, skill))
    stop_at, seen = yield from _watch(motion, goal, limits, skill, started)
    now = yield from wait(stop_at)
    stopped = yield from stop(now)
    return Turned(max(0.0, stopped.sent - started.received), stopped.sent, seen)


def _watch(
    motion: Motion, goal: Pose, limits: Limits, skill: Skill, started: Reply
) -> Plan[tuple[float, tuple[Pose, float] | None]]:
    """Reads while there is time for it: the true rate tells better when to stop. Returns when, and the last pose."""
    now, stop_at = started.received, started.received + motion.held
    slowest = max(0.1, now - started.sent)
    last: tuple[Pose, float] | None = None
    while stop_at - now > 2.5 * slowest + GAP_S:
        yield from wait(now + GAP_S)
        reply = yield from ask(Status())
        now, slowest = reply.received, max(slowest, reply.received - reply.sent)
        seen = limits.pose(cast(Reading, reply.result)), (reply.sent + reply.received) / 2
        if last is not None and now - started.received > 1.0:
            if _stands(motion, last[0], seen[0]):
                return now, None
            stop_at = _learn_rates(motion, goal, limits, skill, last, seen)
        last = seen
    return max(stop_at, now), last


def _stands(motion: Motion, last: Pose, seen: Pose) -> bool:
    return all(abs(seen[axis] - last[axis]) < 0.05 for axis in range(3) if motion.speeds[axis])


def _learn_rates(
    motion: Motion, goal: Pose, limits: Limits, skill: Skill, last: tuple[Pose, float], seen: tuple[Pose, float]
) -> float:
    """Learns the rate of each axis that turns; returns when the first of them has to be stopped."""
    stops = []
    for axis, speed in enumerate(motion.speeds):
        if not speed:
            continue
        rate = motion.signs[axis] * (seen[0][axis] - last[0][axis]) / (seen[1] - last[1])
        left = motion.signs[axis] * (goal[axis] - seen[0][axis])
        left -= _short(axis, goal[axis], motion.signs[axis], rate, limits)
        if rate > 0.1 * skill.paces[axis].rate(speed):
            skill.paces[axis].learn_rate(speed, rate)
            stops.append(seen[1] + left / rate - skill.lag)
        else:
            stops.append(seen[1])  # the wrong way, or against something: end it
    return min(stops)


def learn(motion: Motion, turned: Turned, before: Pose, after: Pose, skill: Skill) -> bool:
    """Takes in what a motion did; whether any axis that should turn did."""
    moved = False
    for axis, speed in enumerate(motion.speeds):
        if not speed:
            continue
        travel = motion.signs[axis] * (after[axis] - before[axis])
        sense, sign = skill.senses[axis], 1 if travel > 0 else -1
        if abs(travel) <= (0.15 if sense.sure else 0.05):
            sense.sign = sense.sign if sense.sure else -sense.sign  # nothing: at an end stop, try the other way
            continue
        moved = True
        if sign < 0 and (not sense.sure or travel < -1.0):
            sense.sign, sense.sure = -sense.sign, not sense.sure
        elif sign > 0:
            sense.sure = True
            skill.paces[axis].learn(speed, turned.held, travel)
            _learn_lag(motion, turned, axis, after, skill)
    return moved


def _learn_lag(motion: Motion, turned: Turned, axis: int, after: Pose, skill: Skill) -> None:
    """What turned on after the last reading, beyond the time until the stop was sent, is the lag."""
    if turned.seen is not None:
        pose, at = turned.seen
        rate = skill.paces[axis].rate(motion.speeds[axis])
        skill.learn_lag(motion.signs[axis] * (after[axis] - pose[axis]) / rate - (turned.stopped - at))
