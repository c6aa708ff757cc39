"""What is learnt about a camera's motors: how fast each speed is, how late a stop takes effect, which way is which.

The travel of start, wait `held` seconds, stop is `rate * (held + delay)`: affine in the time (the tables of
pyronear/pyro-engine show R^2 of 0.97 to 0.999). What was never tried is scaled by what was.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import median

PAN_RATES = (1.0, 3.0, 6.0, 10.0, 16.0, 24.0, 34.0, 45.0)  # degrees/s, a guess to begin with
TILT_RATES = tuple(0.6 * rate for rate in PAN_RATES)
ZOOM_RATES = (1.0,)  # levels/s; there is one speed
DELAY_S = 0.3  # of one command over the camera's HTTP
KEEP = 10  # samples of each speed: motors and networks change slowly
SPREAD_S = 0.5  # times that differ less cannot tell rate and delay apart


@dataclass
class Pace:
    """One axis."""

    guess: tuple[float, ...]
    delay: float = DELAY_S
    samples: dict[int, list[tuple[float, float]]] = field(default_factory=dict)
    seen: dict[int, float] = field(default_factory=dict)  # rates read while it turned

    @property
    def speeds(self) -> range:
        """The speeds that there are, the slowest first."""
        return range(1, len(self.guess) + 1)

    def learn(self, speed: int, held: float, travel: float) -> None:
        """Takes in one finished motion; `travel` is positive in the direction that was asked for."""
        if travel > 0:
            self.samples.setdefault(speed, []).append((held, travel))
            del self.samples[speed][:-KEEP]
            self._learn_delay(speed, held, travel)

    def learn_rate(self, speed: int, rate: float) -> None:
        """Takes in a rate read while it turned: degrees/s."""
        if rate > 0:
            old = self.seen.get(speed, rate)
            self.seen[speed] = 0.5 * (old + rate)

    def rate(self, speed: int) -> float:
        """Degrees (levels) per second."""
        if speed in self.seen:
            return self.seen[speed]
        if speed in self.samples:
            return self._fitted(speed)
        known = {*self.seen, *self.samples}
        factor = median(self.rate(one) / self.guess[one - 1] for one in known) if known else 1.0
        return self.guess[speed - 1] * factor

    def held(self, speed: int, travel: float) -> float:
        """How long to wait between start and stop; negative when even no wait is too far."""
        return travel / self.rate(speed) - self.delay

    def _fitted(self, speed: int) -> float:
        """Least squares through the samples where their times differ enough, else the mean over a known delay."""
        samples = self.samples[speed]
        times = [held for held, _ in samples]
        mean_time = sum(times) / len(samples)
        mean_travel = sum(travel for _, travel in samples) / len(samples)
        if max(times) - min(times) >= SPREAD_S:
            across = sum((held - mean_time) * (travel - mean_travel) for held, travel in samples)
            slope = across / sum((held - mean_time) ** 2 for held in times)
            if slope > 0:
                return slope
        return mean_travel / (mean_time + self.delay)

    def _learn_delay(self, speed: int, held: float, travel: float) -> None:
        """Short motions are nearly all delay; long ones tell nothing about it."""
        if held < 1.0 and (speed in self.seen or len(self.samples[speed]) > 1):
            found = travel / self.rate(speed) - held
            self.delay = min(1.5, max(0.0, self.delay + 0.25 * (found - self.delay)))


@dataclass
class Sense:
    """Which way the reading goes when the camera is told right, down or in: +1 or -1; `sure` once it was seen."""

    sign: int = 1
    sure: bool = False


@dataclass
class Skill:
    """All that is learnt about one camera, for pan, tilt and zoom."""

    paces: tuple[Pace, Pace, Pace] = field(
        default_factory=lambda: (Pace(PAN_RATES), Pace(TILT_RATES), Pace(ZOOM_RATES))
    )
    senses: tuple[Sense, Sense, Sense] = field(default_factory=lambda: (Sense(), Sense(), Sense(sure=True)))
    diagonals: bool = True
    lag: float = 0.4  # s from a reading in motion to the effect of a stop sent at once

    def forget_senses(self, *, flip: bool, mirror: bool) -> None:
        """The picture's options changed, and these swap the motors: guess, and look at the next motion."""
        self.senses[0].sign, self.senses[0].sure = (1 if mirror else -1), False
        self.senses[1].sign, self.senses[1].sure = (1 if flip else -1), False

    def learn_lag(self, found: float) -> None:
        """Takes in one measured lag."""
        self.lag = min(1.5, max(0.0, self.lag + 0.3 * (found - self.lag)))
