"""How long an axis will probably take from a place to its goal, with the commands that are left for it.

A leg ends as late as an answer may: near a stop a fast one has to end early, and a slower one goes on; a leg that
misses costs another one. Each takes commands, and those are counted: with few left, what surely ends is worth the
time. Pure. Not here: both axes together, which is `leg.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import exp, inf, log, sqrt
from typing import NamedTuple

from services.camera.ptz.pace import STOP_LATE, Pace
from services.camera.ptz.skill import DITHER_DEG, Skill

NOISE_DEG = 0.05  # of a reading, beside what is learnt
SELDOM = 1.0  # of the spread of answers: so much farther beside it now and then a leg ends
EARLY = 0.5  # of what a late end would add: so much sooner a last leg ends
LAST = 5  # commands: a leg with no more left is the last one
CORRECTION_S = 2.0  # a correction takes about so many answers, since it often begins without a reading
LONG = 4.0  # answers: a leg as long as that is read in, which leaves part of the rate in doubt
READ_ON_THE_WAY = 0.1
CRAWL_DEG = 0.2  # so much of a goal may be given up for the fear of a late stop
LEG = 3  # commands: a start, an end, a reading
BLIND_S = 8.0  # nothing turns for longer without a look
OVER_S = 4.0  # what it is worth to need a command less, where there are too few
MOST_OVER = 6  # what needs more commands than that beyond those that there are is not thought through
NEVER_S = 30.0
FEW = 8  # commands: with no more left than that, each is worth more, so
RUNG_S = 2.0  # an end that comes early, for a slower leg to go on, has to save so much
FINE = 6.0  # steps of distance in each factor of e


class Rates:
    """What is known of an axis at one moment, as its `Pace` tells it: for who asks for it thousands of times."""

    def __init__(self, pace: Pace) -> None:
        self.speeds, self.slow, self.stop_late = pace.speeds, pace.slow, pace.other(STOP_LATE)
        self._rates, self._doubts = ([ask(speed) for speed in pace.speeds] for ask in (pace.rate, pace.doubt))
        self._known = [pace.known(speed) for speed in pace.speeds]

    def rate(self, speed: int) -> float:
        """Degrees per second, positive."""
        return self._rates[speed - 1]

    def doubt(self, speed: int) -> float:
        """The standard deviation of a rate."""
        return self._doubts[speed - 1]

    def known(self, speed: int) -> bool:
        """Whether a rate is known well enough to time a stop by it."""
        return self._known[speed - 1]


@dataclass(frozen=True)
class Way:
    """What one axis has before it: the distance with its sign, and how much room there is behind its end.

    `near`: so far from its goal it has arrived. `fastest`: it may begin with no higher rate, but for the lowest.
    """

    distance: float
    room: float
    pace: Pace
    near: float
    fastest: float = inf

    @cached_property
    def rates(self) -> Rates:
        """What is known of the axis by now."""
        return Rates(self.pace)


class First(NamedTuple):
    """A leg that may come first: it ends so far short of the goal, after so long, and is looked at so often."""

    speed: int
    short: float
    held: float
    looks: int


@dataclass
class Outlook:
    """The same for every leg that is thought about at one time."""

    ways: dict[int, Way]
    skill: Skill
    known: dict[tuple[int, int, int], float] = field(default_factory=dict)
    firsts: dict[tuple[int, int, bool, bool], list[First]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        every = [way.rates for way in self.ways.values()]
        learnt = all(2 * sum(map(rates.known, rates.speeds)) >= len(rates.speeds) for rates in every)
        self._thrifty = len(every) > 1 and learnt  # one axis has commands enough, and what is not known is to be seen
        self._careful = learnt  # before that it would creep

    def rung(self, left: int) -> float:
        """What the command costs that ends a leg early and goes on slower, seconds; `left` commands with it."""
        return RUNG_S if self._thrifty and left <= FEW else 0.0

    def spread(self, axis: int, speed: int, held: float, left: int) -> float:
        """How far from where it should a leg may end, or be read to; of the last one what is seldom counts, too."""
        rates = self.ways[axis].rates
        seldom = DITHER_DEG if self.skill.dithers else SELDOM * rates.rate(speed) * self.skill.timing.spread
        return spread_of(rates, speed, held, self.skill) + (seldom if left <= LEG and self._careful else 0.0)

    def short(self, axis: int, speed: int, distance: float, left: int) -> float:
        """How far before the goal a leg has to end at the latest, for fear of a late end; no more than the distance.

        That may push against a stop. Or it would be beside the goal after a last leg: that ends on the near side, as
        far as its end is there all the same when it comes in time.
        """
        way = self.ways[axis]
        short = feared(way, speed, distance, self.skill)
        if left <= LAST and not self.skill.dithers:
            rate = way.rates.rate(speed)
            sure = way.near - self.spread(axis, speed, way.near / rate, left)
            short = max(short, min(EARLY * rate * self.skill.timing.tail, sure))
        return min(short, distance)

    def seconds(self, axis: int, distance: float, left: int) -> float:
        """From rest at a distance (positive) until it is read to be there; `left` commands until then."""
        if distance <= self.ways[axis].near:
            return 0.0
        if left < -MOST_OVER:
            return NEVER_S
        step = round(FINE * log(distance))
        key = (axis, step, left)
        if key not in self.known:
            self.known[key] = NEVER_S  # until it is known better
            best = inf
            for first in self._firsts(axis, step, left):
                if min(first.held, NEVER_S) >= best:
                    break
                best = min(best, self._follows(axis, first, left))
            self.known[key] = best
        return self.known[key]

    def _firsts(self, axis: int, step: int, left: int) -> list[First]:
        """What to begin with, the quickest first: it is the same for many numbers of commands."""
        key = (axis, step, left <= LAST, left <= LEG)
        if key not in self.firsts:
            rates, distance, found = self.ways[axis].rates, exp(step / FINE), []
            for speed in rates.speeds:
                short = self.short(axis, speed, distance, left)
                held = max(self.skill.timing.usual, held_for(rates, speed, distance - short))
                looks = looks_in(held, known=rates.known(speed))
                hopeless = short >= distance and speed > 1  # it may not turn at all
                found.append(First(speed, short, inf if hopeless else held, looks))
            self.firsts[key] = sorted(found, key=lambda first: first.held)
        return self.firsts[key]

    def _follows(self, axis: int, first: First, left: int) -> float:
        speed, short, held, looks = first
        if held == inf:
            return NEVER_S
        way = self.ways[axis]
        held += OVER_S * max(0, LEG + looks - max(0, left))
        left -= looks
        if short > way.near:
            return held + self.rung(left) + self.seconds(axis, short, left - 1)
        spread = self.spread(axis, speed, held, left)
        correction = CORRECTION_S * self.skill.timing.usual + self.seconds(axis, way.near + spread / 2, left - LEG)
        return held + (1 - chance(-short, spread, way.near)) * correction


def looks_in(held: float, *, known: bool) -> int:
    """How often a leg is looked at."""
    return int(held / BLIND_S) + (not known)


def feared(way: Way, speed: int, distance: float, skill: Skill) -> float:
    """How far before the goal a leg has to end, since a late end would push against the stop behind it."""
    held = held_for(way.rates, speed, distance)
    fear = way.rates.rate(speed) * skill.timing.tail + 2 * doubt(way.rates, speed, held, skill)
    short = max(0.0, fear - way.room)
    return min(short, CRAWL_DEG) if speed == 1 else short


def held_for(rates: Rates, speed: int, distance: float) -> float:
    """How long from the effect of a start to that of its end for a distance (positive)."""
    rate, slow = rates.rate(speed), rates.slow
    if distance >= slow * rate * rate:
        return distance / rate - rates.stop_late
    return sqrt(max(0.0, distance) * slow) - rates.stop_late  # it never gets to its speed


def spread_of(rates: Rates, speed: int, held: float, skill: Skill) -> float:
    """How far from where it should a leg may end."""
    return rates.rate(speed) * skill.timing.spread + doubt(rates, speed, held, skill) + NOISE_DEG


def doubt(rates: Rates, speed: int, held: float, skill: Skill) -> float:
    """How far a leg may go wrong for not knowing the rate; in a long one readings tell it on the way."""
    doubt, long = rates.doubt(speed), LONG * skill.timing.usual
    if held > long:
        return min(doubt, READ_ON_THE_WAY * rates.rate(speed)) * long
    return doubt * max(0.0, held)


def chance(off: float, spread: float, near: float) -> float:
    """How probable it is to end within what is good enough, when every end within the spread is equally so."""
    low, high = max(off - spread, -near), min(off + spread, near)
    return max(0.0, high - low) / (2 * spread)
