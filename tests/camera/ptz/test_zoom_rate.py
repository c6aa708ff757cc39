"""How fast zoom is, by looks that tell only coarse steps of it."""

from __future__ import annotations

import random
from math import inf

import numpy as np
import pytest

from services.camera.ptz.pace import Pace
from services.camera.ptz.zoom_rate import ZoomRate

RANGE = 8.0
LOOK_S = 0.3  # until a look is answered


def way(rate: float, slows: float, seconds: float) -> float:
    """How far a zoom has come from rest."""
    gains = min(seconds, slows)
    return rate * (gains * gains / (2 * slows) + seconds - gains)


def sweep(known: ZoomRate, rng: random.Random, rate: float, slows: float, step: float) -> int:
    """From one end to the other; how often it was looked at."""
    now, looks = 0.0, 0
    while way(rate, slows, now) < RANGE:
        comes = known.comes(np.arange(step / 2, RANGE, step), now)
        asked = now if comes is None else comes
        read = min(RANGE, step * round(way(rate, slows, asked) / step))
        known.see(asked, read - step / 2 if read else -inf, read + step / 2 if read < RANGE else inf)
        now, looks = asked + LOOK_S + rng.uniform(-0.1, 0.1), looks + 1
    return looks


def thought(rate: float, doubt: float) -> Pace:
    pace = Pace((rate,))
    pace.suppose(rate, doubt, 0.01)
    return pace


@pytest.mark.parametrize("step", [2.0, 1.0])
@pytest.mark.parametrize("slows", [0.05, 0.3])
@pytest.mark.parametrize("rate", [1.5, 2.7, 4.0, 6.0])
def test_a_few_sweeps_tell_how_fast_it_is_and_how_long_that_takes(rate: float, slows: float, step: float) -> None:
    known, pace, rng = ZoomRate(4.0, 0.9), thought(4.0, 0.3), random.Random(7)
    looks = [sweep(known, rng, rate, slows, step) for _ in range(12)]
    known.teach(pace)
    assert pace.rate(1) == pytest.approx(rate, rel=0.02)
    assert pace.doubt(1) < 0.03 * rate
    assert pace.change(1) == pytest.approx(slows, abs=0.08)
    assert max(looks[1:]) <= RANGE / step * max(1.0, 4.0 / rate) + 2


def test_the_doubt_it_tells_is_the_doubt_there_is() -> None:
    off = []
    for seed in range(30):
        rng = random.Random(seed)
        rate, slows, pace = rng.uniform(1.5, 6.0), rng.uniform(0.05, 0.15), thought(4.0, 0.3)
        known = ZoomRate(4.0, 0.9)
        for _ in range(6):
            sweep(known, rng, rate, slows, 2.0)
        known.teach(pace)
        off.append(abs(pace.rate(1) - rate) / pace.doubt(1))
    assert np.mean(np.square(off)) < 2.0
    assert max(off) < 4.0


def test_a_look_that_tells_of_another_moment_does_not_spoil_it() -> None:
    known, pace, rng = ZoomRate(4.0, 0.9), thought(4.0, 0.3), random.Random(3)
    for number in range(12):
        sweep(known, rng, 2.7, 0.1, 2.0)
        if number == 3:
            known.see(2.0, 7.0, inf)  # it had come 5.3 levels
    known.teach(pace)
    assert pace.rate(1) == pytest.approx(2.7, rel=0.03)


def test_when_it_comes_a_way_is_what_is_thought_and_behind_it_nothing_comes() -> None:
    known = ZoomRate(4.0, 0.06)
    comes = known.comes([1.0, 3.0], 0.5)
    assert comes is not None
    assert 0.75 < comes < 1.2  # 3 levels at 4 levels/s, from rest
    assert known.comes([1.0, 3.0], 1.5) is None


def test_a_way_hardly_ever_lasts_longer_than_it_says() -> None:
    longer = []
    for seed in range(60):
        rng = random.Random(seed)
        known, rate, slows = ZoomRate(4.0, 0.5), rng.uniform(1.5, 6.0), rng.uniform(0.05, 0.15)
        for _ in range(1 + seed % 3):
            sweep(known, rng, rate, slows, 2.0)
            longer.append(RANGE / rate + slows > known.lasts(RANGE, 0.02))
    assert sum(longer) <= 0.05 * len(longer)
    assert known.lasts(RANGE, 0.02) < 1.1 * (RANGE / rate + slows)  # and it does not say any time


def test_nor_after_so_many_looks_that_all_but_one_rate_is_ruled_out() -> None:
    for seed in range(40):
        rng = random.Random(seed)
        known, rate = ZoomRate(4.0, 0.5), rng.uniform(1.5, 6.0)
        for _ in range(15):
            sweep(known, rng, rate, 0.1, 2.0)
        assert RANGE / rate + 0.1 <= known.lasts(RANGE, 0.01) < 1.05 * (RANGE / rate + 0.1)


def test_what_was_learnt_another_time_is_known_again_and_something_else_can_be_learnt() -> None:
    known, rng = ZoomRate(4.0, 0.9), random.Random(7)
    for _ in range(12):
        sweep(known, rng, 2.7, 0.1, 2.0)
    again = ZoomRate(known.known()[0], 0.5, known.fits)
    assert again.known()[0] == pytest.approx(known.known()[0], rel=0.001)
    assert again.known()[1] == pytest.approx(known.known()[1], rel=0.2)
    for levels in (1.0, 2.0, 8.0):
        assert again.lasts(levels, 0.01) == pytest.approx(known.lasts(levels, 0.01), abs=0.01)
    for _ in range(12):
        sweep(again, rng, 1.9, 0.1, 2.0)
    assert again.known()[0] == pytest.approx(1.9, rel=0.02)
