"""What the probe writes makes a stand-in of the camera: probed in virtual time, written down, and probed again."""

from __future__ import annotations

from math import hypot
from typing import Any

import pytest
import yaml

from services.camera.probe import paper
from services.camera.probe.findings import Findings
from services.simulators import camera as simulated
from services.simulators.camera.program import inside
from tests.camera.first_contact import Network, config, probed

DOUBTS = 3.0  # standard deviations
CAMERAS: dict[str, dict[str, Any]] = {
    "quick": {"profile": "ip4m-1041b"},
    "trembling": {"profile": "ip3m-943b"},
    "slow": {"switches": {"pan_speeds": (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0), "tilt_share": 1.2}},
    "late": {"switches": {"latency_s": 0.2, "latency_spread_s": 0.02, "status_lag_s": 0.5}},
    "fresh": {"switches": {"status_lag_s": 0.0, "latency_spread_s": 0.2}},
}


def stand_in(found: Findings) -> simulated.Config:
    return config(**yaml.safe_load(paper.profile(found))["simulators"]["camera"], seed=2)


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_stand_in_turns_and_answers_as_its_camera_does(camera: str) -> None:
    true = config(**CAMERAS[camera])
    found, _ = probed(Network(inside(true, 0.0)))
    made = stand_in(found)
    again, _ = probed(Network(inside(made, 0.0)))
    assert len(found.speeds) == len(again.speeds) == 6
    for one, other in zip(found.speeds, again.speeds, strict=True):
        rate = true.switches.pan_speeds[one.level - 1] * (1.0 if one.axis == "pan" else true.switches.tilt_share)
        assert abs(one.per_s - rate) <= DOUBTS * one.doubt, one
        assert abs(one.per_s - other.per_s) <= DOUBTS * hypot(one.doubt, other.doubt), (one, other)
        assert one.doubt <= max(0.15 * rate, 0.2)
    lag, spread = true.switches.status_lag_s, true.switches.latency_spread_s
    assert made.switches.latency_s == pytest.approx(true.switches.latency_s, abs=0.03)
    assert made.switches.latency_spread_s == pytest.approx(spread, rel=0.3)
    assert made.switches.status_lag_s == pytest.approx(
        true.switches.latency_s if lag is None else lag, abs=0.08 + spread / 2
    )


def test_speeds_that_were_not_measured_are_near_those_of_motors_that_are_known() -> None:
    for true in ((1.0, 3.0, 6.0, 10.0, 16.0, 24.0, 34.0, 45.0), (2.0, 5.0, 9.0, 15.0, 24.0, 36.0, 51.0, 68.0)):
        made = paper.every_level({level: true[level - 1] for level in (1, 3, 5)})
        assert made == pytest.approx(true, rel=0.15)
        assert [made[level - 1] for level in (1, 3, 5)] == [true[level - 1] for level in (1, 3, 5)]


def test_motors_whose_speed_grows_with_the_level_are_told_exactly() -> None:
    assert paper.every_level({1: 4.0, 3: 12.0, 5: 20.0}) == [4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 28.0, 32.0]
    assert min(paper.every_level({1: -0.01, 3: 0.4, 5: 2.0})) > 0  # a reading more or less, where it hardly moves


def test_a_profile_says_what_in_it_is_measured_and_what_is_guessed() -> None:
    turned, _ = probed(Network(inside(config(), 0.0)))
    assert "# pan_speeds: 1, 3, 5 are measured, the others" in paper.profile(turned)
    read, _ = probed(Network(inside(config(), 0.0)), may_move=False)
    assert "pan_speeds" not in paper.switches(read)
    assert "# Speeds were not measured" in paper.profile(read)
