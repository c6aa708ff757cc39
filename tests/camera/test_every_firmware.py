"""The orders that firmware takes in ways of its own, on each that the simulator has, over real HTTP."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from services.simulators.camera.firmwares import PROFILES
from tests.camera.bench import Bench, bench, simulator

LATENCY_S = 0.05
MOTORS = [("Goto", "Kitchen"), ("Move", "Right 4 0.5"), ("Zoom", "In"), ("SaveAs", "Here"), ("Goto", "Sofa"),
          ("Zoom", "0"), ("Goto", "Here"), ("Remove", "Here")]  # fmt: skip
LOOKS = [("Mirror", False), ("Flip", False), ("VideoMode", "bw"), ("VideoMode", "scan"), ("VideoMode", "auto")]


@pytest.fixture(params=sorted(PROFILES))
def here(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bench]:
    with (
        simulator(profile=request.param, latency_s=LATENCY_S) as camera,
        bench(tmp_path, camera, picture={"flip": True, "mirror": True}) as running,
    ):
        yield running


def carried_out(here: Bench, orders: list[tuple[str, Any]]) -> list[tuple[str, Any, str, str | None]]:
    """The orders, one after the other, and how each ended."""
    ends = []
    for number, (key, value) in enumerate(orders):
        name = f"{key} {number}"
        here.order(key, value, name)
        end = here.end_of(name, 60)
        ends.append((key, value, end["state"], end["error"]))
        assert end["position"]["moving"] is False
    return ends


def test_motors_and_places(here: Bench) -> None:
    assert carried_out(here, MOTORS) == [(key, value, "done", None) for key, value in MOTORS]
    assert not here.truth()["moving"]
    assert here.truth()["door"]["wrong"] == 0


def test_the_picture_s_options(here: Bench) -> None:
    device = here.camera.server.device
    assert carried_out(here, LOOKS) == [(key, value, "done", None) for key, value in LOOKS]
    assert not device.tables.flag("VideoInOptions[0].Mirror")
    assert not device.tables.flag("VideoInOptions[0].Flip")
    assert carried_out(here, [("Privacy", True)])[0][2] == ("done" if device.profile.lens_mask else "refused")
    assert device.profile.lens_mask == device.tables.covered
