"""How fast zoom is, and how long it takes to be so fast, by looks that tell only coarse steps of it. Pure.

A look when it probably enters another step tells whether it is faster or slower than is thought, so each one halves
the doubt. What fits all looks is reckoned on a grid (Bayes' rule): what such a look tells is no bell curve. Not here:
what is learnt of zoom in moves (`zoom_drive.py`, `scale.py`), the looks themselves (`zoom_sweeps.py`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from services.camera.ptz.pace import Pace

RATES = np.geomspace(0.8, 12.0, 904)  # levels/s, three in a thousand apart
SLOWS_S = np.arange(0.0, 0.65, 0.025)[:, None]  # from rest to that rate
OFTEN_S = 0.1  # that takes so long
KEPT = 0.99  # of what looks told, with each one more
NOISE_LEVELS, NOISE_S = 0.03, 0.006  # of where a step begins; of the moment that a look tells of
ODD = 0.01  # of the looks tell nothing
EXACT = 0.003  # of the rate stays in doubt,
LONGER = 1 + 2 * EXACT  # so that it may be slower than all that is reckoned with
UNLIKELY = 0.001  # beside the likeliest: not worth to be kept
MOST_FITS = 1000  # are kept: where more fit, looks have told little more than a rate and its doubt do
OTHERWISE = 1e-5  # of what was kept is doubted, so that something else can be learnt

Grid = NDArray[np.float64]
Fit = tuple[float, float, float]  # a rate, levels/s; the seconds to it; how likely they are


class ZoomRate:
    """What is known of one way to let zoom go: by start and stop, or by the firmware's own moves."""

    def __init__(self, rate: float, doubt: float, fits: Sequence[Fit] = ()) -> None:
        """A guess, and which share of it is doubted: one standard deviation. `fits`: what was known another time.

        With them, the guess is what else may be.
        """
        self._began: tuple[float, float] | None = (rate, doubt)  # None: it was looked at since
        before = np.exp(-np.square(np.log(RATES / rate) / doubt) / 2)
        self._likely: Grid = before * np.exp(-SLOWS_S / OFTEN_S)  # [seconds to its rate; rate]
        if fits:
            self._likely *= OTHERWISE * sum(likely for *_, likely in fits) / self._likely.sum()
        for one, seconds, likely in fits:
            self._likely[np.abs(SLOWS_S - seconds).argmin(), np.abs(RATES - one).argmin()] += likely

    @property
    def fits(self) -> list[Fit]:
        """What fits all looks, but for what hardly does; nothing where that is too much to tell anything."""
        share = self._likely / self._likely.max()
        slows, rates = np.nonzero(share > UNLIKELY)
        if len(rates) > MOST_FITS:
            return []
        fits = np.stack([RATES[rates], SLOWS_S[slows, 0], share[slows, rates]], axis=1).round(4)
        return [(rate, seconds, likely) for rate, seconds, likely in fits.tolist()]

    @property
    def guess(self) -> tuple[float, float]:
        """What another one may begin with: a rate, and which share of it is doubted, as it began until it was seen."""
        if self._began is not None:
            return self._began
        rate = self._mean(np.log(RATES))
        return float(np.exp(rate)), max(EXACT, self._mean(np.square(np.log(RATES) - rate)) ** 0.5)

    def comes(self, ways: Iterable[float], after: float) -> float | None:
        """When it has probably come the next of some ways, seconds from its beginning; None: all are behind it."""
        times = (self._mean(way / RATES + SLOWS_S / 2) for way in ways)
        return next((when for when in times if when > after), None)

    def see(self, seconds: float, low: float, high: float, doubt: float = 0.0) -> None:
        """It was seen to have come so far from rest in so many seconds, levels: at least, and at most.

        `doubt`: standard deviation of the seconds.
        """
        self._began = None
        self._likely = (self._likely / self._likely.max()) ** KEPT
        gains = np.minimum(seconds, SLOWS_S)
        way = RATES * (gains * gains / (2 * np.maximum(SLOWS_S, 1e-6)) + seconds - gains)
        noise = np.hypot(NOISE_LEVELS, np.hypot(NOISE_S, doubt) * RATES)
        self._likely *= ODD + (1 - ODD) * (_below((high - way) / noise) - _below((low - way) / noise))

    def lasts(self, way: float, part: float) -> float:
        """How long a way takes from rest to rest, levels and seconds; longer in so small a part of all that fits."""
        seconds = (LONGER * way / RATES + SLOWS_S).ravel()
        longest = np.argsort(-seconds)
        likely = np.cumsum(self._likely.ravel()[longest])
        return float(seconds[longest[np.searchsorted(likely, part * likely[-1])]])

    def known(self) -> tuple[float, float]:
        """The rate, and which share of it is doubted."""
        rate = self._mean(RATES)
        return rate, max(EXACT, self._mean(np.square(RATES - rate)) ** 0.5 / rate)

    def teach(self, pace: Pace) -> None:
        """Hands on the rate, its doubt, and how fast zoom changes its speed."""
        rate, doubt = self.known()
        pace.suppose(rate, doubt, self._mean(SLOWS_S) / (2 * rate))

    def _mean(self, values: Grid) -> float:
        return float((self._likely * values).sum() / self._likely.sum())


def _below(deviations: Grid) -> Grid:
    """The share of a bell curve below so many standard deviations, near enough."""
    share: Grid = (1 + np.tanh(0.8 * deviations)) / 2
    return share
