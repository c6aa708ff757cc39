"""The map in a mission's picture: the floor, the robot's track and goals, the cameras and what they saw."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import hypot

import numpy as np

from services.apartment.floor import FREE, OCCUPIED, UNKNOWN, XY, Grid
from services.mission.chart import Chart
from services.mission.timeline import Goal, Timeline
from services.paper import GREY, INK, PALE, WHITE, Colour, Paper

FLOOR = {FREE: (252, 252, 250), OCCUPIED: (92, 99, 110), UNKNOWN: (233, 236, 240)}
Frame = tuple[float, float, float, float]  # left, top, width, height on the sheet
LEGEND = 24.0  # below the map
NEAR = 30.0  # on the sheet: a point's name would be covered by the robot or the marker
EMPTY_M = 0.5  # around a track where there is no map
LEGENDS = {"look": "looks", "go": "goes", "scan": "waits for the house"}
SAME_M = 0.05  # goals that are nearer to each other are turns on the spot


class PlanView:
    """A part of the sheet with a map on it; all places in the map frame, metres."""

    def __init__(self, paper: Paper, chart: Chart, frame: Frame) -> None:
        self._paper, self._chart = paper, chart
        self._frame = (*frame[:3], frame[3] - LEGEND)
        self._low, self._high = (0.0, 0.0), (1.0, 1.0)

    def draw(self, told: Timeline, cameras: Mapping[str, XY], colours: Mapping[str, Colour]) -> None:
        """Everything, from the floor up."""
        self._low, self._high = self._bounds(told)
        left, top, width, height = self._frame
        self._paper.box(left, top, width, height, FLOOR[UNKNOWN])
        if self._chart.grid is not None:
            self._floor(self._chart.grid)
        self._metre()
        self._points(told)
        self._house(told, cameras)
        self._track(told, colours)
        self._goals(told)
        self._marker(told)
        self._legend(told, colours)

    def at(self, x: float, y: float) -> XY:
        """On the sheet; the middle of the map is in the middle of the frame."""
        left, top, width, height = self._frame
        (x0, y0), (x1, y1), scale = self._low, self._high, self._scale
        return left + width / 2 + (x - (x0 + x1) / 2) * scale, top + height / 2 - (y - (y0 + y1) / 2) * scale

    @property
    def _scale(self) -> float:
        width, height = self._high[0] - self._low[0], self._high[1] - self._low[1]
        return min((self._frame[2] - 12) / width, (self._frame[3] - 12) / height)

    def _bounds(self, told: Timeline) -> tuple[XY, XY]:
        grid = self._chart.grid
        if grid is not None:
            rows, columns = np.nonzero(grid.cells != UNKNOWN)
            low, high = (
                grid.point(rows.min() - 2.5, columns.min() - 2.5),
                grid.point(rows.max() + 2.5, columns.max() + 2.5),
            )
            return low, high
        x, y = [one[1] for one in told.poses] or [0.0], [one[2] for one in told.poses] or [0.0]
        return (min(x) - EMPTY_M, min(y) - EMPTY_M), (max(x) + EMPTY_M, max(y) + EMPTY_M)

    def _floor(self, grid: Grid) -> None:
        (row0, column0), (row1, column1) = grid.cell(*self._low), grid.cell(*self._high)
        cells = grid.cells[max(row0, 0) : row1 + 1, max(column0, 0) : column1 + 1][::-1]
        pixels = np.zeros((*cells.shape, 3), np.uint8)
        for value, colour in FLOOR.items():
            pixels[cells == value] = colour
        x, y = grid.point(max(row0, 0) - 0.5, max(column0, 0) - 0.5)
        left, bottom = self.at(x, y)
        size = grid.resolution * self._scale
        height, width = cells.shape
        self._paper.image(left, bottom - height * size, width * size, height * size, pixels)

    def _metre(self) -> None:
        left, top, _, height = self._frame
        x, y = left + 10, top + height - 10
        self._paper.line([(x, y), (x + self._scale, y)], INK, 2)
        self._paper.text((x + self._scale / 2, y - 5), "1 m", INK, 10, align="middle")

    def _points(self, told: Timeline) -> None:
        """Names that the robot's first and last place would cover are left out."""
        covers = [self.at(x, y) for _, x, y, _ in (*told.poses[:1], *told.poses[-1:])]
        for name, point in self._chart.places.points.items():
            x, y = self.at(point.x, point.y)
            self._paper.dot((x, y), 2, GREY)
            width = self._paper.width(name, 9)
            if all(not (x - NEAR < left < x + width + 14 and abs(top - y) < NEAR) for left, top in covers):
                self._paper.text((x + 5, y + 3), name, GREY, 9)

    def _house(self, told: Timeline, cameras: Mapping[str, XY]) -> None:
        """The cameras of the house, and their lines of sight to where they saw the marker."""
        relation = self._chart.places.apartment_to_map
        for name, where in cameras.items():
            at = self.at(*relation.to_map(*where))
            for one in told.sightings:
                if one.camera == name and one.position is not None:
                    self._paper.dashes(at, self.at(*relation.to_map(*one.position)), (135, 86, 196), 1.2)
            self._paper.dot(at, 6, (135, 86, 196), WHITE)
            self._paper.dot(at, 2.5, WHITE)
            self._paper.label((at[0] + 11, at[1] + 4), name, (135, 86, 196), 11, 600)

    def _track(self, told: Timeline, colours: Mapping[str, Colour]) -> None:
        places = [(at, self.at(x, y)) for at, x, y, _ in told.poses]
        if not places:
            return
        self._paper.line([where for _, where in places], WHITE, 6)
        for (_, one), (at, other) in pairwise(places):
            self._paper.line([one, other], colours.get(told.state_at(at), GREY), 3)
        self._paper.dot(places[0][1], 6, INK, WHITE)
        self._paper.label((places[0][1][0] + 10, places[0][1][1] + 15), "start", INK, 11, 600)
        _, x, y, yaw = told.poses[-1]
        self._paper.dot(self.at(x, y), 11, INK, WHITE)
        self._paper.arrow(self.at(x, y), yaw, WHITE, 9)

    def _goals(self, told: Timeline) -> None:
        """Poses that it was sent to, numbered; turns on one spot share a label."""
        spots: list[tuple[XY, list[int]]] = []
        for number, goal in enumerate(told.goals, 1):
            place = self._place(goal)
            if place is None:
                continue
            self._paper.arrow(self.at(*place[:2]), place[2], (234, 146, 46), 8)
            same = next((one for one in spots if hypot(one[0][0] - place[0], one[0][1] - place[1]) < SAME_M), None)
            if same is None:
                spots.append((place[:2], [number]))
            else:
                same[1].append(number)
        for where, numbers in spots:
            words = f"goal {numbers[0]}" if len(numbers) == 1 else f"goals {numbers[0]} to {numbers[-1]}"
            at = self.at(*where)
            self._paper.label((at[0] + 10, at[1] - 8), words, (196, 112, 16), 10, 600)

    def _place(self, goal: Goal) -> tuple[float, float, float] | None:
        if goal.pose is not None:
            return goal.pose
        name = self._chart.places.named(goal.point or "")
        if name is None:
            return None
        point = self._chart.places.points[name]
        return point.x, point.y, point.yaw_deg

    def _marker(self, told: Timeline) -> None:
        result = told.result
        if result is None or result.position is None:
            return
        x, y = self.at(*self._chart.places.apartment_to_map.to_map(result.position.x, result.position.y))
        if result.state == "found" and told.poses:
            _, rx, ry, _ = told.poses[-1]
            self._paper.line([self.at(rx, ry), (x, y)], (38, 150, 86), 1.5)
        self._paper.box(x - 9, y - 9, 18, 18, WHITE)
        self._paper.box(x - 7, y - 7, 14, 14, INK)
        for column, row in ((-3.0, -3.0), (1.0, -1.0), (-1.0, 2.0), (3.0, 3.0)):
            self._paper.box(x + column - 1.5, y + row - 1.5, 3, 3, WHITE)
        self._paper.label((x + 14, y + 4), f"marker {told.marker}", INK, 12, 700)

    def _legend(self, told: Timeline, colours: Mapping[str, Colour]) -> None:
        left, top, width, height = self._frame
        corners = [(left, top), (left + width, top), (left + width, top + height), (left, top + height)]
        self._paper.line(corners, PALE, closed=True)
        x, y = left, top + height + 17
        for state in [one for one in LEGENDS if one in {step.state for step in told.steps}]:
            self._paper.line([(x, y - 4), (x + 18, y - 4)], colours[state], 3)
            self._paper.text((x + 24, y), LEGENDS[state], INK, 10)
            x += 44 + self._paper.width(LEGENDS[state], 10)
