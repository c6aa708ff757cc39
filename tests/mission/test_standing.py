"""Where a robot may stand: free, within its reach, and facing the marker."""

from __future__ import annotations

from math import atan2, degrees, hypot
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.apartment import floor, robot_places
from services.apartment.floor import FREE, OCCUPIED, UNKNOWN, Grid
from services.errors import ConfigError
from services.mission.standing import ANY, Pose, View, body, stands
from services.simulators.robot import plan
from services.simulators.world import load

CONFIG = Path(__file__).parents[2] / "config"
RADIUS = 0.28


def room(boxes: list[tuple[float, float, float, float]], size: float = 6.0, resolution: float = 0.05) -> Grid:
    """A square room with walls round it; boxes are x, y, width, height in metres."""
    count = round(size / resolution)
    cells = np.full((count, count), FREE, np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    for x, y, width, height in boxes:
        left, low, right, high = (round(value / resolution) for value in (x, y, x + width, y + height))
        cells[low:high, left:right] = OCCUPIED
    return Grid(cells, resolution, (-1.0, -2.0))


def gap(grid: Grid, pose: Pose) -> float:
    """Metres from a pose to the nearest cell that is not free, by looking at every one."""
    rows, columns = np.nonzero(grid.cells != FREE)
    dx = np.abs(grid.origin[0] + (columns + 0.5) * grid.resolution - pose.x) - grid.resolution / 2
    dy = np.abs(grid.origin[1] + (rows + 0.5) * grid.resolution - pose.y) - grid.resolution / 2
    return float(np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)).min())


pieces = st.tuples(st.floats(0.2, 5.0), st.floats(0.2, 5.0), st.floats(0.1, 1.5), st.floats(0.1, 1.5))
spots = st.tuples(st.floats(-0.5, 4.5), st.floats(-1.5, 3.5))


@st.composite
def maps(draw: st.DrawFn) -> Grid:
    """A room with walls round it, things in it, perhaps a wall across it that has a door, and corners unknown."""
    grid = room(draw(st.lists(pieces, max_size=6)), resolution=draw(st.sampled_from([0.05, 0.1])))
    per_m = round(1 / grid.resolution)
    if (row := draw(st.none() | st.integers(2, 4))) is not None:
        door = round(draw(st.floats(0.2, 4.8)) * per_m)
        kept = grid.cells[row * per_m, door : door + per_m].copy()
        grid.cells[row * per_m] = OCCUPIED
        grid.cells[row * per_m, door : door + per_m] = kept
    for x, y, width, height in draw(st.lists(pieces, max_size=2)):
        left, low, right, high = (round(value * per_m) for value in (x, y, x + width, y + height))
        grid.cells[low:high, left:right] = UNKNOWN
    return grid


@settings(max_examples=60, deadline=None)
@given(maps(), st.floats(0.15, 0.4), spots, spots, st.none() | st.floats(-180, 180), st.none() | st.floats(0.05, 1.0))
def test_every_stand_keeps_the_robots_radius_faces_the_marker_and_can_be_driven_to(
    grid: Grid,
    radius: float,
    target: tuple[float, float],
    start: tuple[float, float],
    facing: float | None,
    above: float | None,
) -> None:
    robot = body(grid, radius, start)
    view = ANY if above is None else View.down(above)
    for pose in stands(grid, robot, target, facing, view):
        assert gap(grid, pose) >= radius
        bearing = degrees(atan2(target[1] - pose.y, target[0] - pose.x))
        assert abs((bearing - pose.yaw_deg + 180) % 360 - 180) < 10
        assert robot.reach[grid.cell(pose.x, pose.y)]
        assert 0.4 < hypot(target[0] - pose.x, target[1] - pose.y) < 2.5
        if facing is not None:
            seen_from = degrees(atan2(pose.y - target[1], pose.x - target[0]))
            assert abs((seen_from - facing + 180) % 360 - 180) <= 60.01


def test_nearly_every_random_map_has_a_stand() -> None:
    rng = np.random.default_rng(1)
    count = 0
    for _ in range(40):
        boxes = [(*rng.uniform(0.2, 5.0, 2), *rng.uniform(0.1, 1.5, 2)) for _ in range(rng.integers(6))]
        grid = room(boxes)
        free = [grid.point(*cell) for cell in np.argwhere(grid.clearance >= RADIUS)]
        start, target = (free[int(index)] for index in rng.integers(len(free), size=2))
        count += bool(stands(grid, body(grid, RADIUS, start), target))
    assert count >= 36


