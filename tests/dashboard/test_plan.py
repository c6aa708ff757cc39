"""The plan: what the files say, and their faults."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from services import dashboard
from services.apartment.floor import FREE, OCCUPIED, UNKNOWN, Grid
from services.config import load
from services.dashboard import chart, plan
from services.dashboard.settings import Config
from services.errors import ConfigError
from tests.dashboard.parts import configured


@pytest.fixture
def config(tmp_path: Path) -> Config:
    return configured(tmp_path, 1)


def test_the_simulated_apartment_is_described(config: Config) -> None:
    told, maps = plan.described(config)
    assert told["rooms"]["kitchen"] == "Kitchen"
    assert told["items"]["Kitchen_Light"]["room"] == "kitchen"
    assert told["cameras"][0]["mount"]["yaw_deg"] == 35.0
    assert 85 < told["cameras"][0]["lens"]["across_deg"] < 95
    assert told["robots"][0]["map"]
    assert maps["tiago"].startswith(b"\x89PNG")
    assert "password" not in str(told).lower()


def test_a_map_is_a_picture_whose_occupied_cells_are_seen(tmp_path: Path) -> None:
    cells = np.array([[OCCUPIED, FREE], [UNKNOWN, FREE], [FREE, 50]], np.int8)
    file = tmp_path / "map.png"
    file.write_bytes(chart.picture(Grid(cells, 0.05, (0.0, 0.0))))
    picture = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    assert picture[..., 3].tolist() == [[0, 127], [0, 0], [255, 0]]  # the top row first


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("rooms: {cellar: [[0, 0], [1, 0], [1, 1]]}", "plan.yaml:1: rooms.cellar: expected one of the rooms"),
        ("at:\n  Nothing: [0, 0]", "plan.yaml:2: at.Nothing: expected a thing or an item"),
        ("furniture: [{at: [0, 0], size: [1]}]", "plan.yaml:1: furniture[0].size"),
        ("walls: []", "plan.yaml:1: walls"),
        ("rooms: [", "plan.yaml"),
    ],
)
def test_every_fault_of_the_plan_is_told_with_its_line(config: Config, text: str, fault: str) -> None:
    (config.folder / "plan.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as told:
        dashboard.check(config)
    assert fault in "\n".join(told.value.faults)


def test_a_password_that_is_not_hashed_is_told_and_not_shown(config: Config) -> None:
    file = config.folder / "simulated.yaml"
    text = file.read_text(encoding="utf-8")
    head, _, rest = text.partition("\ndashboard:")
    users = "\n  users:\n    ann: {role: operator, password: open-sesame}\n"
    file.write_text(f"{head}\ndashboard:{users}{rest.partition(chr(10))[2]}", encoding="utf-8")
    with pytest.raises(ConfigError) as told:
        load(file, environment={})
    (fault,) = [one for one in told.value.faults if "users" in one]
    assert "dashboard.users.ann.password: expected a hash" in fault
    assert "sesame" not in str(told.value.faults)
