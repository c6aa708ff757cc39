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
from services.camera.ptz.skill import LATE_PART, Skill

STEP_DEG = 0.1  # of the distances that are reckoned with
BEYOND_DEG = 12.0  # as far behind the goal
FARTHER_DEG = 10.0  # before it, more than it takes to be as fast as ever
MOST = 6  # commands: with more left nothing changes
TURNS = 5  # of the slowest speeds may turn it back
MISSING = 3  # commands that may be missing
PRICE_S = 0.08  # of a command, while there are enough
MISS = 3.0  # answers: a miss is put right from rest, and so much later
DOUBTED, FEARED = 0.5, 2.0  # of the doubt about a rate: what counts usually, and where a stop is near
AGAIN, FEAR = 0.5, 1.1  # parts of how late an answer may be: a second one in a row; and the one that is an end
NEVER_S = 60.0

Values = NDArray[np.float64]


class Ladder:
    """What one axis will take. Distances are degrees before the goal, of where it would rest; below 0: behind it.

    `back` is the way back for what has gone too far; without it, there is as much room.
    """

    def __init__(self, way: Way, skill: Skill, back: Ladder | None = None) -> None:
        self.back, self._near, self._timing = back or self, way.near, skill.timing
        self._rates = np.array([way.pace.rate(speed) for speed in way.pace.speeds])
        self._slows = np.array([[way.pace.change(one, to) for to in way.pace.speeds] for one in way.pace.speeds])
        self._stops = np.array([way.pace.change(speed) for speed in way.pace.speeds])
        farthest = self._rates[-1] * (FEAR * skill.timing.tail + skill.timing.usual) + FARTHER_DEG
        self._at = np.arange(-BEYOND_DEG, min(farthest, abs(way.distance) + BEYOND_DEG / 2), STEP_DEG)
        self._behind = int(np.count_nonzero(self._at < 0))  # places
        doubts = np.array([way.pace.doubt(speed) for speed in way.pace.speeds])
        read = np.minimum(doubts, READ_ON_THE_WAY * self._rates)
        self._spreads = self._rates * skill.timing.spread + DOUBTED * LONG * skill.timing.usual * read + NOISE_DEG
        self._ends, self._goes_on = self._allowed(way.room, FEARED * LONG * skill.timing.usual * doubts)
        self._options: list[Values] = []  # by commands left: [speed; end it, a speed, or back; place]
        self._best: list[Values] = []  # by commands left: [speed; place], less the time to come there
        for left in range(-MISSING, MOST + 1):
            self._reckon(left)

    def begins(self, distance: float, left: int) -> int:
        """The speed from rest; `left` commands for it and all that follow, but for the look at the end."""
        return 1 + int(np.argmin(self._begun(np.array([distance]), left - 1)))

    def covers(self, distance: float) -> bool:
        """Whether it is reckoned what to do at a distance."""
        return bool(self._at[0] <= distance <= self._at[-1])

    def acts_at(self, distance: float, speed: int, left: int) -> float:
        """The distance at which the next command should act, where none acts before the given one."""
        value = np.min(self._options[_row(left)][speed - 1], axis=0) - self._at / self._rates[speed - 1]
        return float(self._at[np.where(self._at <= max(self._at[0], distance), value, NEVER_S * 2).argmin()])

    def next(self, distance: float, speed: int, left: int) -> int:
        """The speed that a command sets, where one acts at a distance; 0: it ends the motion; below 0: back."""
        place = int(np.clip(round((distance - self._at[0]) / STEP_DEG), 0, len(self._at) - 1))
        option, speeds = int(self._options[_row(left)][speed - 1, :, place].argmin()), len(self._rates)
        return option if option <= speeds else speeds - option

    def from_rest(self, distances: Values, left: int) -> Values:
        """How long it takes from rest at distances (positive) until it rests at the goal, commands at their price."""
        least: Values = self._begun(distances, left - 1).min(axis=0)
        return self._timing.usual + _price(left) + least

    def _allowed(self, room: float, doubts: Values) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Where each speed may end; and where each may be followed by another. The slowest may always."""
        tail, usual = self._timing.tail, self._timing.usual
        room -= STEP_DEG  # what comes between two places
        ends = self._at + room >= (FEAR * self._rates * tail + doubts)[:, None]
        late, then = LATE_PART * tail * self._rates[:, None], (usual + AGAIN * tail) * self._rates
        ends[0] = True
        return ends, ends[:, None] & (self._at + room >= (late + then)[:, :, None])

    def _reckon(self, left: int) -> None:
        """One command more is left."""
        speeds, places = len(self._rates), len(self._at)
        values = np.full((speeds, 1 + speeds + TURNS, places), NEVER_S)
        values[:, 0] = self._ended(left)
        values[:, 1 : 1 + speeds], values[:, 1 + speeds :] = self._followed(left - 1), self._turned(left - 1)
        values = self._mean(values)
        values[:, 0][~self._ends] = NEVER_S
        values[:, 1 : 1 + speeds][~self._goes_on] = NEVER_S
        values[:, 1 + speeds :][~np.broadcast_to(self._ends[:, None], (speeds, TURNS, places))] = NEVER_S
        best = values.min(axis=1) + _price(left)
        self._options.append(values)
        self._best.append(np.minimum.accumulate(best - self._at / self._rates[:, None], axis=1))

    def _ended(self, left: int) -> Values:
        """Where it rests at a place: nothing more, or what it takes to put that right."""
        off, after = np.abs(self._at), left - (LEG - 1)
        again = np.where(self._at < 0, self.back.from_rest(off, after), self.from_rest(off, after))
        missed: Values = np.clip((off - self._near) / STEP_DEG + 0.5, 0.0, 1.0)
        return missed * (MISS * self._timing.usual + _price(left - 1) + again)

    def _followed(self, left: int) -> Values:
        """Where another speed takes the place of one at a place: [speed; other; place], of slower ones."""
        usual, found = self._timing.usual, np.full((*self._slows.shape, len(self._at)), NEVER_S)
        speeds, others = np.tril_indices(len(self._rates), -1)
        slows = self._slows[speeds, others]
        reaches = self._rates[others] * np.maximum(0.0, usual - slows)
        found[speeds, others] = slows[:, None] + self._least(others, self._at, reaches, left)
        return found

    def _turned(self, left: int) -> Values:
        """Where one turns back at a place: [speed; other; place]; before the goal that leads away from it."""
        found = np.empty((len(self._rates), TURNS, len(self._at)))
        speeds, others = np.indices(found.shape[:2]).reshape(2, -1)
        reaches = self._rates[others] * np.maximum(0.0, self._timing.usual - self._stops[speeds])
        back = self.back._least(others, -self._at[: self._behind], reaches, left)
        found[:, :, : self._behind] = back.reshape(len(self._rates), TURNS, -1)
        farther = self._at[self._behind :] + self._rates[:TURNS, None] * self._timing.usual
        away = self.from_rest(farther.ravel(), left)  # its start is answered after as long
        found[:, :, self._behind :] = away.reshape(farther.shape)
        return self._stops[:, None, None] + found

    def _begun(self, distances: Values, left: int) -> Values:
        """Where each speed begins from rest: [speed; distance]."""
        return self._least(np.arange(len(self._rates)), distances, self._rates * self._timing.usual, left)

    def _least(self, speeds: NDArray[np.intp], distances: Values, reaches: Values, left: int) -> Values:
        """With speeds from distances on, until the best place for the next command: [speed; distance].

        That can act after its `reach`.
        """
        if left < -MISSING:
            return np.full((len(speeds), len(distances)), NEVER_S)
        first = distances - reaches[:, None]
        places = np.clip((first - self._at[0]) / STEP_DEG, 0.0, len(self._at) - 1.0)
        value = distances / self._rates[speeds, None] + _between(self._best[_row(left)][speeds], places)
        return np.where(first < self._at[0], NEVER_S, value)

    def _mean(self, values: Values) -> Values:
        """The mean over where a command may act that should act at a place: [speed; option; place]."""
        count, mean, middle = values.shape[-1], np.empty_like(values), np.arange(values.shape[-1]) + 0.5
        halves = np.maximum(0.5, self._spreads / STEP_DEG)
        edge = int(halves.max()) + 2
        sums = np.zeros((*values.shape[:-1], edge + count + 1 + edge))
        np.cumsum(values, axis=-1, out=sums[..., edge + 1 : edge + 1 + count])
        sums[..., edge + 1 + count :] = sums[..., edge + count, None]
        for speed, half in enumerate(halves):
            width = np.minimum(middle + half, count) - np.maximum(middle - half, 0.0)
            low, high = (_from(sums[speed], edge + 0.5 + to, count) for to in (-half, half))
            mean[speed] = (high - low) / width
        return mean


def _row(left: int) -> int:
    return min(max(left, -MISSING), MOST) + MISSING


def _price(left: int) -> float:
    """What the command costs that is one of so many left, seconds."""
    return PRICE_S if left > 0 else OVER_S


def _between(rows: Values, index: Values) -> Values:
    """The values of rows between their points."""
    whole = np.minimum(index.astype(int), rows.shape[-1] - 2)
    before = np.take_along_axis(rows, whole, axis=-1)
    after = np.take_along_axis(rows, whole + 1, axis=-1)
    between: Values = before + (index - whole) * (after - before)
    return between


def _from(rows: Values, begin: float, count: int) -> Values:
    """So many values of rows, one apart, the first between their points."""
    whole = int(begin)
    before = rows[:, whole : whole + count]
    values: Values = before + (begin - whole) * (rows[:, whole + 1 : whole + 1 + count] - before)
    return values
