"""Motors with constants drawn at random: the regulator learns them and arrives, or says why not; nothing turns on."""

from __future__ import annotations

import logging
import random
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from services.camera.device import Identity, MoveTo, Reply, Start, Status
from services.camera.ptz.goal import Limits
from services.camera.ptz.kept import Kept
from services.camera.ptz.move import goto
from services.camera.ptz.skill import Skill
from services.camera.ptz.zoom_rate import ZoomRate
from tests.camera.motors import Motors, drive

LIMITS = Limits()


def any_motors(seed: int) -> Motors:
    """Speeds, delays, lag, accelerations and habits of a camera that nobody has seen."""
    rng = random.Random(seed)
    slowest, ratio = rng.uniform(0.6, 1.4), rng.uniform(1.4, 1.75)
    latency = rng.uniform(0.05, 0.5)
    return Motors(
        mirror=rng.random() < 0.5,
        latency=latency,
        jitter=latency * rng.uniform(0.1, 0.4),
        tail=rng.choice((0.0, 0.02)),
        tail_s=2 * latency,
        acts=rng.uniform(0.6, 1.0),
        lag=rng.choice((None, 0.0, latency, 1.5 * latency)),
        table=tuple(slowest * ratio**step for step in range(8)),
        tilt_share=rng.uniform(0.4, 1.0),
        zoom_rate=rng.uniform(1.0, 5.0),
        zoom_grid=rng.choice((2.0, 1.0, 0.1)),
        acceleration=rng.uniform(40.0, 400.0),
        dither=rng.choice((0.0, 0.1)),
        says=rng.choice(("honest", "idle", "stuck", "nothing")),
        diagonals=rng.random() < 0.8,
        seed=seed,
    )


def goals(seed: int, count: int) -> list[tuple[float, float, float]]:
    rng = random.Random(seed)
    sides = ((0.5, 178.0), (187.0, 359.5))
    return [
        (rng.uniform(*rng.choice(sides)), rng.uniform(-9.0, 107.0), rng.choice((0.0, 4.0, 8.0))) for _ in range(count)
    ]


def off(motors: Motors, pan: float, tilt: float) -> float:
    return max(abs(LIMITS.unwrap(motors.pose[0]) - LIMITS.unwrap(pan)), abs(motors.pose[1] - tilt))


@pytest.mark.parametrize("seed", range(30))
def test_motors_that_nobody_has_seen_are_brought_to_every_goal_or_it_is_said_why_not(seed: int) -> None:
    motors, skill, now, failed = any_motors(seed), Skill(), 1000.0, 0
    motors.now = now
    for pan, tilt, zoom in goals(seed, 8):
        run, took = drive(goto(LIMITS.goal(pan, tilt, zoom), LIMITS, skill, now + 60.0), motors, now=now, limit_s=200)
        now += took
        if run.error is None:
            assert not motors.moving
            assert off(motors, pan, tilt) <= 0.55
        else:
            failed += 1
            assert str(run.error)
            motors.answer(Status())
    assert failed <= 1


def linear(motors: Motors, slowest: float) -> Motors:
    """The same with speeds that are all a multiple of the slowest one, degrees/s."""
    motors.table = tuple(slowest * (step + 1) for step in range(8))
    return replace(motors)


@pytest.mark.parametrize("slowest", [1.5, 5.0, 9.0])
@pytest.mark.parametrize("seed", range(8))
def test_speeds_far_from_the_first_guess_are_learnt(seed: int, slowest: float) -> None:
    motors, skill, now = linear(any_motors(seed), slowest), Skill(), 1000.0
    motors.now = now
    for pan, tilt, zoom in goals(seed, 6):
        run, took = drive(goto(LIMITS.goal(pan, tilt, zoom), LIMITS, skill, now + 90.0), motors, now=now, limit_s=200)
        now += took
        assert run.error is None
        assert off(motors, pan, tilt) <= 0.55
        assert not motors.moving
    assert motors.pushed < 4.0


def test_a_motor_much_slower_than_was_reckoned_from_one_reading_is_not_left_to_turn_blindly() -> None:
    """Of the slow speed that comes last, the first reading teaches next to nothing."""
    motors = any_motors(52)
    motors.now = 1000.0
    seen: list[Reply] = []
    (pan, tilt, zoom), *_ = goals(52, 1)
    run, _ = drive(goto(LIMITS.goal(pan, tilt, zoom), LIMITS, Skill(), 1060.0), motors, limit_s=200, seen=seen.append)
    assert run.error is None
    assert motors.pushed == 0.0
    assert max(after.sent - before.received for before, after in pairwise(seen)) <= 10.0


def test_an_axis_whose_way_nobody_has_seen_is_not_driven_into_its_stop() -> None:
    """One that takes no diagonals shows its axes one after the other, and one of them may stand at its stop."""
    motors = Motors(mirror=False, diagonals=False, tilt=-10.0)
    run, _ = drive(goto(LIMITS.goal(166.0, 68.0, 0.0), LIMITS, Skill(), 1060.0), motors)
    assert run.error is None
    assert off(motors, 166.0, 68.0) <= 0.5
    assert motors.pushed < 3.0


def test_an_axis_that_goes_the_other_way_all_the_time_was_mirrored_meanwhile() -> None:
    motors, skill = Motors(), Skill()
    _, took = drive(goto(LIMITS.goal(80.0, 40.0, 0.0), LIMITS, skill, 1060.0), motors)
    motors.mirror = False
    run, _ = drive(goto(LIMITS.goal(40.0, 70.0, 0.0), LIMITS, skill, 1060.0 + took), motors, now=1000.0 + took)
    assert run.error is None
    assert off(motors, 40.0, 70.0) <= 0.5


