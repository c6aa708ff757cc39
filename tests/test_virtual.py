"""Virtual time: the services as they are, minutes in moments, and the same as on the real clock."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.payloads import ScanResult
from services.simulators.world import load as load_world
from services.topics import read
from services.virtual import VirtualApartment

CONFIG = Path(__file__).parents[1] / "config"


@pytest.fixture
def flat(tmp_path: Path) -> Iterator[VirtualApartment]:
    config = Path(shutil.copytree(CONFIG, tmp_path / "config")) / "simulated.yaml"
    environment = {"APARTMENT_DATABASE": f"sqlite:///{tmp_path}/bus.db", "APARTMENT_WITHOUT_ROS": "true"}
    with VirtualApartment(config, environment) as flat:
        assert flat.until(lambda: _status(flat) == "online", 30.0)
        yield flat


def _status(flat: VirtualApartment) -> str | None:
    message = flat.hub.retained.get("camera/ip1/status")
    return read(message, flat.now).payload.state if message else None


def test_a_scan_finds_the_marker_and_takes_as_long_as_motors_and_network_do(flat: VirtualApartment) -> None:
    began = flat.now
    result = flat.order("ip1", "Scan", "ON")
    assert result is not None
    assert result.state == "done"
    assert 8.0 < flat.now - began < 40.0
    found = [read(m, flat.now).payload for m in flat.client.seen if m.topic == "camera/ip1/scan/result"]
    assert [one.marker for one in found] == [582]
    assert _off_by(found[0]) < 0.10


def test_the_same_seed_gives_the_same_scan(flat: VirtualApartment) -> None:
    first = flat.order("ip1", "Goto", "Kitchen")
    second = flat.order("ip1", "Goto", "Sofa")
    third = flat.order("ip1", "Goto", "Kitchen")
    assert first is not None
    assert second is not None
    assert third is not None
    assert [one.state for one in (first, second, third)] == ["done"] * 3
    assert first.position is not None
    assert third.position is not None
    assert abs(first.position.pan - third.position.pan) <= 1.0


def test_a_day_of_the_home_passes_and_every_service_stays_up(flat: VirtualApartment) -> None:
    flat.until(lambda: False, 1800.0)
    states = {topic: m.payload.decode() for topic, m in flat.hub.retained.items() if topic.endswith("/status")}
    assert {text for topic, text in states.items() if topic.startswith("service/")} == {"online"}
    assert flat.hub.retained["diagnostics/service/camera-ip1"].received <= flat.now


def _off_by(result: ScanResult) -> float:
    truth = next(marker for marker in load_world(CONFIG / "world.yaml").markers if marker.id == result.marker)
    assert result.position is not None
    assert result.place == truth.place
    return math.dist((result.position.x, result.position.y, result.position.z), truth.position)
