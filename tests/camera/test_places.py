"""The report's two files of places."""

from __future__ import annotations

import errno
import multiprocessing
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.camera.device import Reading, Refused
from services.camera.places import MOST, Places, name_of
from services.errors import ConfigError, DeviceError
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


def test_a_folder_that_cannot_be_written_is_told_and_changes_nothing(tmp_path: Path) -> None:
    places = Places(tmp_path)
    places.save("One", Place(pan=1.0, tilt=2.0))
    (tmp_path / "preset_position.yaml").unlink()
    (tmp_path / "preset_position.yaml").mkdir()
    (tmp_path / "preset_position.yaml" / "in the way").touch()
    places._read_at = places._state()
    with pytest.raises(DeviceError, match="cannot be written"):
        places.save("Two", Place(pan=1.0, tilt=2.0))
    assert list(places.named) == ["One"]


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


class Vanishing(type(Path())):  # type: ignore[misc]
    """A file that somebody takes away as soon as it was seen."""

    def exists(self, **how: bool) -> bool:
        found = super().exists(**how)
        self.unlink(missing_ok=True)
        return bool(found)


def test_a_file_that_vanishes_while_it_is_looked_at_breaks_nothing(tmp_path: Path) -> None:
    places = Places(Vanishing(tmp_path))
    for file in ("preset_position.yaml", "preset_coords.yaml"):
        (tmp_path / file).write_text("{}\n")
    places.reload()


class Shut(type(Path())):  # type: ignore[misc]
    """In a folder that was closed to us."""

    shut = False

    def stat(self, **how: bool) -> os.stat_result:
        if Shut.shut:
            raise PermissionError(errno.EACCES, "Permission denied")
        return super().stat(**how)  # type: ignore[no-any-return]


def test_a_folder_that_is_closed_is_told_once_and_the_old_places_stay(tmp_path: Path) -> None:
    places = Places(Shut(tmp_path))
    places.save("One", Place(pan=1.0, tilt=2.0))
    Shut.shut = True
    with pytest.raises(ConfigError, match="Permission denied"):
        places.reload()
    assert not places.reload()
    Shut.shut = False
    assert places.reload()
    assert list(places.named) == ["One"]


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


ODD = [
    "yes", "No", "null", "~", "007", "1.50", "1e3", "2026-01-31", "true", "<<", "=", "- x", "-", "? x", "a: b", "#c",
    "'q'", '"', "%TAG", "@x", "`x", "{a}", "[b]", "&a", "*b", "!c", "|", ">", "Wohnküche", "厨房", "مطبخ",
    "👩\u200d🍳", "a\u00a0b", "Sofa, left", "\\n", "é" * 80,
]  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_a_place_may_have_any_name_and_is_read_back_under_it(tmp_path: Path, name: str) -> None:
    assert name_of(name) == name
    Places(tmp_path).save(name, Place(pan=1.0, tilt=2.0, preset=7))
    again = Places(tmp_path)
    assert again.named == {name: Place(pan=1.0, tilt=2.0, preset=7)}
    again.remove(name)
    assert Places(tmp_path).named == {}


@given(st.text(max_size=90))
def test_what_passes_for_a_name_survives_the_file(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    try:
        name = name_of(text)
    except ValueError:
        return
    folder = tmp_path_factory.mktemp("places")
    Places(folder).save(name, Place(pan=1.0, tilt=2.0, preset=7))
    assert Places(folder).named == {name: Place(pan=1.0, tilt=2.0, preset=7)}


@pytest.mark.parametrize("text", ["", "  ", "a\nb", "a\tb", "\x00", "a\x7f", "a\x85b", "\u2028", "x" * 81, "\ud800"])
def test_control_characters_and_nothing_at_all_are_no_name(text: str) -> None:
    if text == "\u2028":
        text = "a\u2028b"
    with pytest.raises(ValueError, match="no control characters"):
        name_of(text)


def test_names_written_by_hand_without_quotes_are_what_they_look_like(tmp_path: Path) -> None:
    (tmp_path / "preset_position.yaml").write_text(
        "007: [1, 2, 0]\nyes: [3, 4, 0]\n~: [5, 6, 0]\n2026-01-31: [7, 8, 0]\n"
    )
    (tmp_path / "preset_coords.yaml").write_text("'007': 3\n\"yes\": 4\n")
    named = Places(tmp_path).named
    assert list(named) == ["007", "yes", "~", "2026-01-31"]
    assert (named["007"].preset, named["yes"].preset) == (3, 4)


@pytest.mark.parametrize("text", ["Kitchen: three\n", "Kitchen: true\n", "Kitchen: [3]\n", "- 3\n", "? [a]\n: 3\n"])
def test_a_fault_in_the_file_of_presets_is_told_with_its_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "preset_coords.yaml").write_text(text)
    with pytest.raises(ConfigError, match=r"preset_coords.yaml:1: "):
        Places(tmp_path)


