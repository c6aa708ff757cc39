"""Which speeds, for how long: the choice of the next motion of pan and tilt, by what it will probably cost.

A leg is one start, where that saves time a second start that goes on with one axis alone, and an end. The end comes
as late as an answer may: a fast leg ends somewhere near, a slow one where it should. So what counts is the time of the
leg plus that of the corrections it may need (`outlook.py`). Pure; what happens then is `move.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import prod

from services.camera.ptz.outlook import (
    CORRECTION_S,
    CRAWL_DEG,
    LEG,
    Outlook,
    Way,
    chance,
    held_for,
    looks_in,
)
from services.camera.ptz.skill import Skill

COMMAND_S = 0.2  # what a command is worth beside the time it takes: there is a limit to them
ALIKE = 0.3  # axes whose times differ by this part of the longer one, or less, may have one end
DANGER = 1000.0  # the cost of what should not be done


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

    @property
    def feared(self) -> bool:
        """Whether it ends early for that reason."""
        return any(part.feared for part in self.parts.values())

    @property
    def held(self) -> float:
        """How long it takes, seconds."""
        return max(part.held for part in self.parts.values())


def choose(ways: dict[int, Way], skill: Skill, *, left: int = 12, runs: dict[int, int] | None = None) -> Leg:
    """The leg that probably costs least; `left` commands until it is read to be there; `runs`: what needs no start."""
    outlook, left = Outlook(ways, skill), max(0, left)  # what is spent is spent
    legs = sorted((leg for pair in _speeds(ways) for leg in _legs(outlook, pair, left)), key=lambda leg: leg.held)
    best = _judged(legs[0], outlook, left, runs or {})
    for leg in legs[1:]:
        if leg.held - COMMAND_S > best.cost:
            break  # this one and those behind it take longer than the best of all costs
        best = min(best, _judged(leg, outlook, left, runs or {}), key=lambda leg: leg.cost)
    return best


def _speeds(ways: dict[int, Way]) -> Iterator[dict[int, int]]:
    axes = list(ways)
    choices = [
        [one for one in way.rates.speeds if one == 1 or way.rates.rate(one) <= way.fastest] for way in ways.values()
    ]
    for first in choices[0]:
        if len(axes) == 1:
            yield {axes[0]: first}
        else:
            yield from ({axes[0]: first, axes[1]: second} for second in choices[1])


def _part(outlook: Outlook, axis: int, speed: int, left: int) -> Part:
    """An axis on its own: short of the goal where a late end would do harm."""
    way = outlook.ways[axis]
    short = outlook.short(axis, speed, abs(way.distance), left)
    return Part(speed, held_for(way.rates, speed, abs(way.distance) - short), -short, short > way.near)


def _legs(outlook: Outlook, speeds: dict[int, int], left: int) -> Iterator[Leg]:
    ways, skill = outlook.ways, outlook.skill
    parts = {axis: _part(outlook, axis, speeds[axis], left) for axis in ways}
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
    return Part(part.speed, held, part.off + (held - part.held) * way.rates.rate(part.speed), part.feared)


def _judged(leg: Leg, outlook: Outlook, left: int, runs: dict[int, int]) -> Leg:
    ways, skill, chances, misses = outlook.ways, outlook.skill, [], {}
    for axis, part in leg.parts.items():
        way = ways[axis]
        spread = outlook.spread(axis, part.speed, part.held, left)
        beyond = part.off + way.rates.rate(part.speed) * skill.timing.tail - way.room
        if beyond > (CRAWL_DEG if part.speed == 1 else 0.0):
            return replace(leg, cost=DANGER + beyond)  # a late end may push against a stop
        chances.append(chance(part.off, spread, way.near))
        if chances[-1] < 1.0:
            misses[axis] = max(way.near, abs(part.off)) + spread / 2
    misses |= {axis: abs(way.distance) for axis, way in ways.items() if axis not in leg.parts}
    known = all(ways[axis].rates.known(part.speed) for axis, part in leg.parts.items())
    running = {axis: part.speed for axis, part in leg.parts.items()} == runs
    after = left - (LEG - 1 if leg.feared else LEG) - (not leg.joint) - (len(misses) > 1)
    after += running - looks_in(leg.held, known=known)
    correction = CORRECTION_S * skill.timing.usual
    correction += max((outlook.seconds(axis, miss, after) for axis, miss in misses.items()), default=0.0)
    arrives = prod(chances) if len(leg.parts) == len(ways) else 0.0
    cost = leg.held + (1 - arrives) * correction + (0.0 if leg.joint else COMMAND_S) - (COMMAND_S if running else 0.0)
    cost += outlook.rung(left) if leg.feared else 0.0
    return replace(leg, cost=cost)
