"""Missions in random flats, for the soak: what the tests and the bench make of a few, with more of them."""

from __future__ import annotations

import random

from tests.mission import bench, flats

RUNS = 3
NEAR_M = 0.15  # the mission tells where the robot, which is 2 cm unsure, or the house has it


def a_flat(rng: random.Random) -> float:
    """One random flat, virtual time: a marker that is told as found is where it is told to be; the seconds."""
    seed = rng.randrange(10_000)
    flat = flats.flat(seed)
    run = flats.mission(flat, house=True)
    assert run.result.state in ("found", "not_found", "failed"), (seed, run)
    if run.found:
        assert flats.off_by(flat, run.result) < NEAR_M, (seed, run)
    return run.seconds


def on_real_parts(rng: random.Random) -> float:
    """One of the bench's flats in real time; how many times the virtual time that took, which has to be near 1.

    A busy machine makes it later, never sooner: the least of a few runs counts.
    """
    seed, ratios = rng.choice(bench.REPEATED), []
    for _ in range(RUNS):
        ratios.append(bench.repeated(seed).ratio)
        if bench.AGREE[0] <= ratios[-1] <= bench.AGREE[1]:
            return ratios[-1]
    raise AssertionError(f"flat {seed}: real over virtual time {ratios}, expected {bench.AGREE}")
