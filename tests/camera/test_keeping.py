"""Saving and removing places in virtual time: which of the camera's presets they get, and whose are left alone."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import pytest
import yaml

from services.camera.capabilities import Capabilities
from services.camera.device import Away, BadLogin, ClearPreset, Refused, SavePreset, Start, Stop, TurnFor
from services.camera.errands import GetPresets
from services.errors import DeviceError
from tests.camera.flat import Flat

DOOR, BED = (200.0, 20.0, 0.0), (300.0, 50.0, 2.0)  # of the owner, who made them elsewhere


@pytest.fixture
def flat(tmp_path: Path) -> Flat:
    here = Flat(tmp_path, places=Path())
    here.motors.presets.update({1: DOOR, 2: BED})
    return here.online()


def carry_out(flat: Flat, key: str, name: str, order_id: str = "1") -> str:
    """How it ended."""
    flat.order(key, name, order_id=order_id)
    flat.until(lambda: flat.ended(order_id))
    return flat.states(order_id)[-1]


def numbers(flat: Flat, kind: type[SavePreset] | type[ClearPreset]) -> list[int]:
    return [one.number for one in flat.motors.sent if isinstance(one, kind)]


def questions(flat: Flat) -> int:
    return sum(isinstance(one, GetPresets) for one in flat.camera.errands)


def file(folder: Path, name: str) -> Any:
    return yaml.safe_load((folder / f"preset_{name}.yaml").read_text())


def failing(flat: Flat, error: DeviceError) -> None:
    def answer(asked: Any) -> object:
        return error

    flat.camera.answers[GetPresets] = answer


def test_a_place_gets_a_preset_that_nobody_has_and_gives_only_that_back(flat: Flat) -> None:
    assert carry_out(flat, "SaveAs", "Kitchen", "a") == "done"
    assert flat.service.places.named["Kitchen"].preset == 3
    assert set(flat.motors.presets) == {1, 2, 3}
    assert carry_out(flat, "Remove", "Kitchen", "b") == "done"
    assert flat.motors.presets == {1: DOOR, 2: BED}


@pytest.mark.parametrize("save_first", [False, True])
def test_who_turns_the_camera_is_not_stopped_for_a_place_and_it_is_not_saved_on_the_way(
    flat: Flat, save_first: bool
) -> None:
    if save_first:
        flat.order("SaveAs", "Kitchen", order_id="save")
    flat.order("Move", "Left 4 6", order_id="move")
    if not save_first:
        flat.order("SaveAs", "Kitchen", order_id="save")
    flat.until(lambda: flat.ended("move") and flat.ended("save"))
    assert flat.states("move")[-1] == "done"
    assert flat.states("save")[-1] == "refused"
    assert "moving" in flat.last("save")["error"]
    assert numbers(flat, SavePreset) == []
    first = next(at for at, one in enumerate(flat.motors.sent) if isinstance(one, Start | TurnFor))
    assert sum(isinstance(one, Stop) for one in flat.motors.sent[first:]) == 1


def test_a_place_that_is_saved_again_keeps_its_preset_and_nothing_is_asked(flat: Flat) -> None:
    for order_id in ("a", "b", "c"):
        carry_out(flat, "SaveAs", "Kitchen", order_id)
    assert numbers(flat, SavePreset) == [3, 3, 3]
    assert questions(flat) == 1


def test_a_preset_of_ours_that_somebody_cleared_is_made_again(flat: Flat) -> None:
    carry_out(flat, "SaveAs", "Kitchen", "a")
    del flat.motors.presets[3]
    carry_out(flat, "SaveAs", "Kitchen", "b")
    assert set(flat.motors.presets) == {1, 2, 3}


def test_nothing_is_asked_while_nothing_is_saved(flat: Flat) -> None:
    carry_out(flat, "SaveAs", "Kitchen", "a")
    carry_out(flat, "Remove", "Kitchen", "b")
    flat.run(120)
    assert questions(flat) == 1


UNKNOWN = [
    Refused("the camera answered 400 Error Bad Request!"),
    Refused("ONVIF has no GetPresets"),
    BadLogin("the camera does not accept this user and password"),
    Away("the camera answered 500"),  # to this question; it says where it looks
]


@pytest.mark.parametrize("error", UNKNOWN, ids=str)
def test_where_the_presets_are_not_told_a_place_is_only_its_coordinates_and_that_is_logged_once(
    flat: Flat, tmp_path: Path, error: DeviceError, caplog: pytest.LogCaptureFixture
) -> None:
    failing(flat, error)
    with caplog.at_level(logging.WARNING, "services.camera.keeping"):
        assert carry_out(flat, "SaveAs", "Kitchen", "a") == "done"
        flat.until(lambda: flat.service.health.online, 600)
        assert carry_out(flat, "SaveAs", "Sofa", "b") == "done"
    (line,) = [one.getMessage() for one in caplog.records if one.name == "services.camera.keeping"]
    assert "without a preset" in line
    assert str(error) in line
    assert numbers(flat, SavePreset) == []
    assert file(tmp_path, "position") == {"Kitchen": [90.0, 20.0, 0.0], "Sofa": [90.0, 20.0, 0.0]}
    assert file(tmp_path, "coords") == {}
    assert flat.payloads("places")[-1]["Kitchen"]["preset"] is None


def test_a_place_without_a_preset_is_gone_to_removed_and_gets_one_when_it_is_saved_again(flat: Flat) -> None:
    failing(flat, Refused("not now"))
    carry_out(flat, "SaveAs", "Kitchen", "a")
    carry_out(flat, "Move", "Left 4 1", "b")
    assert carry_out(flat, "Goto", "Kitchen", "c") == "done"
    assert abs(flat.reading.pan - 90.0) <= 0.5
    carry_out(flat, "SaveAs", "Sofa", "d")
    assert carry_out(flat, "Remove", "Sofa", "e") == "done"
    assert numbers(flat, ClearPreset) == []
    flat.camera.answers[GetPresets] = lambda asked: frozenset(flat.motors.presets)
    carry_out(flat, "SaveAs", "Kitchen", "f")
    assert flat.service.places.named["Kitchen"].preset == 3


def test_nothing_is_saved_when_the_camera_is_lost_at_the_question(flat: Flat) -> None:
    def lost(asked: Any) -> object:
        flat.camera.away = Away("no answer from the camera")
        return flat.camera.away

    flat.camera.answers[GetPresets] = lost
    assert carry_out(flat, "SaveAs", "Kitchen") == "failed"
    assert flat.service.places.named == {}
    assert numbers(flat, SavePreset) == []


@pytest.mark.parametrize(("most", "number"), [(3, 3), (2, None), (0, 3)])
def test_a_number_above_what_the_camera_can_keep_is_not_tried(flat: Flat, most: int, number: int | None) -> None:
    flat.service.abilities.present = Capabilities(presets=most)
    assert carry_out(flat, "SaveAs", "Kitchen") == "done"
    assert flat.service.places.named["Kitchen"].preset == number
    assert numbers(flat, SavePreset) == ([] if number is None else [number])


@pytest.mark.parametrize(("names", "kept"), [(("Kitchen", "Sofa"), {3, 4}), (("Kitchen", "Kitchen"), {3})])
def test_places_that_are_saved_at_once_do_not_share_a_preset(
    flat: Flat, names: tuple[str, str], kept: set[int]
) -> None:
    for order_id, name in zip("ab", names, strict=True):
        flat.order("SaveAs", name, order_id=order_id)
    flat.until(lambda: flat.ended("a") and flat.ended("b"))
    assert {place.preset for place in flat.service.places.named.values()} == kept
    assert set(flat.motors.presets) == {1, 2} | kept


def by_hand(folder: Path, positions: str, presets: str) -> Flat:
    (folder / "preset_position.yaml").write_text(positions)
    (folder / "preset_coords.yaml").write_text(presets)
    return Flat(folder, places=Path()).online()


def test_a_preset_that_two_places_share_by_hand_is_cleared_with_the_last_of_them(tmp_path: Path) -> None:
    flat = by_hand(tmp_path, "Kitchen: [1, 2, 0]\nStove: [1, 2, 0]\n", "Kitchen: 4\nStove: 4\n")
    carry_out(flat, "Remove", "Stove", "a")
    assert numbers(flat, ClearPreset) == []
    carry_out(flat, "Remove", "Kitchen", "b")
    assert numbers(flat, ClearPreset) == [4]


def test_the_files_keep_what_was_written_by_hand_beside_a_place_without_a_preset(tmp_path: Path) -> None:
    flat = by_hand(tmp_path, "Kitchen: [1, 2, 0]\nTV: [3, 4]\n", "Kitchen: 40\nBalcony: 1\n")
    failing(flat, Refused("not here"))
    carry_out(flat, "SaveAs", "Sofa")
    assert file(tmp_path, "position") == {"Kitchen": [1, 2, 0], "TV": [3, 4, 0], "Sofa": [90.0, 20.0, 0.0]}
    assert file(tmp_path, "coords") == {"Kitchen": 40, "Balcony": 1}