def test_a_drive_of_the_firmware_that_takes_much_longer_than_usual_is_followed_to_its_end() -> None:
    motors = Motors(absolute="full", faster=0.1, acceleration=90.0)
    motors.now = 1000.0
    run, _ = drive(goto(LIMITS.goal(60.0, 95.0, 0.0), LIMITS, Skill(), 1120.0), motors)
    assert run.error is None
    assert off(motors, 60.0, 95.0) <= 0.5
    assert not any(isinstance(request, Start) for request in motors.sent)


# In 76 it brakes for longer than all that was read of it tells, in 82 a short leg does not get it going at all.
@pytest.mark.parametrize("seed", [3, 4, 5, 76, 82])
def test_two_readings_in_a_moment_do_not_show_a_camera_at_rest(seed: int) -> None:
    """From a camera that answers in hundredths of a second they are equal while it turns slowly."""
    motors = Motors(latency=0.02, jitter=0.005, says="nothing", acceleration=40.0, seed=seed)
    skill, now = Skill(), 1000.0
    motors.now = now
    for pan, tilt, zoom in goals(seed, 8):
        run, took = drive(goto(LIMITS.goal(pan, tilt, zoom), LIMITS, skill, now + 60.0), motors, now=now)
        now += took
        assert run.error is None
        assert not motors.moving


def test_what_was_learnt_is_known_again_after_a_restart(tmp_path: Path) -> None:
    folder, identity = tmp_path, Identity("M", "S1", "V1")
    motors, skill = Motors(acceleration=90.0), Skill(zoom_rate=ZoomRate(2.0, 0.1))
    drive(goto(LIMITS.goal(10.0, 60.0, 0.0), LIMITS, skill, 1060.0), motors)
    kept = Kept(folder, "ip1")
    kept.recall(identity, skill)
    kept.save(skill)
    kept.written()
    again = Skill()
    Kept(folder, "ip1").recall(identity, again)
    assert again.paces[0].rate(8) == pytest.approx(skill.paces[0].rate(8), abs=1e-6)
    assert again.senses[0] == skill.senses[0]
    assert again.timing.count == skill.timing.count
    assert again.zoom_rate.known() == pytest.approx(skill.zoom_rate.known(), rel=0.05)


def test_a_camera_whose_motors_are_not_known_says_what_would_show_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    identity, hint = Identity("M", "S1", "V1"), "`apartment calibrate ptz ip1`"
    kept = Kept(tmp_path, "ip1")
    kept.recall(identity, Skill())
    assert hint in caplog.text
    kept.save(Skill())
    kept.written()
    caplog.clear()
    Kept(tmp_path, "ip1").recall(identity, Skill())
    assert hint not in caplog.text


def test_another_camera_or_another_firmware_is_learnt_anew(tmp_path: Path) -> None:
    folder = tmp_path
    skill = Skill(diagonals=False)
    kept = Kept(folder, "ip1")
    kept.recall(Identity("M", "S1", "V1"), skill)
    kept.save(skill)
    kept.written()
    for identity in (Identity("M", "S2", "V1"), Identity("M", "S1", "V2")):
        fresh = Skill()
        Kept(folder, "ip1").recall(identity, fresh)
        assert fresh.diagonals


@pytest.mark.parametrize("looks", [0, 1])
def test_what_looks_have_not_told_of_zoom_does_not_fill_the_disk_with_every_move(tmp_path: Path, looks: int) -> None:
    skill, kept = Skill(), Kept(tmp_path, "ip1")
    for _ in range(looks):
        skill.zoom_rate.see(1.0, 1.0, 3.0)
    kept.recall(Identity("M", "S1", "V1"), skill)
    kept.save(skill)
    kept.written()
    assert kept.file is not None
    assert kept.file.stat().st_size < 30_000
    for _ in range(10):  # starts, after each of which it is kept once more
        again, kept = Skill(), Kept(tmp_path, "ip1")
        kept.recall(Identity("M", "S1", "V1"), again)
        assert again.zoom_rate.known() == pytest.approx(skill.zoom_rate.known(), rel=0.1)
        kept.save(again)
        kept.written()


def test_a_file_that_cannot_be_read_is_as_none(tmp_path: Path) -> None:
    folder = tmp_path
    (folder / "cameras").mkdir()
    (folder / "cameras" / "ip1.json").write_text("{")
    Kept(folder, "ip1").recall(Identity("M", "S1", "V1"), Skill())


def test_firmware_that_takes_a_position_is_asked_for_it_and_corrected_where_it_is_beside() -> None:
    motors, skill = Motors(absolute="full", tilt_off=-2.0, acceleration=90.0), Skill()
    now = 1000.0
    motors.now = now
    for number, (pan, tilt) in enumerate([(10.0, 60.0), (300.0, 20.0), (200.0, 80.0)]):
        motors.sent.clear()
        run, took = drive(goto(LIMITS.goal(pan, tilt, 0.0), LIMITS, skill, now + 60.0), motors, now=now)
        now += took
        assert run.error is None
        assert off(motors, pan, tilt) <= 0.5
        assert not any(isinstance(request, Start) for request in motors.sent)
        assert sum(isinstance(request, MoveTo) for request in motors.sent) == (2 if number == 0 else 1)


def test_a_preset_near_the_goal_is_gone_to_first() -> None:
    motors, skill = Motors(presets={3: (300.0, 70.0, 0.0)}, acceleration=90.0), Skill()
    presets = {3: (300.0, 70.0, 0.0)}
    run, _ = drive(goto(LIMITS.goal(300.2, 70.1, 0.0), LIMITS, skill, 1060.0, presets=presets), motors)
    assert run.error is None
    assert off(motors, 300.2, 70.1) <= 0.5
    assert not any(isinstance(request, Start) for request in motors.sent)
