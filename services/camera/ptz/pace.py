"""One axis: how far it goes for what it was told, and what its readings teach about that.

A motor follows the speed it was told with some acceleration; a command acts when it is answered, a reading tells how
it was when it was asked for: each give or take something that is learnt. A Kalman filter keeps the guess and its
doubt, so the first reading of a new camera counts for much and the thousandth for little, and what is learnt of one
speed says something about its neighbours. Not here: what goes for all axes (`skill.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

PAN_RATES = (1.0, 3.0, 6.0, 10.0, 16.0, 24.0, 34.0, 45.0)  # degrees/s, a guess to begin with
TILT_RATES = tuple(0.6 * rate for rate in PAN_RATES)
ZOOM_RATES = (3.0,)  # levels/s; there is one speed

# What is learnt beside the rates, with a first guess and its doubt: seconds per (degree/s) of half a change of speed,
# how much later stops act than starts, the age of a reading (below 0: from before it was asked for), and how much of
# an unusually long answer falls before a reading is taken, and after a command has acted.
HALF_CHANGE, STOP_LATE, READ_LATE, READ_PART, ACT_PART = range(5)
ANSWERS = (READ_LATE, READ_PART, ACT_PART)  # the same for all axes
FIRST = (0.005, 0.0, 0.0, 0.4, 0.15)
DOUBT = (0.006, 0.04, 0.12, 0.4, 0.2)
LEAST = (0.0002, -0.3, -1.0, 0.0, 0.0)
MOST = (0.2, 0.6, 1.0, 1.0, 1.0)
RATE_DOUBT, SLOW_DOUBT = 0.7, 0.05  # of the guess; of how much slower it is than the highest speed
COMMON, NEIGHBOURS = 0.5, 4.0  # what all speeds have in common; and how many steps apart they say little of another
SLOWEST = 0.05
FLOOR = 0.05  # of the guess: what other speeds teach of one makes it no slower
DRIFT = 0.002  # of each rate, per motion: motors age
DOUBT_AGAIN = 0.01  # of the first guess's covariance, when what is known was wrong
AGAIN_DEG = 0.5  # no reading is so far off: an axis that rests there has come another way than was known
ROUNDS = 3  # of learning from one reading: a speed that is reached late bends what it shows
UNSURE = 0.2  # of a rate, from which doubt on what a reading tells of it is looked for in two places
HALVINGS = 20
OUTLIER = 3.0  # standard deviations; beyond, a reading counts for less


class Told(NamedTuple):
    """A command as one axis sees it: when it was answered, how much later than usual, and the speed with its sign."""

    at: float
    late: float
    level: int


class Seen(NamedTuple):
    """A reading as one axis sees it: when it was asked for, how much later than usual it came, how far it has come."""

    at: float
    late: float
    travel: float
    noise: float  # standard deviation
    acts: bool = False  # it tells of the moment when a command acts that was answered then


Vector = NDArray[np.float64]


class _Fit(NamedTuple):
    """Numbers that fit a reading, their covariance, and how unlikely they are, in squares of standard deviations."""

    unlikely: float
    mean: Vector
    cov: Vector


def _prior(guess: Sequence[float]) -> tuple[Vector, Vector]:
    rates = np.array(guess, float)
    steps = np.arange(len(rates))
    apart = np.abs(steps[:, None] - steps[None, :])
    alike = COMMON + (1 - COMMON) * np.exp(-np.square(apart / NEIGHBOURS))
    cov = np.zeros((len(rates) + 5, len(rates) + 5))
    doubts = RATE_DOUBT * rates + SLOW_DOUBT * (rates[-1] - rates)
    cov[: len(rates), : len(rates)] = alike * np.outer(doubts, doubts)
    cov[len(rates) :, len(rates) :] = np.diag(np.square(DOUBT))
    return np.concatenate([rates, np.array(FIRST)]), cov


@dataclass
class Pace:
    """What is known of one axis: the numbers and their covariance."""

    guess: tuple[float, ...]
    mean: Vector = field(default_factory=lambda: np.zeros(0))
    cov: Vector = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        if not len(self.mean):
            self.mean, self.cov = _prior(self.guess)

    @property
    def speeds(self) -> range:
        """The speeds that there are, the slowest first."""
        return range(1, len(self.guess) + 1)

    def rate(self, speed: int) -> float:
        """Degrees (levels) per second, positive."""
        return max(SLOWEST, float(self.mean[speed - 1]))

    def doubt(self, speed: int) -> float:
        """The standard deviation of a rate."""
        return float(np.sqrt(self.cov[speed - 1, speed - 1]))

    def known(self, speed: int) -> bool:
        """Whether a rate is known well enough to time a stop by it."""
        return self.doubt(speed) < 0.05 * self.rate(speed)

    def other(self, which: int) -> float:
        """One of the numbers beside the rates."""
        return min(MOST[which], max(LEAST[which], float(self.mean[len(self.guess) + which])))

    def other_doubt(self, which: int) -> float:
        """Its standard deviation."""
        number = len(self.guess) + which
        return float(np.sqrt(self.cov[number, number]))

    @property
    def slow(self) -> float:
        """Seconds for a change by one degree/s: one over its acceleration."""
        return 2 * self.other(HALF_CHANGE)

    def braking(self, rate: float) -> float:
        """How far it goes while it slows down from a rate to rest."""
        return self.other(HALF_CHANGE) * rate**2

    def change(self, speed: int, to: int = 0) -> float:
        """How long a change of speed takes, seconds."""
        return self.slow * abs((self.rate(speed) if speed else 0) - (self.rate(to) if to else 0))

    def travel(self, told: Sequence[Told], at: float) -> float:
        """How far it has come at a time, from rest before the first command."""
        return _travel(self.mean, len(self.guess), told, at)[0]

    def velocity(self, told: Sequence[Told], at: float) -> float:
        """How fast it goes at a time."""
        return _travel(self.mean, len(self.guess), told, at)[1]

    def seen_at(self, asked: float, late: float) -> float:
        """The time of which a reading tells."""
        return asked + self.other(READ_LATE) + self.other(READ_PART) * late

    def expected(self, told: Sequence[Told], seen: Seen) -> tuple[float, float]:
        """What a reading should show, and the doubt about that."""
        value, slope = self._slope(told, seen, self.mean)
        return value, float(np.sqrt(slope @ self.cov @ slope))

    def apart(self, told: Sequence[Told], one: Seen, other: Seen) -> float:
        """The doubt about how far it goes from one moment to another."""
        slope = self._slope(told, other, self.mean)[1] - self._slope(told, one, self.mean)[1]
        return float(np.sqrt(slope @ self.cov @ slope))

    def learn(self, told: Sequence[Told], seen: Seen) -> None:
        """Takes in one reading. It may be of another time than is thought, but not where the axis rests: if it rests
        far from where it should, then what was thought to be known well is not.
        """
        expected, slope = self._slope(told, seen, self.mean)
        wrong = seen.travel - expected
        likely = float(slope @ self.cov @ slope) + seen.noise**2
        if wrong * wrong > max(AGAIN_DEG**2, OUTLIER**2 * likely) and not self.velocity(
            told, self.seen_at(seen.at, seen.late)
        ):
            self.cov = self.cov + DOUBT_AGAIN * _prior(self.guess)[1]
        fit, used = self._fitted(told, seen, self.mean), {abs(one.level) for one in told if one.level}
        if any(self.doubt(speed) > UNSURE * self.rate(speed) for speed in used):
            fit = min(fit, self._fitted(told, seen, self._as_fast(told, seen)), key=lambda one: one.unlikely)
        self.mean, self.cov = fit.mean, fit.cov

    def _fitted(self, told: Sequence[Told], seen: Seen, mean: Vector) -> _Fit:
        """What fits a reading, looked for from some numbers on: where little is known, more than one thing may."""
        for _ in range(ROUNDS):  # the iterated extended Kalman filter: the slope is that where this leads
            expected, slope = self._slope(told, seen, mean)
            wrong = seen.travel - expected - float(slope @ (self.mean - mean))
            mean, cov = taught(self.mean, self.cov, slope, wrong, seen.noise)
            mean = self._within(mean)
        off, changed = (seen.travel - self._shown(mean, told, seen)) / seen.noise, mean - self.mean
        return _Fit(off**2 + float(changed @ np.linalg.lstsq(self.cov, changed)[0]), mean, cov)

    def _as_fast(self, told: Sequence[Told], seen: Seen) -> Vector:
        """The numbers with other rates of the speeds that it was told: those with which it would have come so far."""
        used, low, high = sorted({abs(one.level) - 1 for one in told if one.level}), FLOOR, 1 / FLOOR
        for _ in range(HALVINGS):
            mean, part = self.mean.copy(), (low * high) ** 0.5
            mean[used] *= part
            farther = abs(self._shown(mean, told, seen)) > abs(seen.travel)
            low, high = (low, part) if farther else (part, high)
        return mean

    def measure_late_from(self, later: float) -> None:
        """What is usual for an answer is so many seconds more now; readings and commands mean the same as before."""
        count, change = len(self.guess), np.eye(len(self.mean))
        change[count + READ_LATE, [count + READ_PART, count + ACT_PART]] = later
        self.mean = change @ self.mean
        self.cov = change @ self.cov @ change.T

    def borrow(self, better: Pace) -> None:
        """Takes over what an axis with finer readings knows of the timing of answers."""
        for which in (READ_LATE, READ_PART, ACT_PART):
            number, other = len(self.guess) + which, len(better.guess) + which
            self.mean[number] = better.mean[other]
            self.cov[number, :] = self.cov[:, number] = 0.0
            self.cov[number, number] = better.cov[other, other]

    def agree(self, other: Pace) -> None:
        """Answers mean the same for all axes: takes over what another one has learnt of their timing.

        What was learnt here of everything else together with it follows (Jeffrey's rule; exact, as the readings of two
        axes have nothing else in common).
        """
        own, others = (np.array(ANSWERS) + len(pace.guess) for pace in (self, other))
        known, better = self.cov[np.ix_(own, own)], other.cov[np.ix_(others, others)]
        part = np.linalg.solve(known, self.cov[own, :]).T
        self.mean = self.mean + part @ (other.mean[others] - self.mean[own])
        self.cov = self.cov + part @ (better - known) @ part.T
        self.mean = self._within(self.mean)

    def suppose(self, rate: float, part: float, half_change: float) -> None:
        """Its one rate is known from elsewhere but for such a share, and how fast it changes speed, too."""
        self.mean[0], self.mean[1 + HALF_CHANGE] = rate, half_change
        self.cov[0, :] = self.cov[:, 0] = 0.0
        self.cov[0, 0] = (part * rate) ** 2

    def correct(self, speed: int, slope: float, wrong: float, noise: float) -> None:
        """What changes by `slope` with a rate was `wrong`; `noise`: standard deviation of that."""
        slopes = np.zeros_like(self.mean)
        slopes[speed - 1] = slope
        self.mean, self.cov = taught(self.mean, self.cov, slopes, wrong, noise)
        self.mean = self._within(self.mean)

    def age(self) -> None:
        """A motion is over: motors and networks change, so nothing stays known for ever."""
        count = len(self.guess)
        index = np.arange(count)
        self.cov[index, index] += np.square(DRIFT * self.mean[:count])
        rest = np.arange(count, count + 5)
        self.cov[rest, rest] += np.square(0.01 * np.array(DOUBT))

    def _within(self, mean: Vector) -> Vector:
        count = len(self.guess)
        rates = np.maximum(mean[:count], FLOOR * np.array(self.guess))
        return np.concatenate([rates, np.clip(mean[count:], LEAST, MOST)])

    def _slope(self, told: Sequence[Told], seen: Seen, mean: Vector) -> tuple[float, Vector]:
        """What a reading should show, and how that changes with each number."""
        count = len(self.guess)
        used = {abs(one.level) - 1 for one in told if one.level}
        slope = np.zeros(count + 5)
        value = self._shown(mean, told, seen)
        for number in (*used, *range(count, count + 5)):
            step = max(1e-4, 1e-3 * abs(mean[number]))
            moved = mean.copy()
            moved[number] += step
            slope[number] = (self._shown(moved, told, seen) - value) / step
        return value, slope

    def _shown(self, mean: Vector, told: Sequence[Told], seen: Seen) -> float:
        count = len(self.guess)
        at = seen.at + float(mean[count + READ_LATE]) + float(mean[count + READ_PART]) * seen.late
        if seen.acts:
            at = seen.at - float(mean[count + ACT_PART]) * seen.late
        return _travel(mean, count, told, at)[0]


def taught(mean: Vector, cov: Vector, slope: Vector, wrong: float, noise: float) -> tuple[Vector, Vector]:
    """Numbers and their covariance after what changes by `slope` with them was `wrong`; `noise`: standard deviation.

    Kalman's update; what is farther off than is likely counts for less.
    """
    spread = float(slope @ cov @ slope) + noise**2
    if wrong * wrong > OUTLIER**2 * spread:
        spread = wrong * wrong / OUTLIER**2
    gain = cov @ slope / spread
    cov = cov - np.outer(gain, slope @ cov)
    return mean + gain * wrong, (cov + cov.T) / 2


def _travel(mean: Vector, count: int, told: Sequence[Told], at: float) -> tuple[float, float]:
    """How far and how fast: the speed goes straight from each wanted one to the next."""
    slow = 2 * max(LEAST[HALF_CHANGE], float(mean[count + HALF_CHANGE]))  # seconds for a change by one degree/s
    late, part = float(mean[count + STOP_LATE]), float(mean[count + ACT_PART])
    place = speed = wanted = 0.0
    begun: float | None = None
    for one in (*told, None):
        acts = at if one is None else min(at, one.at - part * one.late + (late if one.level == 0 else 0.0))
        if begun is not None and acts > begun:
            seconds = acts - begun
            changing = min(seconds, slow * abs(wanted - speed))
            before = speed
            if changing:
                speed += (changing / slow) * (1 if wanted > speed else -1)
            place += (before + speed) / 2 * changing + wanted * (seconds - changing)
        begun = acts if begun is None else max(begun, acts)
        if one is not None and acts < at:
            wanted = 0.0 if one.level == 0 else (1 if one.level > 0 else -1) * float(mean[abs(one.level) - 1])
    return place, speed
