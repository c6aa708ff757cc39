"""One axis on its way down to a goal, from a fast speed to slower ones in flight: which one is next, and from where.

A start that takes the place of a running motion acts as late as its answer, which is known then and not before. So a
fast speed leads somewhere near, a slower one takes over, and one that is slow enough is ended. What is best is
reckoned back from the end (dynamic programming): the value of a state is the time that it will probably take from
there, that of each state with one command more left follows from those that the command leads to. A command that may
come so late that the axis would be at its stop is none. Pure; what is done with it is `homing.py`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.camera.ptz.outlook import LEG, LONG, NOISE_DEG, OVER_S, READ_ON_THE_WAY, Way
from services.camera.ptz.skill import AGAIN_PART, LATE_PART, Skill

STEP_DEG = 0.1  # of the distances that are reckoned with
BEYOND_DEG = 12.0  # as far behind the goal
FARTHER_DEG = 10.0  # before it, more than it takes to be as fast as ever
MOST = 6  # commands: with more left nothing changes
TURNS = 5  # of the slowest speeds may turn it back
MISSING = 3  # commands that may be missing
PRICE_S = 0.08  # of a command, while there are enough
MISS = 3.0  # answers: a miss is put right from rest, and so much later
DOUBTED, FEARED = 0.5, 2.0  # of the doubt about a rate: what counts usually, and where a stop is near
FEAR = 1.1  # part of how late an answer may be that is an end
NEVER_S = 60.0

Values = NDArray[np.float64]


class Ladder:
    """What one axis will take. Distances are degrees before the goal, of where it would rest; below 0: behind it.

    `back` is the way back for what has gone too far; without it, there is as much room.
    """

    def __init__(self, way: Way, skill: Skill, back: Ladder | None = None) -> None:
        self._back, self._near, self._timing = back, way.near, skill.timing
        self.rates = np.array([way.pace.rate(speed) for speed in way.pace.speeds])
        self._slows = np.array([[way.pace.change(one, to) for to in way.pace.speeds] for one in way.pace.speeds])
        self._stops = np.array([way.pace.change(speed) for speed in way.pace.speeds])
        farthest = self.rates[-1] * (FEAR * skill.timing.tail + skill.timing.usual) + FARTHER_DEG
        self.at = np.arange(-BEYOND_DEG, min(farthest, abs(way.distance) + BEYOND_DEG / 2), STEP_DEG)
        self._behind = int(np.count_nonzero(self.at < 0))  # places
        self._far = np.arange(0.0, self.at[-1] + self.rates[TURNS - 1] * skill.timing.usual + STEP_DEG, STEP_DEG)
        doubts = np.array([way.pace.doubt(speed) for speed in way.pace.speeds])
        read = np.minimum(doubts, READ_ON_THE_WAY * self.rates)
        spreads = self.rates * skill.timing.spread + DOUBTED * LONG * skill.timing.usual * read + NOISE_DEG
        self._first = np.cumsum([0, *(1 + TURNS + slower for slower in range(len(self.rates)))])  # option of a speed
        self._allowed = self._allow(way.room, FEARED * LONG * skill.timing.usual * doubts)
        self._about = _About(spreads / STEP_DEG, np.diff(self._first), len(self.at))
        self._options: list[Values] = []  # by commands left: [of each speed end it, back, or a slower one; place]
        self.best: list[Values] = []  # by commands left: [speed; place], less the time to come there
        self._follows, self._turns, self._begins = self._ahead()
        self._rests: dict[int, Values] = {}  # by commands left: from rest, at `_far`
        for left in range(-MISSING, MOST + 1):
            self._reckon(left)

    @property
    def back(self) -> Ladder:
        """The way back; it holds no reference to itself, nor does what it is made of: megabytes would stay for long."""
        return self._back or self

    def begins(self, distance: float, left: int) -> int:
        """The speed from rest; `left` commands for it and all that follow, but for the look at the end."""
        ahead = self._from_rest_at(np.array([distance]))
        return 1 + int(np.argmin(ahead.least(left - 1)))

    def covers(self, distance: float) -> bool:
        """Whether it is reckoned what to do at a distance."""
        return bool(self.at[0] <= distance <= self.at[-1])

    def acts_at(self, distance: float, speed: int, left: int) -> float:
        """The distance at which the next command should act, where none acts before the given one."""
        value = self._of(speed, left).min(axis=0) - self.at / self.rates[speed - 1]
        return float(self.at[np.where(self.at <= max(self.at[0], distance), value, NEVER_S * 2).argmin()])

    def next(self, distance: float, speed: int, left: int) -> int:
        """The speed that a command sets, where one acts at a distance; 0: it ends the motion; below 0: back."""
        place = int(np.clip(round((distance - self.at[0]) / STEP_DEG), 0, len(self.at) - 1))
        option = int(self._of(speed, left)[:, place].argmin())
        return option - TURNS if option > TURNS else -option

    def _of(self, speed: int, left: int) -> Values:
        """The options of a speed: [end it, back, or a slower one; place]."""
        return self._options[_row(left)][self._first[speed - 1] : self._first[speed]]

    def from_rest(self, distances: Values, left: int) -> Values:
        """How long it takes from rest at distances (positive) until it rests at the goal, commands at their price."""
        left = min(max(left, -MISSING), MOST + 1)
        if left not in self._rests:
            least: Values = self._begins.least(left - 1).min(axis=0)
            self._rests[left] = self._timing.usual + _price(left) + least
        found: Values = np.interp(distances, self._far, self._rests[left])
        return found

    def _allow(self, room: float, doubts: Values) -> NDArray[np.bool_]:
        """Where a speed may end, or turn back, and where a slower one may follow it. The slowest may always end."""
        tail, usual = self._timing.tail, self._timing.usual
        room -= STEP_DEG  # what comes between two places
        ends = self.at + room >= (FEAR * self.rates * tail + doubts)[:, None]
        late, then = LATE_PART * tail * self.rates, (usual + AGAIN_PART * tail) * self.rates[:, None]
        ends[0] = True
        goes_on = [may & (self.at + room >= late[speed] + then[:speed]) for speed, may in enumerate(ends)]
        return np.concatenate(
            [rows for may, on in zip(ends, goes_on, strict=True) for rows in (np.tile(may, (1 + TURNS, 1)), on)]
        )

    def _ahead(self) -> tuple[_Ahead, _Ahead, _Ahead]:
        """What is before it after a slower speed took the place of one: [(speed, other); place]; after it turned back
        beyond the goal: [(speed, other); place]; and from rest: [speed; distance].
        """
        usual = self._timing.usual
        speeds, others = np.tril_indices(len(self.rates), -1)
        reaches = self.rates[others] * np.maximum(0.0, usual - self._slows[speeds, others])
        follows = _Ahead(self, others, self.at, reaches)
        speeds, others = np.indices((len(self.rates), TURNS)).reshape(2, -1)
        reaches = self.rates[others] * np.maximum(0.0, usual - self._stops[speeds])
        turns = _Ahead(self.back, others, -self.at[: self._behind], reaches)
        return follows, turns, self._from_rest_at(self._far)

    def _from_rest_at(self, distances: Values) -> _Ahead:
        return _Ahead(self, np.arange(len(self.rates)), distances, self.rates * self._timing.usual)

    def _reckon(self, left: int) -> None:
        """One command more is left."""
        ended, turned, followed = self._ended(left), self._turned(left - 1), self._follows.least(left - 1)
        values, slower = np.empty(self._allowed.shape), 0
        for speed, first in enumerate(self._first[:-1]):
            values[first], values[first + 1 : first + 1 + TURNS] = ended, turned[speed]
            follows = followed[slower : slower + speed]
            values[first + 1 + TURNS : self._first[speed + 1]] = self._slows[speed, :speed, None] + follows
            slower += speed
        values = self._about.mean(values)
        values[~self._allowed] = NEVER_S
        self._options.append(values)
        best = np.minimum.reduceat(values, self._first[:-1]) + _price(left)
        self.best.append(np.minimum.accumulate(best - self.at / self.rates[:, None], axis=1))

    def _ended(self, left: int) -> Values:
        """Where it rests at a place: nothing more, or what it takes to put that right."""
        off, after = np.abs(self.at), left - (LEG - 1)
        again = np.where(self.at < 0, self.back.from_rest(off, after), self.from_rest(off, after))
        missed: Values = np.clip((off - self._near) / STEP_DEG + 0.5, 0.0, 1.0)
        return missed * (MISS * self._timing.usual + _price(left - 1) + again)

    def _turned(self, left: int) -> Values:
        """Where one turns back at a place: [speed; other; place]; before the goal that leads away from it."""
        found = np.empty((len(self.rates), TURNS, len(self.at)))
        found[:, :, : self._behind] = self._turns.least(left).reshape(len(self.rates), TURNS, -1)
        farther = self.at[self._behind :] + self.rates[:TURNS, None] * self._timing.usual
        found[:, :, self._behind :] = self.from_rest(farther, left)  # its start is answered after as long
        return self._stops[:, None, None] + found


class _Ahead:
    """With some speeds from distances on, until the best place for the next command, that can act after its `reach`.

    Where those are does not depend on how many commands are left, so it is reckoned once.
    """

    def __init__(self, ladder: Ladder, speeds: NDArray[np.intp], distances: Values, reaches: Values) -> None:
        self._best, count = ladder.best, len(ladder.at)
        first = distances - reaches[:, None]
        places = np.clip((first - ladder.at[0]) / STEP_DEG, 0.0, count - 1.0)
        whole = np.minimum(places.astype(int), count - 2)
        self._before, self._part = whole + (speeds * count)[:, None], places - whole
        self._takes, self._never = distances / ladder.rates[speeds, None], first < ladder.at[0]

    def least(self, left: int) -> Values:
        """How long that takes, with so many commands left: [speed; distance]."""
        if left < -MISSING:
            return np.full(self._takes.shape, NEVER_S)
        value: Values = self._takes + _between(self._best[_row(left)].ravel(), self._before, self._part)
        value[self._never] = NEVER_S
        return value


class _About:
    """The mean over where a command may act that should act at a place, so many `places` sooner or later.

    `places`: by speed; `options`: how many rows each has.
    """

    def __init__(self, places: Values, options: NDArray[np.intp], count: int) -> None:
        halves, middle = np.repeat(np.maximum(0.5, places), options)[:, None], np.arange(count) + 0.5
        self._edge = int(halves.max()) + 2
        self._over = 1.0 / (np.minimum(middle + halves, count) - np.maximum(middle - halves, 0.0))
        self._sums = np.zeros((len(halves), 2 * self._edge + count + 1))
        rows = np.arange(len(halves))[:, None] * self._sums.shape[1]
        first, last = (self._edge + 0.5 + to for to in (-halves, halves))
        self._low, self._high = (rows + begin.astype(int) + np.arange(count) for begin in (first, last))
        self._first, self._last = first % 1.0, last % 1.0

    def mean(self, values: Values) -> Values:
        """Of all rows: [option; place]."""
        begin, end = self._edge + 1, self._edge + 1 + values.shape[1]
        np.cumsum(values, axis=1, out=self._sums[:, begin:end])
        self._sums[:, end:] = self._sums[:, end - 1, None]
        sums = self._sums.ravel()
        mean: Values = _between(sums, self._high, self._last) - _between(sums, self._low, self._first)
        mean *= self._over
        return mean


def _between(values: Values, before: NDArray[np.intp], part: Values) -> Values:
    """Values between one and the next."""
    first = values.take(before, mode="clip")  # checks nothing, and there is nothing to check
    between: Values = first + part * (values[1:].take(before, mode="clip") - first)
    return between


def _row(left: int) -> int:
    return min(max(left, -MISSING), MOST) + MISSING


def _price(left: int) -> float:
    """What the command costs that is one of so many left, seconds."""
    return PRICE_S if left > 0 else OVER_S
