"""The report's two files of places."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from services.camera.places import Places
from services.camera.requests import Reading, Refused
from services.errors import ConfigError
from services.payloads import Place


def test_the_reports_files_are_read_and_written_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "preset_position.yaml").write_text("Kitchen: [41.1, 34.5, 0]\nTV: [1, 2]\n")
    (tmp_path / "preset_coords.yaml").write_text("Kitchen: 3\n")
    places = Places(tmp_path)
    assert places.named == {
        "Kitchen": Place(pan=41.1, tilt=34.5, zoom=0.0, preset=3),
        "TV": Place(pan=1.0, tilt=2.0, zoom=0.0),
    }
    places.save("Sofa: left", Place(pan=350.0, tilt=40.0, zoom=2.0, preset=places.free_preset()))
    assert Places(tmp_path).named == places.named
    assert "Kitchen: [41.1, 34.5, 0.0]" in (tmp_path / "preset_position.yaml").read_text()
    assert "'Sofa: left': 1" in (tmp_path / "preset_coords.yaml").read_text()


def test_a_folder_without_files_has_no_places(tmp_path: Path) -> None:
    places = Places(tmp_path / "new")
    assert places.named == {}
    places.save("One", Place(pan=1.0, tilt=2.0))
    places.remove("one")
    assert Places(tmp_path / "new").named == {}


def test_an_edit_by_hand_is_seen(tmp_path: Path) -> None:
    places = Places(tmp_path)
    places.save("One", Place(pan=1.0, tilt=2.0))
    file = tmp_path / "preset_position.yaml"
    file.write_text("One: [5, 6, 0]\n")
    os.utime(file, ns=(1, 1))
    assert places.reload()
    assert places.named["One"].pan == 5.0
    assert not places.reload()


@pytest.mark.parametrize("text", ["One: here\n", "- 1\n", "One: [1, x, 0]\n", "One: [1\n"])
def test_a_fault_is_told_with_its_line_and_the_old_places_stay(tmp_path: Path, text: str) -> None:
    places = Places(tmp_path)
    places.save("One", Place(pan=1.0, tilt=2.0))
    (tmp_path / "preset_position.yaml").write_text(text)
    os.utime(tmp_path / "preset_position.yaml", ns=(1, 1))
    with pytest.raises(ConfigError, match=r"preset_position.yaml:\d+:"):
        places.reload()
    assert places.named["One"].pan == 1.0


def test_a_reading_near_a_place_is_at_that_place_also_across_0(tmp_path: Path) -> None:
    places = Places(tmp_path)
    places.save("Front", Place(pan=359.8, tilt=2.0))
    assert places.at(Reading(0.2, 2.3, 0.0)) == "Front"
    assert places.at(Reading(1.0, 2.0, 0.0)) is None


def test_an_unknown_place_is_refused_with_those_that_there_are(tmp_path: Path) -> None:
    places = Places(tmp_path)
    places.save("Front", Place(pan=1.0, tilt=2.0))
    with pytest.raises(Refused, match="no place 'Back'; there are: Front"):
        places.get("Back")
