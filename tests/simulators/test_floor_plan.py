"""The floor plan that is shipped is that of the world."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from services.simulators import floor_plan
from services.simulators.world import load

CONFIG = Path(__file__).parents[2] / "config"
WORLD = load(CONFIG / "world.yaml")


def test_the_shipped_map_is_drawn_from_the_world(tmp_path: Path) -> None:
    floor_plan.write(WORLD, tmp_path)
    for name in ("map.pgm", "map.yaml"):
        assert (tmp_path / name).read_bytes() == (CONFIG / name).read_bytes(), "floor_plan.write(world, Path('config'))"
    assert np.array_equal(cv2.imread(str(CONFIG / "map.pgm"), cv2.IMREAD_GRAYSCALE), floor_plan.drawn(WORLD))


@pytest.mark.parametrize(
    ("what", "x", "y", "value"),
    [
        ("the west wall", -0.05, 3.0, floor_plan.OCCUPIED),
        ("below a window", 8.05, 4.4, floor_plan.OCCUPIED),
        ("the front door", 4.7, -0.05, floor_plan.OCCUPIED),
        ("the passage to the bedroom", 5.6, 3.1, floor_plan.FREE),
        ("the fridge", 0.34, 5.62, floor_plan.OCCUPIED),
        ("the rug", 3.3, 3.6, floor_plan.FREE),
        ("the street", -0.5, 3.0, floor_plan.UNKNOWN),
    ],
)
def test_things_are_where_they_stand(what: str, x: float, y: float, value: int) -> None:
    picture = floor_plan.drawn(WORLD)
    on_map = WORLD.map.apartment_to_map.transform.apply(np.array([x, y, 0.0]))
    column, row = ((on_map[axis] - WORLD.map.origin[axis]) / WORLD.map.resolution for axis in (0, 1))
    assert picture[picture.shape[0] - 1 - int(row), int(column)] == value, what
