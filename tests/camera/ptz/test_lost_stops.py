"""Stops that are answered well and have no effect, in virtual time: whatever was ordered, the camera comes to rest."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.camera.scan.virtual_scan import VirtualScan, virtual_scan

GOALS, LEARNING = 12, 3
RESTS_S = 10.0


@pytest.fixture
def trial(tmp_path: Path) -> Iterator[VirtualScan]:
    with virtual_scan(tmp_path) as running:
        yield running


def moves(trial: VirtualScan) -> bool:
    return any(trial.inside.device.motion(trial.flat.now)[1])


def comes_to_rest(trial: VirtualScan) -> bool:
    """Whether it stands soon, and stays so."""
    if not trial.flat.until(lambda: not moves(trial), RESTS_S):
        return False
    return not trial.flat.until(lambda: moves(trial), 5.0)


@pytest.mark.parametrize("seed", [1, 2, 3, 13, 17])
def test_after_every_goal_the_camera_rests_though_a_stop_of_each_is_lost(trial: VirtualScan, seed: int) -> None:
    dice, ptz, lost = random.Random(seed), trial.inside.device.ptz, 0
    for number in range(GOALS):
        ptz.loses_stops = int(number >= LEARNING)
        end = trial.flat.look("ip1", pan=dice.choice((dice.uniform(0, 150), dice.uniform(210, 359))),
                              tilt=dice.uniform(0, 80))  # fmt: skip
        assert end is not None
        assert end.state == "done", end
        assert comes_to_rest(trial), f"goal {number}"
        lost += number >= LEARNING and not ptz.loses_stops
    assert lost >= 5


@pytest.mark.parametrize("lost", [1, 2])
def test_what_an_order_in_its_place_ended_rests_although_that_stop_was_lost(trial: VirtualScan, lost: int) -> None:
    trial.flat.client.say("camera/ip1/order/Move", "Left 3 20")
    assert trial.flat.until(lambda: moves(trial), 5.0)
    trial.inside.device.ptz.loses_stops = lost
    trial.service.motors.give_up("a test", trial.flat.now)
    assert comes_to_rest(trial)
    assert trial.inside.device.ptz.loses_stops == 0


def test_what_somebody_else_turns_later_is_left_alone(trial: VirtualScan) -> None:
    end = trial.flat.look("ip1", pan=30.0, tilt=30.0)
    assert end is not None
    trial.flat.until(lambda: False, 5.0)
    commands = trial.inside.device.ptz.commands
    trial.inside.device.ptz.motors.start("Left", 0, 1, trial.flat.now, flip=True, mirror=True)
    trial.flat.until(lambda: False, 15.0)
    assert moves(trial)
    assert trial.inside.device.ptz.commands == commands


def test_a_move_ends_although_somebody_else_turns_the_camera_again_and_again(trial: VirtualScan) -> None:
    motors, flat, ways = trial.inside.device.ptz.motors, trial.flat, itertools.cycle(("Left", "Right"))
    again = flat.now + 4.0

    def over() -> bool:
        nonlocal again
        if flat.now >= again:
            again += 0.4
            motors.start(next(ways), 0, 5, flat.now, flip=True, mirror=True)
        return not trial.service.motors.busy

    flat.client.forget()
    flat.client.say("camera/ip1/position/set", '{"pan": 300, "tilt": 60}')
    assert flat.until(lambda: trial.service.motors.busy, 5.0)
    assert flat.until(over, 75.0)  # its deadline is 60 s
    [end] = [one for one in trial.answers() if one.final]
    assert (end.state, "in time" in str(end.error)) == ("failed", True), end
    assert comes_to_rest(trial)
