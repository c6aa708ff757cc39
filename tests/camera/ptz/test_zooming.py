"""Zoom at its very widest, which a coarse reading does not tell, and where a late answer let it go too far."""

from __future__ import annotations

from services.camera.device import Reply, Request, Start, Status, Stop
from services.camera.ptz.goal import Limits
from services.camera.ptz.move import goto
from services.camera.ptz.skill import Skill
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
