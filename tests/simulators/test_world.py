"""The truth hangs together, and its faults are told."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from services.errors import ConfigError
from services.simulators.world import World, load

CONFIG = Path(__file__).parents[2] / "config"


def test_the_optical_axis_goes_through_the_point_that_the_camera_aims_at(world: World) -> None:
    camera = world.cameras["ip1"]
    for place in camera.places.values():
        x, y, z = camera.pose(*camera.aim(place.looks_at)).inverse().apply(np.array(place.looks_at))
        assert abs(x) < 1e-9
        assert abs(y) < 1e-9
        assert z > 0.5


def test_the_places_of_the_configuration_are_those_of_the_world(world: World) -> None:
    positions = yaml.safe_load((CONFIG / "ip1" / "preset_position.yaml").read_text())
    presets = yaml.safe_load((CONFIG / "ip1" / "preset_coords.yaml").read_text())
    camera = world.cameras["ip1"]
    assert list(positions) == list(presets) == list(camera.places)
    for name, place in camera.places.items():
        assert presets[name] == place.preset
        assert positions[name] == pytest.approx([*camera.aim(place.looks_at), 0.0], abs=0.051)


def test_the_calibration_is_the_true_lens_at_half_size(world: World) -> None:
    ost = yaml.safe_load((CONFIG / "ip1" / "ost.yaml").read_text())
    lens = world.cameras["ip1"].lens
    fx, _, cx, _, fy, cy, *_ = ost["camera_matrix"]["data"]
    k = lens.width / ost["image_width"]
    assert (fx * k, fy * k) == pytest.approx((lens.fx, lens.fy), abs=0.01)
    assert ((cx + 0.5) * k - 0.5, (cy + 0.5) * k - 0.5) == pytest.approx((lens.cx, lens.cy), abs=0.01)
    assert ost["distortion_coefficients"]["data"] == pytest.approx(lens.distortion)


def test_marker_582_lies_on_the_living_room_table_and_its_place_is_not_the_first(world: World) -> None:
    marker, table = world.marker(582), next(f for f in world.furniture if f.label == "Living-room table")
    assert marker.size == 0.14
    assert marker.position[2] == pytest.approx(table.z + table.height, abs=0.002)
    assert abs(marker.position[0] - table.x) < table.size[0] / 2
    assert abs(marker.position[1] - table.y) < table.size[1] / 2
    assert list(world.cameras["ip1"].places).index(marker.place) > 0
    assert world.cameras["ip1"].reaches(*world.cameras["ip1"].aim(marker.position))


@pytest.mark.parametrize(
    ("marker", "x", "out"),
    [
        ({"facing": "up"}, (1, 0, 0), (0, 0, 1)),
        ({"facing": "up", "spin_deg": 90}, (0, 1, 0), (0, 0, 1)),
        ({"facing": 0}, (0, 1, 0), (1, 0, 0)),
        ({"facing": -90}, (1, 0, 0), (0, -1, 0)),
        ({"facing": -90, "spin_deg": 90}, (0, 0, 1), (0, -1, 0)),
    ],
)
def test_a_marker_frame_has_x_right_y_up_and_z_out_of_the_print(
    world: World, marker: dict[str, Any], x: tuple[float, ...], out: tuple[float, ...]
) -> None:
    pose = world.marker(17).model_copy(update={"spin_deg": 0.0, **marker}).pose
    assert pose.rotation[:, 0] == pytest.approx(x, abs=1e-12)
    assert pose.rotation[:, 2] == pytest.approx(out, abs=1e-12)
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)


def test_the_robot_stands_on_free_floor_inside_the_living_area(world: World) -> None:
    pose = world.robots["tiago"].pose
    x, y, z = world.map.to_apartment(np.array([[pose.x, pose.y, 0.0]]))[0]
    assert z == 0.0
    outline = np.array(world.rooms["Living"].polygon, np.float32)
    assert cv2.pointPolygonTest(outline, (float(x), float(y)), True) > 0.3


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"sofa": 1}, "sofa: Extra inputs are not permitted, got 1"),
        ({"markers": [{"id": 1, "where": "Roof"}]}, "markers[0].size: Field required"),
        ({"furniture": []}, "markers[0].where: expected one of , got 'Living-room table'"),
        ({"walls": [{"start": [0, 0], "end": [1, 0], "openings": [{"at": 0.5, "width": 1}]}]}, "inside 1.00 m"),
    ],
)
def test_faults_of_a_world_are_told_with_file_and_key(tmp_path: Path, change: dict[str, Any], line: str) -> None:
    path = tmp_path / "world.yaml"
    path.write_text(yaml.safe_dump({**yaml.safe_load((CONFIG / "world.yaml").read_text()), **change}))
    with pytest.raises(ConfigError) as caught:
        load(path)
    told = [fault for fault in caught.value.faults if line in fault]
    assert told, caught.value.faults
    assert all(re.match(rf"{re.escape(str(path))}:\d+: ", fault) for fault in told)


def test_a_place_in_the_dead_arc_is_a_fault(tmp_path: Path) -> None:
    content = yaml.safe_load((CONFIG / "world.yaml").read_text())
    content["cameras"]["ip1"]["places"]["Corner"] = {"preset": 10, "looks_at": [0.3, 0.53, 0.5]}
    path = tmp_path / "world.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError, match=r"places\.Corner\.looks_at: expected readings in reach"):
        load(path)


@pytest.mark.parametrize("text", ["rooms: [", "- 1", ""])
def test_a_file_that_is_no_world_is_a_configuration_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "world.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError):
        load(path)
    with pytest.raises(ConfigError):
        load(tmp_path / "missing.yaml")
