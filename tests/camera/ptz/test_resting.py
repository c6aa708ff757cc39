"""Where pan and tilt come to rest after a stop, told by a look on the last bit of their way."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import islice
from math import inf
from statistics import mean
from typing import cast

import pytest

from services.camera.device import MoveTo, Reading, Reply, Request, Status
from services.camera.ptz.arriving import Arriving
from services.camera.ptz.glide import Glide
from services.camera.ptz.helm import Helm
from services.camera.ptz.skill import Skill
from services.camera.ptz.zoom_rate import ZoomRate
from services.simulators.camera.firmwares import PROFILES
from tests import bounds
from tests.camera.goals import LIMITS, Goal, Outcome, Rig, random_goals
from tests.camera.motors import Motors, drive

NAMES = ("ip3m-941w-2019", "ip4m-1051b-2019", "ip3m-943b")  # the second says for ever that it moves; the last dithers


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", [1, 4])
def test_a_look_on_the_last_bit_of_way_tells_where_it_will_rest(name: str, seed: int) -> None:
    rig, told = Rig(PROFILES[name], seed), []
    rig.calibrate()
    for goal in random_goals(bounds.GOALS, seed):
        outcome = rig.go(goal)
        assert outcome.rests
        reading, truth = rig.near, rig.truth()
        if reading is not None and reading.moving is None:
            pan, tilt, _ = LIMITS.pose(reading)
            told.append(max(abs(pan - LIMITS.unwrap(truth[0])), abs(tilt - truth[1])))
        rig.now += 1.0
    assert len(told) > 5
    assert max(told) < (0.25 if rig.profile.status_dither else 0.2)


@pytest.mark.parametrize("name", NAMES)
def test_that_a_rest_was_foretold_a_little_wrong_is_not_taken_for_dither(name: str) -> None:
    rig = Rig(PROFILES[name], 4)
    rig.calibrate()
    for goal in random_goals(bounds.GOALS, 4):
        rig.go(goal)
        rig.now += 1.0
    assert rig.skill.dithers == rig.profile.status_dither


def test_where_the_firmware_ends_pan_itself_one_look_on_its_last_bit_of_way_is_enough() -> None:
    rig, ends = Rig(PROFILES["dahua-pan-only"], 1), []
    rig.calibrate()
    for goal in random_goals(bounds.GOALS, 1):
        sent: list[Request] = []
        rig.log = lambda reply, sent=sent: sent.append(reply.request)  # type: ignore[misc]
        outcome = rig.go(goal)
        assert outcome.rests
        assert outcome.off <= bounds.OFF_DEG
        driven = [number for number, request in enumerate(sent) if isinstance(request, MoveTo)]
        if driven and all(isinstance(request, Status) for request in sent[driven[-1] + 1 :]):
            ends.append(len(sent) - driven[-1] - 1)
        rig.now += 1.0
    assert len(ends) > bounds.GOALS / 2
    assert sum(looks == 1 for looks in ends) >= 0.9 * len(ends)


def test_where_the_firmware_ends_pan_and_zoom_itself_the_last_look_is_asked_for_before_they_rest() -> None:
    rig, early = Rig(PROFILES["dahua-pan-only"], 1), []
    rig.calibrate()
    for goal in random_goals(bounds.GOALS, 1):
        sent: list[Reply] = []
        rig.log = sent.append
        assert rig.go(goal).rests
        if [type(reply.request) for reply in sent[-2:]] == [MoveTo, Status]:
            early.append(any(rig.device.motion(sent[-1].sent)[1]))
        rig.now += 1.0
    assert len(early) > bounds.GOALS / 2
    assert sum(early) >= 0.8 * len(early)


@pytest.mark.parametrize("name", ["dahua-pan-only", "ip4m-1041b"])
def test_zoom_that_is_seen_on_its_way_as_reckoned_is_not_waited_for_to_be_looked_at(name: str) -> None:
    rig, ahead, last = Rig(PROFILES[name], 1), 0, 0
    rig.calibrate()
    for goal in random_goals(bounds.GOALS, 1):
        sent: list[Reply] = []
        rig.log = sent.append
        outcome = rig.go(goal)
        assert outcome.rests
        assert outcome.off_zoom < 1.0
        assert rig.near is not None
        assert rig.near.zoom == round(rig.truth()[2] / 2) * 2
        look, moves = sent[-1].sent, sent[-2].received
        (_, _, zoom), turns = rig.device.motion(look)
        if turns[2] and abs(goal[2] - rig.device.motion(moves)[0][2]) > 3.0:
            last += 1
            ahead += abs(goal[2] - zoom) > 0.8
        rig.now += 1.0
    assert last > 4
    assert ahead >= 0.5 * last


def test_answers_that_a_network_holds_up_hardly_delay_the_end() -> None:
    def after_rest(network_s: float) -> float:
        rig, found = Rig(PROFILES["ip4m-1041b"], 1, network_s=network_s), []
        rig.calibrate()
        for goal in random_goals(bounds.GOALS, 1):
            outcome = rig.go(goal)
            assert outcome.rests
            assert outcome.off <= bounds.OFF_DEG
            found.append(rig.now - rig.device.ptz.motors.rests_at)
            rig.now += 1.0
        return mean(found)

    assert after_rest(0.01) < after_rest(0.0) + 0.05


def test_a_zoom_that_still_moves_where_it_should_rest_is_looked_at_until_it_does() -> None:
    motors, skill = Motors(absolute="full", zoom=6.0, zoom_rate=1.0), Skill(zoom_rate=ZoomRate(4.0, 0.05))
    helm, to = Helm(LIMITS.goal(90.0, 20.0, 8.0), LIMITS, skill, inf), (90.0, 20.0, 8.0)
    motors.answer(MoveTo(*to, "PositionABS"))
    motors.pass_time(1.3)
    end = Arriving(helm, to, Glide(998.7, 6.0, 0.0, 8.0, 4.0, 40.0, 998.7), certain=True)
    run, _ = drive(end.at_rest(999.3, 999.3, 1000.0), motors, now=1000.0)
    assert run.error is None
    assert end.seen[0].zoom == 8.0
    assert end.seen[0].moving
    assert not motors.moving


@pytest.mark.parametrize("name", ["ip4m-1041b", "2020s-dahua"])
def test_where_the_firmware_ends_where_it_should_one_look_on_its_last_degree_is_enough(name: str) -> None:
    rig, early = Rig(PROFILES[name], 1), 0
    rig.calibrate()
    for goal in random_goals(bounds.GOALS, 1):
        outcome, off = _went(rig, goal)
        early += off > bounds.OFF_DEG
        assert outcome.rests
        assert outcome.off <= bounds.OFF_DEG
    assert early > bounds.GOALS / 10


def test_after_one_did_not_stay_where_it_should_have_ended_moves_are_looked_at_to_their_end_again() -> None:
    rig, goals = Rig(PROFILES["ip4m-1041b"], 1), iter(random_goals(bounds.GOALS, 1))
    rig.calibrate()
    assert any(_went(rig, goal)[1] > bounds.OFF_DEG for goal in goals)
    rig.client.send(MoveTo(90.0, 45.0, 0.0, "PositionABS"))  # by somebody else, with the camera's own page
    rig.now += 10.0
    rig.near = cast(Reading, rig.client.send(Status()))  # as the service polls it
    assert max(_went(rig, goal)[1] for goal in islice(goals, 3)) <= bounds.OFF_DEG
    assert any(_went(rig, goal)[1] > bounds.OFF_DEG for goal in goals)


def test_one_that_somebody_leads_beside_its_way_is_not_taken_for_one_that_gets_there() -> None:
    rig, led = Rig(PROFILES["ip4m-1041b"], 1), []
    rig.calibrate()
    goals = [goal for goal in random_goals(bounds.GOALS, 1) if min(goal[0], 360.0 - goal[0]) < 165.0]
    for number, goal in enumerate(goals):
        rig.log = partial(_lead_beside, rig, goal, led) if number > len(goals) / 2 else lambda reply: None
        outcome = rig.go(goal)
        assert outcome.rests
        assert outcome.off <= bounds.OFF_DEG
        rig.now += 1.0
    assert len(led) > 5


def _lead_beside(rig: Rig, goal: Goal, led: list[Goal], reply: Reply) -> None:
    """Somebody sends it on to somewhere beside, as soon as it goes."""
    if isinstance(reply.request, MoveTo) and goal not in led:
        led.append(goal)
        rig.client.send(replace(reply.request, pan=(goal[0] + 2.5) % 360.0))


def _went(rig: Rig, goal: Goal) -> tuple[Outcome, float]:
    """One goal, and how far from its rest the camera was in the last look at it, degrees."""
    seen: list[Reading] = []
    rig.log = lambda reply: seen.append(reply.result) if isinstance(reply.result, Reading) else None
    outcome = rig.go(goal)
    rig.now += 1.0
    (pan, tilt, _), truth = LIMITS.pose(seen[-1]), rig.truth()
    return outcome, max(abs(pan - LIMITS.unwrap(truth[0])), abs(tilt - truth[1]))


def test_a_camera_that_was_taken_for_one_that_always_says_it_moves_is_believed_again_when_it_says_it_rests() -> None:
    skill = Skill(always_moving=True)
    skill.hear(True)
    skill.hear(None)
    assert skill.always_moving
    assert not skill.tells_rest(False)
    skill.hear(False)
    assert not skill.always_moving
    assert skill.tells_rest(False)
