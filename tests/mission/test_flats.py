"""Missions in random flats in virtual time; the bench makes twenty of them, the soak as many as one likes."""

from __future__ import annotations

import numpy as np
import pytest

from services.simulators.robot.route import route
from tests.mission import bench, flats


@pytest.mark.parametrize("seed", [2, 5, 7])  # on the dining table, too slanted from afar; on the low table, twice
def test_the_house_leads_the_robot_to_the_marker(seed: int) -> None:
    flat = flats.flat(seed)
    run = flats.mission(flat, house=True, small=True)
    assert (run.result.state, run.sighted) == ("found", True)
    assert flats.off_by(flat, run.result) < 0.15
    assert not [one for one in run.result.story if "goes round" in one.text]


def test_without_the_house_the_robot_finds_it_later_or_not_at_all() -> None:
    flat = flats.flat(5)
    alone = flats.mission(flat, house=False)
    assert not alone.sighted
    assert not [one for one in alone.result.story if one.state == "scan"]
    assert alone.seconds > 2 * flats.mission(flat, house=True, small=True).seconds


@pytest.mark.parametrize("seed", range(1, 7))
def test_a_random_flat_can_be_solved_and_is_the_same_again(seed: int) -> None:
    flat = flats.flat(seed)
    assert flats.flat(seed).world == flat.world
    start = flat.model.robots["tiago"].pose
    assert not flat.sees((start.x, start.y))
    free = [flat.grid.point(*cell) for cell in np.argwhere(flat.grid.reachable((start.x, start.y), 0.31))]
    seeing = [at for at in free[::5] if flat.sees(at)]
    assert any(route(flat.grid, (start.x, start.y), at, 0.28) for at in seeing)


def test_the_table_tells_ratios_and_counts_what_was_in_vain() -> None:
    rows = (
        bench.Row(1, "Sofa", "found", 20.0, True, "found", 40.0),
        bench.Row(2, "Bed", "found", 30.0, True, "not_found", 200.0),
    )
    figures = bench.Figures(rows, (bench.Repeated(1, "found", 22.0, 20.0),))
    assert (figures.found(house=True), figures.found(house=False)) == (2, 1)
    assert figures.mean_s(house=True) / figures.mean_s(house=False) == 0.5
    assert figures.each_s(house=True) / figures.each_s(house=False) == pytest.approx(25 / 240)
    assert figures.repeated[0].ratio == pytest.approx(1.1)
    assert bench.table(figures).row_count == 6
