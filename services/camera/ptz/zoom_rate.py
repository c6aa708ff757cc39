"""How fast zoom is, and how long it takes to be so fast, by looks that tell only coarse steps of it. Pure.

A look when it probably enters another step tells whether it is faster or slower than is thought, so each one halves
the doubt. What fits all looks is reckoned on a grid (Bayes' rule): what such a look tells is no bell curve. Not here:
what is learnt of zoom in moves (`zoom_drive.py`, `scale.py`), the looks themselves (`zoom_sweeps.py`).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from services.camera.ptz.pace import Pace

RATES = np.geomspace(0.8, 12.0, 904)  # levels/s, three in a thousand apart
SLOWS_S = np.arange(0.0, 0.65, 0.025)[:, None]  # from rest to that rate
LEAST_DOUBT, DOUBTS = 0.05, 3.0  # of a rate before the first look, at least; times what was doubted before
NOISE_LEVELS, NOISE_S = 0.03, 0.006  # of where a step begins; of the moment that a look tells of
ODD = 0.01  # of the looks tell nothing
EXACT = 0.003  # of the rate stays in doubt

Grid = NDArray[np.float64]


class ZoomRate:
    """What is known of one way to let zoom go: by start and stop, or by the firmware's own moves."""

    def __init__(self, pace: Pace) -> None:
        doubt = max(LEAST_DOUBT, DOUBTS * pace.doubt(1) / pace.rate(1))
        before = np.exp(-np.square(np.log(RATES / pace.rate(1)) / doubt) / 2)
        self._likely: Grid = before * np.ones_like(SLOWS_S)  # [seconds to its rate; rate]

    def comes(self, ways: Iterable[float], after: float) -> float | None:
        """When it has probably come the next of some ways, seconds from its beginning; None: all are behind it."""
        times = (self._mean(way / RATES + SLOWS_S / 2) for way in ways)
        return next((when for when in times if when > after), None)

    def see(self, seconds: float, low: float, high: float) -> None:
        """It was seen to have come so far from rest in so many seconds, levels: at least, and at most."""
        gains = np.minimum(seconds, SLOWS_S)
        way = RATES * (gains * gains / (2 * np.maximum(SLOWS_S, 1e-6)) + seconds - gains)
        noise = np.hypot(NOISE_LEVELS, NOISE_S * RATES)
        self._likely *= ODD + (1 - ODD) * (_below((high - way) / noise) - _below((low - way) / noise))

    def teach(self, pace: Pace) -> None:
        """Hands on the rate, its doubt, and how fast zoom changes its speed."""
        rate = self._mean(RATES)
        doubt = self._mean(np.square(RATES - rate)) ** 0.5
        pace.suppose(rate, max(EXACT, doubt / rate), self._mean(SLOWS_S) / (2 * rate))

    def _mean(self, values: Grid) -> float:
        return float((self._likely * values).sum() / self._likely.sum())


def _below(deviations: Grid) -> Grid:
    """The share of a bell curve below so many standard deviations, near enough."""
    share: Grid = (1 + np.tanh(0.8 * deviations)) / 2
    return share