def test_a_preset_without_a_position_stays_in_its_file_and_its_number_is_not_used_again(tmp_path: Path) -> None:
    (tmp_path / "preset_coords.yaml").write_text("Balcony: 1\n")
    places = Places(tmp_path)
    assert places.named == {}
    places.save("Sofa", Place(pan=1.0, tilt=2.0, preset=places.free_preset()))
    assert (tmp_path / "preset_coords.yaml").read_text() == "Sofa: 2\nBalcony: 1\n"
    places.save("Balcony", Place(pan=3.0, tilt=4.0, preset=1))
    assert Places(tmp_path).named["Balcony"] == Place(pan=3.0, tilt=4.0, preset=1)


@pytest.mark.parametrize(
    ("kept", "most", "free"),
    [((), 0, 3), ({1, 3, 4}, 0, 5), ({3, 5}, 25, 4), ({3, 4}, 4, None), ((), 2, None), ({7, 300}, 3, 3)],
)
def test_a_free_preset_is_nobodys_and_one_that_the_camera_can_keep(
    tmp_path: Path, kept: set[int], most: int, free: int | None
) -> None:
    (tmp_path / "preset_position.yaml").write_text("Sofa: [1, 2, 0]\nTV: [3, 4, 0]\n")
    (tmp_path / "preset_coords.yaml").write_text("Sofa: 2\nBalcony: 1\n")
    assert Places(tmp_path).free_preset(kept, most) == free


def test_a_place_that_was_added_by_hand_a_moment_ago_is_not_lost(tmp_path: Path) -> None:
    places = Places(tmp_path)
    places.save("One", Place(pan=1.0, tilt=2.0))
    with (tmp_path / "preset_position.yaml").open("a") as file:
        file.write("Two: [5, 6, 0]\n")
    places.save("Three", Place(pan=3.0, tilt=4.0))
    assert list(Places(tmp_path).named) == ["One", "Two", "Three"]


def test_nothing_is_saved_over_a_file_that_was_spoilt_by_hand(tmp_path: Path) -> None:
    places = Places(tmp_path)
    places.save("One", Place(pan=1.0, tilt=2.0))
    (tmp_path / "preset_position.yaml").write_text("One: [1, 2\n")
    with pytest.raises(ConfigError):
        places.reload()
    for _ in range(2):
        with pytest.raises(Refused, match=r"cannot be read: .*preset_position.yaml:\d+:"):
            places.save("Two", Place(pan=3.0, tilt=4.0))
    assert (tmp_path / "preset_position.yaml").read_text() == "One: [1, 2\n"
    (tmp_path / "preset_position.yaml").write_text("One: [1, 2]\n")
    places.save("Two", Place(pan=3.0, tilt=4.0))
    assert list(Places(tmp_path).named) == ["One", "Two"]


def save_many(folder: Path, first: int) -> None:
    places = Places(folder)
    for number in range(first, first + 20):
        places.save(f"Place {number}", Place(pan=float(number), tilt=0.0))


def test_two_processes_that_save_at_once_lose_nothing_of_each_other(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    others = [context.Process(target=save_many, args=(tmp_path, first)) for first in (0, 100)]
    for one in others:
        one.start()
    for one in others:
        one.join(30)
    assert [one.exitcode for one in others] == [0, 0]
    assert len(Places(tmp_path).named) == 40


def test_whoever_saves_on_and_on_is_stopped(tmp_path: Path) -> None:
    (tmp_path / "preset_position.yaml").write_text("".join(f"p{n}: [1, 2, 0]\n" for n in range(MOST)))
    places = Places(tmp_path)
    place = Place(pan=1, tilt=2, zoom=0, preset=None)
    with pytest.raises(Refused, match="remove one"):
        places.save("one more", place)
    places.save("p0", place)
    places.remove("p1")
    places.save("one more", place)
    assert len(places.named) == MOST
