"""The report's mission on real parts: from the bedroom the robot does not see the marker; house and robot find it."""

from __future__ import annotations

import os
import subprocess
import sys
from math import dist
from pathlib import Path

import pytest

from services.payloads.robot import MissionResult
from services.simulators.world import load
from tests.bridge.conftest import ROOT
from tests.mission.trials import BEDROOM, LONGEST_S, flat

pytestmark = [pytest.mark.ros, pytest.mark.mosquitto]


def test_the_house_finds_the_marker_and_the_robot_confirms_it(tmp_path: Path) -> None:
    with flat(tmp_path / "flat", BEDROOM) as running:
        if running.parts.ros is None:
            pytest.skip(next(missing for part, _, missing in running.parts.used if part == "robot"))
        picture = tmp_path / "mission.png"
        command = ("mission", "find", "582", "--json", "--plot", str(picture), "--config", str(running.config))
        environment = {**os.environ, **running.parts.environment}
        done = subprocess.run(
            [sys.executable, "-m", "services", *command],
            env=environment, cwd=ROOT, capture_output=True, text=True, timeout=LONGEST_S,
        )  # fmt: skip
        log = running.log.read_text(errors="replace")
    assert done.returncode == 0, (done.stdout, done.stderr, log[-4000:])
    result = MissionResult.model_validate_json(done.stdout)
    steps = [one.state for one in result.story]
    assert (result.state, result.by) == ("found", "tiago")
    assert "scan" in steps, "the robot alone does not see it from the bedroom"
    assert steps[-2:] == ["look", "found"]
    assert result.position is not None
    truth = load(running.config.with_name("world.yaml")).marker(582).position
    assert dist((result.position.x, result.position.y, result.position.z), truth) < 0.15
    assert picture.read_bytes().startswith(b"\x89PNG")
