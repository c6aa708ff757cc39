"""The real service against the simulated camera, over HTTP: goals, scans, stops, and what is left moving (nothing)."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from math import dist
from pathlib import Path
from typing import Any

import httpx
import pytest

from services import payloads
from services.simulators import camera as simulated
from tests.camera.bench import Bench, bench, simulator


@pytest.fixture
def camera() -> Iterator[simulated.Simulated]:
    with simulator() as running:
        yield running


@pytest.fixture
def here(tmp_path: Path, camera: simulated.Simulated) -> Iterator[Bench]:
    with bench(tmp_path, camera) as running:
        yield running


def apart(one: float, other: float) -> float:
    return abs((one - other + 180) % 360 - 180)


def eventually(happened: Callable[[], bool], limit_s: float) -> None:
    end = time.monotonic() + limit_s
    while not happened():
        assert time.monotonic() < end, f"not within {limit_s} s"
        threading.Event().wait(0.02)


def state(camera: simulated.Simulated) -> dict[str, Any]:
    answer: dict[str, Any] = httpx.get(f"{camera.side_door_url}/state", timeout=30).json()
    return answer


def moving(camera: simulated.Simulated) -> bool:
    return bool(state(camera)["moving"])


def turned(camera: simulated.Simulated) -> float:
    return apart(state(camera)["pose"]["pan"], 0.0)


def test_goals_on_both_sides_of_the_dead_arc_are_reached_within_half_a_degree(here: Bench) -> None:
    for number, (pan, tilt) in enumerate([(30.0, 40.0), (170.0, 10.0), (192.0, 60.0), (300.0, 5.0)]):
        here.look(str(number), pan=pan, tilt=tilt)
        end = here.end_of(str(number), 60)
        pose = here.truth()["pose"]
        assert end["state"] == "done", end
        assert not here.truth()["moving"]
        assert apart(pose["pan"], pan) <= 0.5
        assert abs(pose["tilt"] - tilt) <= 0.5


def test_goto_arrives_at_a_place_and_says_which(here: Bench) -> None:
    here.order("Goto", "Kitchen", "1")
    end = here.end_of("1", 60)
    assert end["state"] == "done", end
    assert end["position"]["place"] == "Kitchen"


def test_a_scan_finds_the_marker_where_the_world_says_it_is(here: Bench) -> None:
    here.order("Scan", "ON", "1")
    end = here.end_of("1", 200)
    assert end["state"] == "done", end
    (raw,) = here.payloads("scan/result")
    result = payloads.ScanResult.model_validate(raw)
    truth = here.world.marker(582)
    assert result.position is not None
    position = (result.position.x, result.position.y, result.position.z)
    assert dist(position, truth.position) < 0.10
    assert result.place == truth.place
    assert set(raw) == set(payloads.ScanResult.model_fields)
    assert result.covariance is not None
    assert here.payloads("marker/582") == [raw]
    assert not here.truth()["moving"]


def test_a_cancelled_scan_stops_the_motors(here: Bench) -> None:
    here.order("Scan", "ON", "1")
    here.until(lambda: here.truth()["moving"], 20)
    here.order("Scan", "OFF", "2")
    assert here.end_of("1", 5)["state"] == "cancelled"
    assert here.end_of("2", 10)["state"] == "done"
    assert not here.truth()["moving"]
    assert here.payloads("scan/state")[-1]["state"] == "cancelled"


def test_a_service_that_ends_in_the_middle_of_a_move_leaves_nothing_moving(
    tmp_path: Path, camera: simulated.Simulated
) -> None:
    with bench(tmp_path, camera) as running:
        running.order("Move", "Left 2 20", "1")
        running.until(lambda: running.truth()["moving"], 10)
        ended = time.monotonic()
    assert time.monotonic() - ended < 5
    assert not running.truth()["moving"]


def test_a_service_that_is_killed_in_the_middle_of_a_move_leaves_nothing_moving(
    tmp_path: Path, camera: simulated.Simulated
) -> None:
    child = subprocess.Popen([sys.executable, "-m", "tests.camera.child", str(tmp_path), camera.url])
    try:
        eventually(lambda: moving(camera), 20)
        eventually(lambda: turned(camera) > 8, 10)
    finally:
        child.kill()
        child.wait(10)
    began = time.monotonic()
    eventually(lambda: not moving(camera), 10)
    assert time.monotonic() - began < 1.5


def test_a_camera_that_is_lost_in_a_move_is_stopped_when_it_is_back(here: Bench) -> None:
    here.order("Move", "Left 1 5", "1")
    here.until(lambda: here.truth()["moving"], 10)
    here.tell("fail", n=8, how="close")
    here.until(lambda: here.payloads("status")[-1]["state"] == "degraded", 30)
    here.until(lambda: here.payloads("status")[-1]["state"] == "online", 30)
    here.until(lambda: not here.truth()["moving"], 5)


def test_a_wrong_password_is_tried_once_and_told(tmp_path: Path, camera: simulated.Simulated) -> None:
    with pytest.raises(AssertionError, match="bad_login"), bench(tmp_path, camera, password="another"):
        pass


@pytest.mark.parametrize("profile", ["ip2m-841b-strict", "2020s-dahua"])
def test_other_firmware_is_driven_too(tmp_path: Path, profile: str) -> None:
    with simulator(profile=profile) as camera, bench(tmp_path, camera) as here:
        here.order("Goto", "Kitchen", "1")
        assert here.end_of("1", 60)["state"] == "done"
        here.order("VideoMode", "bw", "2")
        assert here.end_of("2", 20)["state"] == "done"
