"""Privacy, video modes and the clock by orders, on the simulated camera: the effect there, and the answers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from services.simulators import camera as simulated
from tests.camera.bench import Bench, bench, simulator

WAIT_S = 20.0


@pytest.fixture(params=["ip3m-941w-2019", "ip2m-841b-strict", "2020s-dahua"])
def camera(request: pytest.FixtureRequest) -> Iterator[simulated.Simulated]:
    with simulator(latency_s=0.02, profile=request.param) as running:
        yield running


@pytest.fixture
def here(tmp_path: Path, camera: simulated.Simulated) -> Iterator[Bench]:
    with bench(tmp_path, camera) as running:
        yield running


def done(here: Bench, key: str, value: str, number: int = 1) -> dict[str, Any]:
    here.order(key, value, str(number))
    return here.end_of(str(number), WAIT_S)


def table(here: Bench, key: str) -> str:
    return here.camera.server.device.tables.text(key)


def test_the_scan_mode_is_set_and_left_again(here: Bench) -> None:
    assert done(here, "VideoMode", "scan")["state"] == "done"
    assert table(here, "VideoColor[0][0].Contrast") == "80"
    assert done(here, "VideoMode", "color", 2)["state"] == "done"
    assert table(here, "VideoColor[0][0].Contrast") == "50"


def test_privacy_is_switched_where_there_is_one_and_refused_elsewhere(here: Bench) -> None:
    end = done(here, "Privacy", "ON")
    if here.camera.server.device.tables.read("LeLensMask"):
        assert (end["state"], table(here, "LeLensMask[0].Enable")) == ("done", "true")
        assert done(here, "Privacy", "OFF", 2)["state"] == "done"
        assert table(here, "LeLensMask[0].Enable") == "false"
    else:
        assert end["state"] == "refused"
        assert "privacy" in end["error"]


def test_a_clock_that_is_wrong_is_set_and_the_card_is_told(tmp_path: Path, camera: simulated.Simulated) -> None:
    httpx.post(f"{camera.side_door_url}/clock", json={"offset_s": -5000}, timeout=30).raise_for_status()
    httpx.post(f"{camera.side_door_url}/card", json={"in": True}, timeout=30).raise_for_status()
    with bench(tmp_path, camera) as here:
        facts = here.service.bulletin.facts
        here.until(lambda: {"time_drift_s", "storage"} <= set(facts.values), WAIT_S)
        assert abs(float(facts.values["time_drift_s"])) < 2.0
        assert facts.values["storage"] != "none"


def test_motion_before_the_lens_is_told(here: Bench) -> None:
    here.until(lambda: here.payloads("motion") != [], WAIT_S)
    here.tell("stir", seconds=1.0)
    here.until(lambda: here.payloads("motion")[-1]["value"] == 1, WAIT_S)


def test_the_diagnostics_have_the_reports_set(here: Bench) -> None:
    def values() -> dict[str, str]:
        said = [one for one in here.said if one.topic == "diagnostics/camera/ip1"]
        found: dict[str, str] = json.loads(said[-1].payload)["values"] if said else {}
        return found

    wanted = {"http_latency_ms", "request_queue", "stream", "alarm", "storage", "firmware", "time_drift_s"}
    here.until(lambda: wanted <= set(values()), WAIT_S)
