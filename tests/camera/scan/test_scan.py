"""Scans of the service in virtual time: which places, in which order, and what is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.camera.flat import Flat

POSITIONS = "Kitchen: [41.1, 34.5, 0]\nSofa: [350.0, 40.0, 0]\nDoor: [200.0, 20.0, 0]\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "preset_position.yaml").write_text(POSITIONS)
    return tmp_path


def visited(flat: Flat) -> list[str]:
    """The places in the order in which the states name them first."""
    return list(dict.fromkeys(one["place"] for one in flat.payloads("scan/state") if one["place"]))


def scanned(flat: Flat) -> Flat:
    flat.order("Scan", "ON")
    flat.until(flat.ended)
    return flat


def test_the_place_that_showed_the_target_last_is_visited_first_in_another_life_too(folder: Path) -> None:
    flat = Flat(folder, places=Path()).online()
    flat.markers[582] = (205.0, 18.0)
    assert visited(scanned(flat))[0] == "Kitchen"
    kept = next(one for one in flat.said if one.topic == "camera/ip1/marker/582")
    later = Flat(folder, places=Path()).online()
    later.send(kept.topic, kept.payload or b"", retain=True)
    later.markers[582] = (205.0, 18.0)
    assert visited(scanned(later)) == ["Door"]
