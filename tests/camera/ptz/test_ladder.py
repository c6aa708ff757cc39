"""How one axis is led down to its goal: what is reckoned comes true where answers take as long as they may."""

from __future__ import annotations

import random
import weakref
from collections.abc import Iterator
from statistics import mean

import numpy as np
import pytest

from services.camera.ptz.ladder import Ladder
from services.camera.ptz.outlook import Way
from services.camera.ptz.pace import TILT_RATES, Pace
from services.camera.ptz.skill import AGAIN_PART, LATE_PART, Skill

NEAR = 0.42
BACK = Way(-10.0, 100.0, Pace(TILT_RATES), NEAR)


@pytest.fixture
def skill() -> Skill:
    """Answers take 0.2 to 0.4 s, and the rates are known."""
    found = Skill(paces=(Pace(TILT_RATES), known(), Pace((3.0,))))
    for k in range(40):
        found.timing.learn(0.2 + 0.2 * (k % 10) / 9)
    return found


def known() -> Pace:
    """Rates that are known exactly; no change of speed takes time."""
    pace = Pace(TILT_RATES)
    pace.cov = np.eye(len(pace.mean)) * 1e-8
    pace.mean[len(TILT_RATES)] = 1e-6
    return pace


def led(skill: Skill, distance: float, room: float, took: Iterator[float]) -> tuple[float, float, float, list[int]]:
    """A motor without inertia that is led as the ladder says: its time, where it rests, how far it went, its speeds."""
    rates, usual = TILT_RATES, skill.timing.usual
    left, at, side, seconds, farthest, speeds = 9, distance, 1, 0.0, -distance, list[int]()
    ladder = down(skill, at, room)
    speed = ladder.begins(at, left)
    seconds += next(took)
    while speed:
        left -= 1
        speeds.append(speed * side)
        rate, here = rates[speed - 1], at * side
        acts = max(usual, (here - ladder.acts_at(here - rate * usual, speed, left)) / rate)
        then = ladder.next(here - acts * rate, speed, left)
        covered = ladder.covers(here - acts * rate)
        acts += next(took) - usual
        seconds, at = seconds + acts, at - side * rate * acts
        farthest = max(farthest, -at)
        if not covered:
            side = 1 if at > 0 else -1
            ladder = down(skill, abs(at), room if at > 0 else 100.0)
            speed = ladder.begins(abs(at), left)
        else:
            ladder, side, speed = (ladder.back, -side, -then) if then < 0 else (ladder, side, then)
    return seconds, at, farthest, speeds


def down(skill: Skill, distance: float, room: float) -> Ladder:
    """To a goal with so much room behind it."""
    return Ladder(Way(distance, room, skill.paces[1], NEAR), skill, Ladder(BACK, skill))


def usually(seed: int) -> Iterator[float]:
    """How long answers take that are not late."""
    rng = random.Random(seed)
    while True:
        yield rng.uniform(0.2, 0.4)


def test_it_ends_at_the_goal_nearly_always_and_takes_as_long_as_was_reckoned(skill: Skill) -> None:
    runs = [led(skill, 60.0, 100.0, usually(seed)) for seed in range(200)]
    assert mean(abs(at) <= NEAR for _, at, _, _ in runs) > 0.85
    reckoned = float(down(skill, 60.0, 100.0).from_rest(np.array([60.0]), 9)[0])
    assert mean(seconds for seconds, *_ in runs) == pytest.approx(reckoned, abs=0.5)  # which counts misses, too
    assert mean(seconds for seconds, *_ in runs) < 60.0 / TILT_RATES[-1] + 1.6


@pytest.mark.parametrize("room", [1.0, 4.0, 12.0, 30.0])
@pytest.mark.parametrize("late", range(5))
@pytest.mark.parametrize("parts", [(1.0, 0.0), (LATE_PART, AGAIN_PART)])
def test_no_late_answer_leads_it_to_its_stop(skill: Skill, room: float, late: int, parts: tuple[float, float]) -> None:
    """One answer as late as any, or nearly so and the next one late, too: at every place of a move."""
    tail, usual = skill.timing.tail, skill.timing.usual
    for seed in range(10):
        took = (
            usual + tail * parts[k - late] if late <= k <= late + 1 else seconds
            for k, seconds in enumerate(usually(seed))
        )
        _, _, farthest, speeds = led(skill, 40.0, room, took)
        assert farthest < room + 1e-6, speeds


def test_near_a_stop_it_comes_down_sooner(skill: Skill) -> None:
    near, far = led(skill, 60.0, 2.0, usually(1)), led(skill, 60.0, 60.0, usually(1))
    assert near[0] > far[0]
    assert len(near[3]) > len(far[3])


def test_what_has_gone_too_far_turns_round_without_a_stop(skill: Skill) -> None:
    late = (seconds + (1.0 if k == 1 else 0.0) for k, seconds in enumerate(usually(3)))
    _, at, farthest, speeds = led(skill, 30.0, 70.0, late)
    assert farthest > 3.0
    assert min(speeds) < 0
    assert abs(at) < 1.0


def test_with_few_commands_left_it_goes_on_slower(skill: Skill) -> None:
    ladder = down(skill, 5.0, 100.0)
    assert ladder.begins(5.0, 2) < ladder.begins(5.0, 9)


def test_what_is_not_known_goes_slower_near_a_stop(skill: Skill) -> None:
    new = Skill(timing=skill.timing)
    least = [
        float(Ladder(Way(20.0, 5.0, one.paces[1], NEAR), one).from_rest(np.array([20.0]), 9)[0]) for one in (skill, new)
    ]
    assert least[0] < least[1]


def test_nothing_of_it_stays_in_memory(skill: Skill) -> None:
    """A move makes two or three, of megabytes each, and what refers to itself stays until the collector comes."""
    ladder = down(skill, 60.0, 100.0)
    both = weakref.ref(ladder), weakref.ref(ladder.back)
    del ladder
    assert [one() for one in both] == [None, None]
