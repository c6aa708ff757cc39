"""Virtual time: the services as they are, minutes in moments, and the same as on the real clock."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.client import Client
from services.payloads import ScanResult
from services.simulated import Simulated
from services.simulators.world import load as load_world
from services.topics import read
from services.virtual import VirtualApartment
from tests.trials import virtual_flat

CONFIG = Path(__file__).parents[1] / "config"


@pytest.fixture
def flat(tmp_path: Path) -> Iterator[VirtualApartment]:
    with virtual_flat(tmp_path) as flat:
        yield flat


def test_a_scan_finds_the_marker_and_takes_as_long_as_motors_and_network_do(flat: VirtualApartment) -> None:
    began = flat.now
    result = flat.order("ip1", "Scan", "ON")
    assert result is not None
    assert result.state == "done"
    assert 5.0 < flat.now - began < 40.0
    found = [read(m, flat.now).payload for m in flat.client.seen if m.topic == "camera/ip1/scan/result"]
    assert [one.marker for one in found] == [582]
    assert _off_by(found[0]) < 0.10


def test_a_place_is_reached_again_from_the_other_side(flat: VirtualApartment) -> None:
    ends = [flat.order("ip1", "Goto", place) for place in ("Kitchen", "Hall", "Kitchen")]
    assert [end.state if end else None for end in ends] == ["done"] * 3
    first, _, last = (end.position for end in ends if end)
    assert first is not None
    assert last is not None
    assert abs(first.pan - last.pan) <= 1.0
    assert abs(first.tilt - last.tilt) <= 1.0


def test_the_same_start_gives_the_same_scan_to_the_millisecond(tmp_path: Path) -> None:
    def scan(folder: Path) -> tuple[float, bytes]:
        with virtual_flat(folder) as flat:
            flat.order("ip1", "Scan", "ON")
            found = next(m for m in flat.client.seen if m.topic == "camera/ip1/scan/result")
            place = read(found, flat.now).payload.position
            return flat.now, place.model_dump_json().encode()

    assert scan(tmp_path / "one") == scan(tmp_path / "two")


def test_half_an_hour_passes_and_every_service_stays_up(flat: VirtualApartment) -> None:
    flat.until(lambda: False, 1800.0)
    states = {topic: m.payload.decode() for topic, m in flat.hub.retained.items() if topic.endswith("/status")}
    assert {text for topic, text in states.items() if topic.startswith("service/")} == {"online"}


def test_virtual_and_real_parts_agree_where_the_marker_is(
    flat: VirtualApartment, simulated_apartment: Simulated, bus_client: Client
) -> None:
    assert bus_client.order("ip1", "Scan", "ON", timeout_s=240.0).state == "done"
    real = bus_client.payload("camera/ip1/scan/result")
    flat.order("ip1", "Scan", "ON")
    virtual = next(read(m, flat.now).payload for m in flat.client.seen if m.topic == "camera/ip1/scan/result")
    assert (virtual.place, virtual.marker) == (real.place, real.marker)
    assert math.dist(_point(virtual), _point(real)) < 0.01


def _point(result: ScanResult) -> tuple[float, float, float]:
    assert result.position is not None
    return result.position.x, result.position.y, result.position.z


def _off_by(result: ScanResult) -> float:
    truth = next(marker for marker in load_world(CONFIG / "world.yaml").markers if marker.id == result.marker)
    assert result.position is not None
    assert result.place == truth.place
    return math.dist(_point(result), truth.position)
