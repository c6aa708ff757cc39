"""The apartment as pages draw it: rooms and what stands in them, items, cameras with their lens, robots with their map.

Read once at the start. Not here: what changes (`view.py`), and how it is drawn (`static/views/apartment.js`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from math import atan, degrees
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from services import document
from services.apartment import robot_places
from services.apartment.cameras import Hung
from services.apartment.floor import Grid
from services.apartment.home import Home
from services.dashboard import chart
from services.dashboard.settings import Config
from services.errors import ConfigError
from services.section import Section
from services.states import base_type
from services.vision.lens import Lens

XY = tuple[float, float]


class Piece(Section):
    """Something that stands on the floor: its middle, its size along its own x and y, and how it is turned."""

    label: str = ""
    at: XY
    size: XY
    yaw_deg: float = 0.0


class Plan(Section):
    """The file: metres in the apartment frame. `rooms` are those of the home, `at` is where things and items are."""

    rooms: dict[str, tuple[XY, ...]] = {}
    at: dict[str, XY] = {}
    furniture: tuple[Piece, ...] = ()


class Maps:
    """The robots' maps as pictures, by robot."""

    def __init__(self) -> None:
        self.pictures: dict[str, bytes] = {}
        self.described: list[dict[str, Any]] = []

    def add(self, name: str, places: robot_places.RobotPlaces, grid: Grid | None) -> None:
        """A robot: its named points, and its map where it has one. All in the apartment frame."""
        relation = places.apartment_to_map
        points = {
            point: {"at": relation.to_apartment(pose.x, pose.y), "yaw_deg": pose.yaw_deg - relation.yaw_deg}
            for point, pose in places.points.items()
        }
        robot: dict[str, Any] = {"name": name, "points": points, "radius": places.radius}
        robot["apartment_to_map"] = relation.model_dump()
        if grid is not None:
            self.pictures[name] = chart.picture(grid)
            rows, columns = grid.cells.shape
            robot["map"] = {"origin": grid.origin, "size": (columns * grid.resolution, rows * grid.resolution)}
        self.described.append(robot)


def check(config: Config) -> None:
    """ConfigError with every fault of the files that the settings name."""
    faults: list[str] = []
    for read in (lambda: _plan(config), lambda: _maps(config), lambda: [*_cameras(config)], config.certificate):
        try:
            read()
        except ConfigError as error:
            faults += error.faults
    if faults:
        raise ConfigError(faults)


def described(config: Config) -> tuple[dict[str, Any], dict[str, bytes]]:
    """What `GET /api/apartment` answers, and the robots' maps as PNG. ConfigError when a file cannot be used."""
    home, maps = config.home, _maps(config)
    told = {
        "timezone": home.timezone,
        "rooms": {name: room.label for name, room in home.rooms.items()},
        "things": {name: {"label": thing.label, "room": thing.room} for name, thing in home.things.items()},
        "groups": {name: group if isinstance(group, str) else group.label for name, group in home.groups.items()},
        "items": {name: _item(home, name) for name in home.items},
        "plan": _plan(config).model_dump(),
        "cameras": list(_cameras(config)),
        "robots": maps.described,
    }
    return told, maps.pictures


def _item(home: Home, name: str) -> dict[str, Any]:
    item = home.items[name]
    return {
        "label": item.label, "type": base_type(item.type), "room": home.room_of(name), "thing": item.thing,
        "unit": item.unit, "icon": item.icon, "options": item.options, "groups": item.groups,
        "range": item.range.model_dump() if item.range else None, "commands": item.takes_commands,
        "stored": bool(item.persist),
    }  # fmt: skip


def _plan(config: Config) -> Plan:
    if config.plan is None:
        return Plan()
    source = document.read(config.folder / config.plan)
    document.must(source)
    try:
        plan = Plan.model_validate(source.value or {})
    except ValidationError as error:
        for fault in error.errors(include_url=False):
            source.fault(fault["loc"], f"expected {fault['msg']}, got {str(fault['input'])[:80]!r}")
        document.must(source)
        raise
    for room in plan.rooms.keys() - config.home.rooms.keys():
        source.fault(("rooms", room), f"expected one of the rooms of the home, got {room!r}")
    for name in plan.at.keys() - config.home.things.keys() - config.home.items.keys():
        source.fault(("at", name), f"expected a thing or an item of the home, got {name!r}")
    document.must(source)
    return plan


def _maps(config: Config) -> Maps:
    maps = Maps()
    for name, robot in config.robots.items():
        maps.add(name, *robot_places.read(config.folder / robot.places))
    return maps


def _cameras(config: Config) -> Iterator[dict[str, Any]]:
    for name in config.cameras:
        section = config.camera_sections.get(name, Hung())
        told: dict[str, Any] = {"name": name, "targets": section.targets, "mount": None, "lens": None}
        mount, lens = section.mount, lens_of(config.folder, section)
        if mount is not None:
            told["mount"] = {
                key: asdict(mount)[key] for key in ("position", "kind", "yaw_deg", "tilt_zero_deg", "sensor_roll_deg")
            }
        if lens is not None:
            told["lens"] = {
                "width": lens.width, "height": lens.height, "levels": levels_of(config.folder, section),
                "across_deg": degrees(2 * atan(lens.width / 2 / float(lens.matrix[0, 0]))),
                "up_deg": degrees(2 * atan(lens.height / 2 / float(lens.matrix[1, 1]))),
            }  # fmt: skip
        yield told


def lens_of(folder: Path, section: Hung) -> Lens | None:
    """A camera's lens; None where it is not calibrated."""
    if section.camera_info is None or not (folder / section.camera_info).exists():
        return None
    try:
        return Lens.from_camera_info(document.must(document.read(folder / section.camera_info)))
    except ValueError as error:
        raise ConfigError([f"{folder / section.camera_info}:1: {error}"]) from error


def levels_of(folder: Path, section: Hung) -> list[tuple[float, float]]:
    """What the calibrated levels of zoom magnify by, in order; empty where the zoom is not calibrated."""
    file = (folder / section.camera_info).with_name("zoom.yaml") if section.camera_info else None
    if file is None or not file.exists():
        return []
    rows = document.must(document.read(file)).get("levels", [])
    return sorted((float(row["zoom"]), float(row["magnification"])) for row in rows)
