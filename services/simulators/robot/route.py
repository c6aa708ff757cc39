"""The way over the floor: the shortest one over free cells that keep the robot's radius (A*), without corners."""

from __future__ import annotations

import heapq
from itertools import product
from math import hypot

import numpy as np

from services.apartment.floor import XY, Grid

STEPS = tuple((row, column) for row, column in product((-1, 0, 1), repeat=2) if (row, column) != (0, 0))
Cell = tuple[int, int]


def route(grid: Grid, start: XY, goal: XY, radius: float) -> list[XY] | None:
    """Points from `start` to `goal`, both included (metres, map frame); None when there is no way.

    A start that is too near to something is left by the nearest free cell; a goal must itself be free enough.
    """
    end = grid.cell(*goal)
    if not grid.inside(*end) or grid.clearance[end] < radius:
        return None
    first = _nearest(grid, grid.cell(*start), radius)
    cells = None if first is None else _search(grid, first, end, radius)
    if cells is None:
        return None
    points = [start, *(grid.point(*cell) for cell in cells[1:-1]), goal]
    return _straightened(grid, points, radius)


def _nearest(grid: Grid, cell: Cell, radius: float) -> Cell | None:
    rows, columns = np.nonzero(grid.clearance >= radius)
    if not len(rows):
        return None
    index = int(np.argmin((rows - cell[0]) ** 2 + (columns - cell[1]) ** 2))
    return int(rows[index]), int(columns[index])


def _search(grid: Grid, start: Cell, end: Cell, radius: float) -> list[Cell] | None:
    """A* over eight neighbours (Hart, Nilsson, Raphael 1968)."""
    waiting = [(0.0, start)]
    cost: dict[Cell, float] = {start: 0.0}
    before: dict[Cell, Cell] = {}
    while waiting:
        _, cell = heapq.heappop(waiting)
        if cell == end:
            return _back(before, end)
        for row, column in STEPS:
            other = (cell[0] + row, cell[1] + column)
            if not grid.inside(*other) or grid.clearance[other] < radius:
                continue
            total = cost[cell] + hypot(row, column)
            if total < cost.get(other, np.inf):
                cost[other], before[other] = total, cell
                heapq.heappush(waiting, (total + hypot(other[0] - end[0], other[1] - end[1]), other))
    return None


def _back(before: dict[Cell, Cell], cell: Cell) -> list[Cell]:
    cells = [cell]
    while cells[-1] in before:
        cells.append(before[cells[-1]])
    return cells[::-1]


def _straightened(grid: Grid, points: list[XY], radius: float) -> list[XY]:
    """Leaves out every point that a straight way past can do without."""
    kept, index = [points[0]], 0
    while index < len(points) - 1:
        index = next(
            far for far in range(len(points) - 1, index, -1)
            if far == index + 1 or _open(grid, points[index], points[far], radius)
        )  # fmt: skip
        kept.append(points[index])
    return kept


def _open(grid: Grid, one: XY, other: XY, radius: float) -> bool:
    length = hypot(other[0] - one[0], other[1] - one[1])
    for share in np.linspace(0.0, 1.0, max(2, round(length / grid.resolution * 2))):
        cell = grid.cell(one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1]))
        if not grid.inside(*cell) or grid.clearance[cell] < radius:
            return False
    return True
