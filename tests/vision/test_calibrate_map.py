"""Where the apartment lies in a robot's map: any pose is found again, and what cannot be right is told."""

from __future__ import annotations

from cmath import exp
from math import radians

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from services.vision.calibrate_map import APART_M, Pair, fit

metres = st.floats(-50.0, 50.0)
points = st.lists(st.tuples(metres, metres), min_size=2, max_size=8)
poses = st.tuples(metres, metres, st.floats(-179.9, 179.9))


def moved(point: tuple[float, float], x: float, y: float, yaw_deg: float) -> complex:
    return complex(*point) * exp(1j * radians(yaw_deg)) + complex(x, y)


def pairs(
    known: list[tuple[float, float]], pose: tuple[float, float, float], noise: list[complex] | None = None
) -> list[Pair]:
    there = [moved(point, *pose) + (noise[i] if noise else 0) for i, point in enumerate(known)]
    return [Pair(f"p{i}", one, (at.real, at.imag)) for i, (one, at) in enumerate(zip(known, there, strict=True))]


def apart(known: list[tuple[float, float]]) -> float:
    return max(abs(complex(*one) - complex(*other)) for one in known for other in known)


def turned_by(one: float, other: float) -> float:
    return abs((one - other + 180) % 360 - 180)


@settings(max_examples=200, deadline=None)
@given(points, poses)
def test_any_pose_is_found_again_to_a_billionth(
    known: list[tuple[float, float]], pose: tuple[float, float, float]
) -> None:
    assume(apart(known) > 1.0)
    found = fit(pairs(known, pose), 0.01)
    for point in [(0.0, 0.0), *known]:
        assert abs(moved(point, found.x, found.y, found.yaw_deg) - moved(point, *pose)) < 1e-9
    assert turned_by(found.yaw_deg, pose[2]) < 1e-9 * 180
    assert max(found.off_m) < 1e-9
    assert found.misplaced is None


@settings(max_examples=200, deadline=None)
@given(points, poses, st.integers(0, 2**32 - 1))
def test_with_a_centimetre_of_noise_the_error_is_the_one_that_is_told(
    known: list[tuple[float, float]], pose: tuple[float, float, float], seed: int
) -> None:
    assume(apart(known) > 1.0)
    rng = np.random.default_rng(seed)
    noise = [complex(*rng.normal(0, 0.01, 2)) for _ in known]
    found = fit(pairs(known, pose, noise), 0.01)
    middle = complex(*np.mean(known, axis=0))
    spread = sum(abs(complex(*one) - middle) ** 2 for one in known)
    expected = 0.01 * np.sqrt(1 / len(known) + abs(middle) ** 2 / spread)
    assert turned_by(found.yaw_deg, pose[2]) < 6 * np.degrees(0.01 / np.sqrt(spread))
    assert abs(complex(found.x, found.y) - complex(*pose[:2])) < 6 * expected
    assert 1 - 1e-9 < found.sigma_m / expected < 6
    assert 1 - 1e-9 < found.sigma_deg / np.degrees(0.01 / np.sqrt(spread)) < 6


ROOM = [(0.0, 0.0), (4.0, 0.5), (3.5, 3.0), (0.5, 4.0)]
POSE = (1.5, -0.8, 12.0)


def test_a_pair_that_the_others_speak_against_is_named() -> None:
    rng = np.random.default_rng(1)
    for wrong in range(4):
        noise = [complex(*rng.normal(0, 0.01, 2)) for _ in ROOM]
        noise[wrong] += 0.6j
        found = fit(pairs(ROOM, POSE, noise), 0.02)
        assert found.misplaced == f"p{wrong}"
        assert found.misplaced_m == pytest.approx(0.6, abs=0.1)
    assert fit(pairs(ROOM, POSE), 0.02).misplaced is None


def test_a_pair_far_out_is_no_matter_of_metres() -> None:
    noise = [0j, 0j, 0j, 0j, 50 + 40j]
    assert fit(pairs([*ROOM, (2.0, 2.0)], POSE, noise), 0.02).misplaced == "p4"


def test_of_three_pairs_the_one_that_does_not_fit_the_other_two_is_named() -> None:
    assert fit(pairs(ROOM[:3], POSE, [0j, 1 + 0j, 0j]), 0.02).misplaced == "p1"


@pytest.mark.parametrize(
    ("given_", "why"),
    [
        ([], "2 pairs of points or more, got 0"),
        (pairs(ROOM[:1], POSE), "2 pairs of points or more, got 1: one point tells no direction"),
        (
            pairs([(1.0, 1.0), (1.0, 1.0)], POSE),
            f"points at least {APART_M} m apart, all lie within 0.00 m in the apar",
        ),
        ([Pair("a", (0, 0), (1, 1)), Pair("b", (3, 0), (1.1, 1))], "all lie within 0.10 m in the map"),
        ([Pair(str(p), p, (100 * p[0], 100 * p[1])) for p in ROOM], "metres in both, the map's points lie 100 times"),
        ([Pair(str(p), p, (-p[0], p[1])) for p in ROOM], "one of them is mirrored: so the points agree to 0.00 m"),
    ],
)
def test_what_tells_no_pose_is_refused_with_the_reason(given_: list[Pair], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        fit(given_, 0.02)
