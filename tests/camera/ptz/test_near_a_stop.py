"""Pan and tilt led by start and stop where a stop is near: nothing that may happen on the way pushes against it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from services.camera.device import Reply, Request, Start, Status
from services.camera.ptz.outlook import BLIND_S
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.latency import TAIL
from tests.camera.goals import Goal, Outcome, Rig, random_goals

PROFILE = PROFILES["ip3m-943b"]
PUNCTUAL = replace(PROFILE, latency_tail=0.0)  # none comes late but those that a test makes late
AWAY = (20.0, 40.0, 4.0)


class Unlucky(Rig):
    """The first look of each move is answered as late as can be, and what follows it, too."""

    unlucky = False
    since = 0  # requests since the first look, with that

    def go(self, goal: Goal, near: float = 0.0, **more: Any) -> Outcome:
        self.since = 0
        return super().go(goal, near, **more)

    def _send(self, request: Request, ticket: int) -> Reply:
        if self.since or isinstance(request, Status):
            self.since += 1
        usual = self.device.latency.control
        if self.unlucky and self.since in (1, 2):
            self.device.latency.control = lambda now: TAIL[1] * (PROFILE.latency_s + PROFILE.latency_spread_s)
        try:
            return super()._send(request, ticket)
        finally:
            self.device.latency.control = usual


@pytest.mark.parametrize("tilt", range(86, 108))
def test_a_look_and_what_follows_it_may_both_come_late(tilt: int) -> None:
    rig = Unlucky(PUNCTUAL, 8)
    rig.calibrate()
    for goal in random_goals(8, 8):
        rig.go(goal)
    for pan in range(100, 178, 6):
        rig.unlucky = False
        assert rig.go(AWAY).error is None
        rig.unlucky = True
        outcome = rig.go((float(pan), float(tilt), 2.0))
        assert outcome.error is None
        assert outcome.pushed == 0.0


def test_what_turned_back_twice_has_no_more_room_than_before() -> None:
    """Tilt comes back to a goal a degree before its stop; its next speed is one that may end late there, too."""
    rig = Rig(PROFILES["dahua-pan-only"], 150, network_s=0.004)
    rig.calibrate()
    assert sum(outcome.pushed for outcome in rig.visit(random_goals(36, 150))) == 0.0


def test_nothing_turns_for_long_without_a_look_when_one_axis_has_ended_before_the_other() -> None:
    rig = Rig(PROFILE, 413)
    seen: list[Reply] = []
    rig.calibrate()
    rig.log = seen.append
    for goal in random_goals(50, 413):
        seen.clear()
        rig.go(goal)
        began: float | None = None
        for reply in seen:
            if isinstance(reply.request, Start) and any(reply.request.direction.value[:2]):
                began = reply.received if began is None else began
            elif began is not None:
                assert reply.sent - began < BLIND_S + 1.0, goal
                began = reply.received if isinstance(reply.request, Status) else None
