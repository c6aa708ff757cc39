"""Zoom at its very widest, which a coarse reading does not tell, and where a late answer let it go too far."""

from __future__ import annotations

from dataclasses import replace

import pytest

from services.camera.device import Reply, Request, Start, Status, Stop
from services.camera.ptz import zoom_drive
from services.camera.ptz.course import PAN
from services.camera.ptz.glide import Glide
from services.camera.ptz.goal import Limits
from services.camera.ptz.move import goto
from services.camera.ptz.skill import Skill
from services.camera.ptz.zoom_rate import ZoomRate
from services.camera.ptz.zooming import widest
from services.simulators.camera.firmwares import PROFILES
from tests.camera.goals import Rig
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


class LateStop(Rig):
    """Answers take the same time but for one: the first stop after `late` is set takes so many seconds more."""

    even, late = False, 0.0

    def _send(self, request: Request, ticket: int) -> Reply:
        if self.even:
            took = self.profile.latency_s
            if isinstance(request, Stop):
                took, self.late = took + self.late, 0.0
            self.device.latency.control = lambda now: took  # type: ignore[method-assign]
        return super()._send(request, ticket)


def test_zoom_that_a_late_answer_let_go_too_far_is_put_right_without_a_look() -> None:
    rig = LateStop(PROFILES["ip3m-943b"], 3)
    rig.calibrate()
    rig.even = True
    pan, tilt = 100.0, 40.0
    rig.go((pan, tilt, 6.0))
    for late in (0.0, 0.8):
        asked: list[type[Request]] = []
        rig.log = lambda reply, asked=asked: asked.append(type(reply.request))  # type: ignore[misc]
        rig.late = late
        outcome = rig.go((pan, tilt, 2.0 if late else 4.0))
        assert outcome.error is None
        assert outcome.off_zoom <= 1.0
        assert asked == ([Start, Stop, Start, Stop, Status] if late else [Start, Stop, Status])


def test_zoom_that_may_have_begun_as_late_as_it_was_answered_may_rest_as_late() -> None:
    skill, soon = Skill(zoom_rate=ZoomRate(4.0, 0.01)), Glide(100.0, 0.0, 0.0, 4.0, 4.0, 40.0, 100.0)
    late, still = replace(soon, answered=100.2), replace(soon, goal=0.0, answered=100.2)
    assert zoom_drive.rests(skill, late) == pytest.approx(zoom_drive.rests(skill, soon) + 0.2)
    assert zoom_drive.rests(skill, still) == 100.0  # it does not turn


@pytest.mark.parametrize("late", [-0.02, 0.0, 0.02])
def test_how_late_zoom_rests_is_said_of_looks_that_all_told_of_another_moment_too(late: float) -> None:
    """They show a motor that is as fast, and takes less time to be so."""
    skill, rate, slows = Skill(), 5.0, 0.14
    glide = Glide(0.0, 0.0, 0.0, 8.0, rate, rate / slows, 0.0)
    skill.paces[PAN].cov[-3, -3] = 0.009**2  # of the age of its readings
    for sweep in range(15):
        for step in range(1, 8, 2):
            before = sweep % 2  # it is read to enter a step
            when = step / rate + slows / 2 - 0.004 * before
            skill.zoom_rate.see(when - late, step - 2 * before, step + 2 - 2 * before)
    assert zoom_drive.rests(skill, glide) > 8.0 / rate + slows
