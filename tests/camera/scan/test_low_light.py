"""Scans of a dark room, in virtual time: black and white sees by the camera's own lamp what colour cannot."""

from __future__ import annotations

import json
from math import dist
from pathlib import Path
from typing import Any

import pytest

from services.payloads import ScanState
from services.simulators.world import load
from tests.camera.scan.virtual_scan import VirtualScan, virtual_scan

TARGET, PLACE = 582, "Living room"
NEAR_M = 0.10


def _dark(world: dict[str, Any]) -> None:
    world["light"] = 0.5


def _scan(trial: VirtualScan, mode: str, **more: Any) -> ScanState:
    """A scan that begins in that mode."""
    said = trial.flat.order("ip1", "VideoMode", mode)
    assert said is not None
    assert said.state == "done", said
    _, _, last = trial.run(json.dumps({"targets": [TARGET], "frames": 3, "places": [PLACE], **more}))
    return last


@pytest.mark.parametrize("mode", ["bw", "scan", "auto"])
def test_a_marker_is_found_in_the_dark_in_black_and_white(tmp_path: Path, mode: str) -> None:
    with virtual_scan(tmp_path, world=_dark, second_turn="never") as trial:
        last = _scan(trial, mode)
        assert (last.state, last.found) == ("done", [TARGET])
        (result,) = trial.results()
        truth = load(tmp_path / "config" / "world.yaml").marker(TARGET)
        assert result.position is not None
        assert dist((result.position.x, result.position.y, result.position.z), truth.position) < NEAR_M


def test_in_colour_nothing_is_found_in_the_dark_until_the_second_turn(tmp_path: Path) -> None:
    with virtual_scan(tmp_path, world=_dark, second_turn="never") as trial:
        assert _scan(trial, "color").found == []
        trial.inside.pictures.shine(200.0, trial.flat.now)
        assert _scan(trial, "color").found == [TARGET], "it was the dark"


def test_the_second_turn_finds_what_the_first_could_not_see(tmp_path: Path) -> None:
    with virtual_scan(tmp_path, world=_dark) as trial:
        assert _scan(trial, "color").found == [TARGET]
