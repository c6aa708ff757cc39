"""Half a minute of faults from one seed, with the whole apartment on real parts.

`make soak PART=chaos` takes ten minutes.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from services.peers import Missing
from tests.chaos import trials
from tests.chaos.plan import CAMERA, GAP_S, WEIGHTS, planned

pytestmark = [pytest.mark.mosquitto, pytest.mark.mariadb, pytest.mark.ros]
SERVICES = ("simulated-camera", "persistence", "bridge")
SEED, SECONDS = 7, 25.0


def test_after_half_a_minute_of_faults_everybody_is_well_and_nothing_is_lost(tmp_path: Path) -> None:
    try:
        with trials.apartment(tmp_path / "apartment") as running:
            trials.chaos(running, SEED, SECONDS)
    except Missing as missing:
        pytest.skip(str(missing))


def test_a_seed_repeats_the_plan() -> None:
    first, second, other = (planned(seed, 600.0, SERVICES, list(WEIGHTS)) for seed in (1, 1, 2))
    assert first == second != other
    assert {stroke.kind for stroke in first} == set(WEIGHTS)
    assert {stroke.whom for one in range(5) for stroke in planned(one, 600.0, SERVICES, ["camera"])} == set(CAMERA)


def test_every_fault_is_over_when_the_plan_is_and_a_disk_is_not_full_while_the_broker_ends() -> None:
    plan = planned(3, 600.0, SERVICES, list(WEIGHTS))
    assert max(stroke.at + stroke.lasts for stroke in plan) <= 600.0
    machine = [stroke for stroke in plan if stroke.kind in ("broker", "database", "disk")]
    assert all(one.at + one.lasts + GAP_S[1] <= after.at for one, after in pairwise(machine))
