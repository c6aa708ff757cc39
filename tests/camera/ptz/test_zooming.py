"""Zoom at its very widest, which a coarse reading does not tell."""

from __future__ import annotations

from services.camera.ptz.goal import Limits
from services.camera.ptz.move import goto
from services.camera.ptz.skill import Skill
from services.camera.ptz.zooming import widest
from tests.camera.motors import Motors, drive

LIMITS = Limits()


def test_after_zooming_out_it_is_brought_to_the_very_end_where_that_matters() -> None:
    motors, skill = Motors(zoom=6.0, acceleration=90.0, jitter=0.02), Skill()  # answers as even as that: it stays off
    run, took = drive(goto(LIMITS.goal(95.0, 25.0, 0.0), LIMITS, skill, 1060.0), motors)
    assert run.error is None
    assert motors.pose[2] > 0.0
    drive(widest(LIMITS, skill, 1000.0 + took), motors, now=1000.0 + took)
    assert motors.pose[2] == 0.0
    motors.sent.clear()
    drive(widest(LIMITS, skill, 1100.0), motors, now=1100.0)
    assert motors.sent == []


def test_at_the_very_end_it_stays_while_pan_and_tilt_turn() -> None:
    motors, skill = Motors(zoom=6.0, acceleration=90.0), Skill()
    _, took = drive(goto(LIMITS.goal(95.0, 25.0, 0.0), LIMITS, skill, 1060.0), motors)
    drive(widest(LIMITS, skill, 1000.0 + took), motors, now=1000.0 + took)
    run, took = drive(goto(LIMITS.goal(60.0, 40.0, 0.0), LIMITS, skill, 1260.0), motors, now=1200.0)
    assert run.error is None
    motors.sent.clear()
    drive(widest(LIMITS, skill, 1200.0 + took), motors, now=1200.0 + took)
    assert motors.sent == []
