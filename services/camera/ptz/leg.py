"""Which speeds, for how long: the choice of the next motion of pan and tilt, by what it will probably cost.

A leg is one start, where that saves time a second start that goes on with one axis alone, and an end. The end comes
as late as an answer may: a fast leg ends somewhere near, a slow one where it should. So what counts is the time of the
leg plus that of the correction it may need. Pure; what happens then is `move.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import prod, sqrt

from services.camera.ptz.pace import HALF_CHANGE, STOP_LATE, Pace
from services.camera.ptz.skill import Skill

NEAR_DEG = 0.35  # a reading as near as that has arrived: 0.5 degree promised, its resolution and dither taken off
GOOD_DEG = 0.3  # 0.5 degree promised; the reading has its own 0.1 and dithers
NOISE_DEG = 0.1
COMMAND_S = 0.2  # what a command is worth beside the time it takes: there is a limit to them
CORRECTION_S = 2.0  # a correction takes about so many answers, since it often begins without a reading
PER_ROOT_DEG_S = 0.35  # and so much for the slow part of the way
SLOW_DEG = 16.0
FAR_S = 0.7
ALIKE = 0.3  # axes whose times differ by this part of the longer one, or less, may have one end
LONG = 4.0  # answers: a leg as long as that is read in, which leaves part of the rate in doubt
READ_ON_THE_WAY = 0.1
DANGER = 1000.0  # the cost of what should not be done
CRAWL_DEG = 0.2  # so much of a goal may be given up for the fear of a late stop


@dataclass(frozen=True)
class Way:
    """What one axis has before it: the distance with its sign, and how much room there is behind its end."""

    distance: float
    room: float
    pace: Pace


@dataclass(frozen=True)
class Part:
    """One axis of a leg: its speed, how long it turns, and how far from the goal that ends on purpose (+: beyond)."""

    speed: int
    held: float
    off: float = 0.0
    feared: bool = False  # that a late end would push against a stop


@dataclass(frozen=True)
class Leg:
    """A part for each axis that turns; `joint`: one end for all, otherwise the shorter one ends first."""

    parts: dict[int, Part]
    joint: bool = True
    cost: float = 0.0
    chance: float = 0.0  # that no correction is needed

    @property
    def feared(self) -> bool:
        """Whether it ends early for that reason."""
        return any(part.feared for part in self.parts.values())

    @property
    def held(self) -> float:
        """How long it takes, seconds."""
        return max(part.held for part in self.parts.values())


def choose(ways: dict[int, Way], skill: Skill, *, hurry: float = 1.0, slowest: bool = False) -> Leg:
    """The leg that probably costs least; `hurry` above 1 makes a correction dearer (commands run out)."""
    legs = [leg for pair in _speeds(ways, slowest) for leg in _legs(ways, pair, skill)]
    return min((_judged(leg, ways, skill, hurry) for leg in legs), key=lambda leg: leg.cost)


def held_for(pace: Pace, speed: int, distance: float) -> float:
    """How long from the effect of a start to that of its end for a distance (positive)."""
    rate, slow = pace.rate(speed), 2 * pace.other(HALF_CHANGE)
    if distance >= slow * rate * rate:
        return distance / rate - pace.other(STOP_LATE)
    return sqrt(max(0.0, distance) * slow) - pace.other(STOP_LATE)  # it never gets to its speed


def _speeds(ways: dict[int, Way], slowest: bool) -> Iterator[dict[int, int]]:
    axes = list(ways)
    choices = [way.pace.speeds[:3] if slowest else way.pace.speeds for way in ways.values()]
    for first in choices[0]:
        if len(axes) == 1:
            yield {axes[0]: first}
        else:
            yield from ({axes[0]: first, axes[1]: second} for second in choices[1])


def _part(way: Way, speed: int, skill: Skill) -> Part:
    """An axis on its own: short of the goal where a late end would push against the stop behind it."""
    rate = way.pace.rate(speed)
    held = held_for(way.pace, speed, abs(way.distance))
    fear = rate * skill.timing.tail + 2 * _doubt(way.pace, speed, held, skill)
    short = max(0.0, fear - way.room)
    if speed == 1:
        short = min(short, CRAWL_DEG)
    if short:
        held = held_for(way.pace, speed, abs(way.distance) - short)
    return Part(speed, held, -short, short > GOOD_DEG)


def _legs(ways: dict[int, Way], speeds: dict[int, int], skill: Skill) -> Iterator[Leg]:
    parts = {axis: _part(way, speeds[axis], skill) for axis, way in ways.items()}
    soonest = skill.timing.usual
    if len(parts) == 1 or not skill.diagonals:
        axis, part = next(iter(parts.items()))
        yield Leg({axis: _ending(part, max(soonest, part.held), ways[axis])})
        return
    helds = [part.held for part in parts.values()]
    if (max(helds) - min(helds)) < max(ALIKE * max(helds), soonest):
        for held in (*helds, sum(helds) / 2):
            together = max(soonest, held)
            yield Leg({axis: _ending(part, together, ways[axis]) for axis, part in parts.items()})
    first, second = sorted(parts, key=lambda axis: parts[axis].held)
    ends = max(soonest, parts[first].held)
    after = max(ends + soonest, parts[second].held)
    yield Leg({first: _ending(parts[first], ends, ways[first]), second: _ending(parts[second], after, ways[second])},
              joint=False)  # fmt: skip


def _ending(part: Part, held: float, way: Way) -> Part:
    """The same axis, held longer or shorter than it wants."""
    return Part(part.speed, held, part.off + (held - part.held) * way.pace.rate(part.speed), part.feared)


def _judged(leg: Leg, ways: dict[int, Way], skill: Skill, hurry: float) -> Leg:
    chances, misses = [], []
    for axis, part in leg.parts.items():
        way = ways[axis]
        spread = way.pace.rate(part.speed) * skill.timing.spread + _doubt(way.pace, part.speed, part.held, skill)
        beyond = part.off + way.pace.rate(part.speed) * skill.timing.tail - way.room
        if beyond > CRAWL_DEG:
            return replace(leg, cost=DANGER + beyond)  # a late end may push against a stop
        chances.append(_chance(part.off, spread + NOISE_DEG))
        misses.append(_way_s(abs(part.off) + spread / 2, way.pace))
    left = [_way_s(abs(way.distance), way.pace) for axis, way in ways.items() if axis not in leg.parts]
    correction = CORRECTION_S * skill.timing.usual + max([*misses, *left])
    chance = 0.0 if left else prod(chances)
    cost = leg.held + (1 - chance) * correction * hurry + (0.0 if leg.joint else COMMAND_S)
    return replace(leg, cost=cost, chance=chance)


def _way_s(distance: float, pace: Pace) -> float:
    """How long a correction turns, about: fast over what is far, slowly to the end."""
    another = FAR_S if distance > 2 * SLOW_DEG else 0.0  # such a way is not gone in one leg
    return PER_ROOT_DEG_S * sqrt(min(distance, SLOW_DEG)) + distance / pace.rate(pace.speeds[-1]) + another


def _doubt(pace: Pace, speed: int, held: float, skill: Skill) -> float:
    """How far a leg may go wrong for not knowing the rate; in a long one readings tell it on the way."""
    doubt, long = pace.doubt(speed), LONG * skill.timing.usual
    if held > long:
        return min(doubt, READ_ON_THE_WAY * pace.rate(speed)) * long
    return doubt * max(0.0, held)


def _chance(off: float, spread: float) -> float:
    """How probable it is to end within what is good enough, when every end within the spread is equally so."""
    low, high = max(off - spread, -GOOD_DEG), min(off + spread, GOOD_DEG)
    return max(0.0, high - low) / (2 * spread)