def test_a_print_on_a_table_is_looked_at_from_nearer_than_one_on_the_floor() -> None:
    grid = room([])
    robot = body(grid, RADIUS, (2.0, -1.0))

    def far(view: View) -> float:
        best = stands(grid, robot, (2.0, 1.0), None, view)[0]
        return hypot(best.x - 2.0, best.y - 1.0)

    assert far(View.down(0.36)) == pytest.approx(0.45, abs=0.06)
    assert far(View.down(0.58)) == pytest.approx(0.69, abs=0.15)
    assert far(View.down(1.09)) == pytest.approx(far(ANY), abs=0.15) == pytest.approx(1.2, abs=0.15)


def test_there_is_a_stand_in_a_narrow_aisle_where_no_better_one_is() -> None:
    grid = room([(0.05, 3.0, 5.9, 0.5), (0.05, 1.5, 5.9, 0.7)])
    robot = body(grid, RADIUS, (2.0, 0.6))
    found = stands(grid, robot, (2.0, 0.98), facing_deg=-90)
    assert found
    assert all(hypot(one.x - 2.0, one.y - 0.98) < 1.0 for one in found)


@settings(max_examples=20, deadline=None)
@given(st.lists(pieces, max_size=6))
def test_the_clearance_is_the_distance_to_the_nearest_cell_that_is_not_free(
    boxes: list[tuple[float, float, float, float]],
) -> None:
    grid = room(boxes, size=3.0, resolution=0.1)
    for row, column in ((5, 5), (12, 20), (29, 29), (0, 3), (17, 9)):
        pose = Pose(*grid.point(row, column), 0.0)
        exact = gap(grid, pose) if grid.cells[row, column] == FREE else 0.0
        assert grid.clearance[row, column] == pytest.approx(exact, abs=0.05)
        assert grid.clearance[row, column] <= exact + 1e-9


def test_a_wall_between_two_rooms_keeps_the_robot_in_its_own() -> None:
    grid = room([(0.0, 2.9, 6.0, 0.2)])
    robot = body(grid, RADIUS, (2.0, -1.0))
    assert robot.reach[grid.cell(2.0, 0.0)]
    assert not robot.reach[grid.cell(2.0, 3.0)]
    assert stands(grid, robot, (2.0, 3.2)) == []
    assert len(stands(grid, robot, (2.0, -0.5))) == 4


@pytest.mark.parametrize("far", [1e5, 1e10, 1e20, 1e300])
def test_a_robot_that_says_it_is_on_the_moon_is_at_the_nearest_edge_of_its_map(far: float) -> None:
    grid = room([(0.0, 2.9, 6.0, 0.2)])
    for y, side in ((far, 3.0), (-far, 0.0)):
        reach = body(grid, RADIUS, (2.0, y)).reach
        assert (reach[grid.cell(2.0, side)], reach[grid.cell(2.0, 3.0 - side)]) == (True, False)


def test_a_marker_is_seen_over_the_table_that_it_lies_on_and_not_through_a_wall() -> None:
    grid = room([(3.0, 3.0, 0.6, 0.6), (1.0, 0.5, 0.1, 4.0)])
    assert grid.sees((2.3, 0.0), (2.3, 1.3))
    assert not grid.sees((-0.5, 1.0), (2.3, 1.3))


def test_a_map_is_written_and_read_as_map_server_does(tmp_path: Path) -> None:
    grid = room([(1.0, 1.0, 1.0, 0.5)])
    grid.cells[60:70, 20:40] = UNKNOWN
    floor.write(grid, tmp_path / "map.yaml")
    again = floor.read(tmp_path / "map.yaml")
    assert (again.cells == grid.cells).all()
    assert (again.resolution, again.origin) == (grid.resolution, grid.origin)
    picture = (tmp_path / "map.pgm").read_bytes()
    top = np.frombuffer(picture[-grid.cells.size :], np.uint8).reshape(grid.cells.shape)[0]
    assert (top == 0).all()  # the picture's first row is the wall at the highest y


def test_a_map_that_is_turned_is_no_map_for_a_robot(tmp_path: Path) -> None:
    floor.write(room([]), tmp_path / "map.yaml")
    (tmp_path / "map.yaml").write_text((tmp_path / "map.yaml").read_text().replace("-2.0, 0.0]", "-2.0, 0.5]"))
    (tmp_path / "robot_places.yaml").write_text("map: map.yaml\n")
    with pytest.raises(ConfigError, match=r"robot_places.yaml:1: map: expected a map that is not turned"):
        robot_places.read(tmp_path / "robot_places.yaml")


def test_the_map_that_is_shipped_is_that_of_the_simulated_flat() -> None:
    shipped, drawn = floor.read(CONFIG / "tiago/map.yaml"), plan.grid(load(CONFIG / "world.yaml"))
    assert (shipped.cells == drawn.cells).all()
    assert (shipped.resolution, shipped.origin) == (drawn.resolution, drawn.origin)
