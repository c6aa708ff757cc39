"""Random flats for missions: things that stand about, a marker somewhere, the robot somewhere else.

Rooms, walls, furniture and the camera are those of the simulated apartment. The robot cannot see the marker from where
it starts, however it turns, and there is a place that it can drive to from where it can: who looks everywhere finds it.
"""

from __future__ import annotations

import json
import random
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from math import atan2, cos, degrees, dist, hypot, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from services.apartment import floor
from services.apartment.floor import XY, Grid
from services.apartment.robot_places import RobotPlaces
from services.payloads.robot import MissionResult
from services.simulators.camera.view.solids import Box, boxes
from services.simulators.robot import plan
from services.simulators.robot.sight import RANGE_M, seen
from services.simulators.world import World
from services.topics import CAMERA_MARKER, MISSION_ORDER, MISSION_RESULT, read
from services.virtual import VirtualApartment

CONFIG = Path(__file__).parents[2] / "config"
TARGET, SIZE_M = 582, 0.14
SOLID = ("counter", "cupboard", "fridge", "books")  # kinds whose front a print can hang on
LYING = ("counter", "table", "cupboard", "bed")  # kinds that it can lie on
HIGHEST_M = 0.95  # of what it lies on: the robot looks down from 1.1 m
AWAY_M = 0.75  # of things that stand about, from the named points
LONGEST_S = 1800.0
SMALL = {f"Encode[0].MainFormat[0].Video.{side}": str(pixels) for side, pixels in (("Width", 1152), ("Height", 648))}
UNWANTED = ("persistence", "history", "bridge", "dashboard")  # they take part in no mission


@dataclass(frozen=True, eq=False)
class Flat:
    """One of them; `world` as the file has it."""

    seed: int
    world: dict[str, Any]

    @cached_property
    def model(self) -> World:
        """The same as the simulators read it."""
        return World.model_validate(self.world)

    @cached_property
    def grid(self) -> Grid:
        """The robot's map of it."""
        return plan.grid(self.model)

    @cached_property
    def boxes(self) -> list[Box]:
        """What may stand in the way of a look."""
        return boxes(self.model)

    def sees(self, at: XY) -> bool:
        """Whether the robot sees the marker from a place of the map when it turns to it."""
        x, y, _ = self.model.map.to_apartment(np.array([[*at, 0.0]]))[0]
        marker = self.model.marker(TARGET)
        towards = degrees(atan2(marker.position[1] - y, marker.position[0] - x))
        return bool(seen(np.array([x, y]), towards, (marker,), self.boxes))


def flat(seed: int) -> Flat:
    """The random flat of a seed."""
    rng = random.Random(seed)
    world = yaml.safe_load((CONFIG / "world.yaml").read_text(encoding="utf-8"))
    places = RobotPlaces.model_validate(yaml.safe_load((CONFIG / "tiago/robot_places.yaml").read_text("utf-8")))
    while True:
        found = Flat(seed, _furnished(rng, world, places))
        reach = found.grid.reachable(_at(places, "Living room"), places.radius + found.grid.resolution / 2)
        if not all(reach[found.grid.cell(*_at(places, name))] for name in places.points):
            continue
        free = [found.grid.point(*cell) for cell in np.argwhere(reach)]
        spot = places.apartment_to_map.to_map(*found.model.marker(TARGET).position[:2])
        near = [at for at in free[::7] if dist(at, spot) < RANGE_M]
        starts = rng.sample(free, 20)
        start = next((at for at in starts if not found.sees(at)), None)
        if start is not None and any(map(found.sees, near)):
            x, y = (round(float(part), 3) for part in start)
            pose = {"x": x, "y": y, "yaw_deg": round(rng.uniform(-180, 180), 1)}
            return Flat(seed, {**found.world, "robots": {"tiago": {"pose": pose}}})


def _at(places: RobotPlaces, name: str) -> XY:
    return places.points[name].x, places.points[name].y


def _furnished(rng: random.Random, world: dict[str, Any], places: RobotPlaces) -> dict[str, Any]:
    things = [*world["furniture"], *_about(rng, world, places)]
    markers = [one for one in world["markers"] if one["id"] != TARGET]
    return {**world, "furniture": things, "markers": [*markers, _marker(rng, world, things)]}


def _about(rng: random.Random, world: dict[str, Any], places: RobotPlaces) -> Iterator[dict[str, Any]]:
    """Boxes on the floor, which the map has too."""
    points = [places.apartment_to_map.to_apartment(*_at(places, name)) for name in places.points]
    for number in range(rng.randrange(1, 6)):
        room = rng.choice(sorted(world["rooms"]))
        x, y = (rng.uniform(min(side), max(side)) for side in zip(*world["rooms"][room]["polygon"], strict=True))
        if all(dist((x, y), point) > AWAY_M for point in points):
            yield {
                "label": f"Box {number}", "room": room, "kind": rng.choice(("cupboard", "wood", "books")),
                "x": round(x, 3), "y": round(y, 3), "size": [round(rng.uniform(0.25, 0.6), 2) for _ in range(2)],
                "height": round(rng.uniform(0.3, 1.3), 2), "yaw_deg": round(rng.uniform(-180, 180), 1),
            }  # fmt: skip


def _marker(rng: random.Random, world: dict[str, Any], things: list[dict[str, Any]]) -> dict[str, Any]:
    """Lying on something, hanging at its front, or on the floor."""
    how = rng.choice(("lies", "lies", "hangs", "floor"))
    if how == "floor":
        thing = rng.choice(things)
        turn, far = radians(rng.uniform(0, 360)), max(thing["size"]) / 2 + rng.uniform(0.2, 0.8)
        position, facing = (thing["x"] + far * cos(turn), thing["y"] + far * sin(turn), 0.012), "up"
    elif how == "hangs":
        thing = rng.choice([one for one in things if one["kind"] in SOLID and one["height"] > SIZE_M * 1.6])
        yaw, aside = thing.get("yaw_deg", 0.0), rng.uniform(-0.5, 0.5) * max(0.0, thing["size"][0] - 2 * SIZE_M)
        height = thing.get("z", 0.0) + rng.uniform(0.8 * SIZE_M, min(thing["height"], 1.6) - 0.8 * SIZE_M)
        position, facing = (*_beside(thing, aside, -thing["size"][1] / 2 - 0.002), height), yaw - 90.0
    else:
        thing = rng.choice([one for one in things if one["kind"] in LYING and _top(one) < HIGHEST_M])
        along, across = (rng.uniform(-0.5, 0.5) * max(0.0, side - 1.6 * SIZE_M) for side in thing["size"])
        position, facing = (*_beside(thing, along, across), _top(thing) + 0.012), "up"
    places = world["cameras"]["ip1"]["places"]
    return {
        "id": TARGET, "size": SIZE_M, "position": [round(one, 3) for one in position], "facing": facing,
        "spin_deg": round(rng.uniform(0, 360), 1), "where": thing["label"], "room": thing["room"],
        "place": min(places, key=lambda name: dist(places[name]["looks_at"][:2], position[:2])),
    }  # fmt: skip


def _top(thing: dict[str, Any]) -> float:
    return float(thing.get("z", 0.0) + thing["height"])


def _beside(thing: dict[str, Any], along: float, across: float) -> XY:
    yaw = radians(thing.get("yaw_deg", 0.0))
    x = thing["x"] + along * cos(yaw) - across * sin(yaw)
    return x, thing["y"] + along * sin(yaw) + across * cos(yaw)


@dataclass(frozen=True)
class Run:
    """One mission: how it ended, and whether a camera of the house saw the marker meanwhile."""

    result: MissionResult
    sighted: bool

    @property
    def found(self) -> bool:
        return self.result.state == "found"

    @property
    def seconds(self) -> float:
        return self.result.elapsed_s


def configured(flat: Flat, folder: Path, *, house: bool = True) -> Path:
    """The configuration of a flat: its world, its map, and what a mission needs; without the house no camera."""
    shutil.copytree(CONFIG, folder / "config")
    config = folder / "config/simulated.yaml"
    (config.parent / "world.yaml").write_text(yaml.safe_dump(flat.world), encoding="utf-8")
    floor.write(flat.grid, config.parent / "tiago/map.yaml")
    sections = yaml.safe_load(config.read_text(encoding="utf-8"))
    for name in UNWANTED:
        del sections[name]
    del sections["simulators"]["home"]
    sections["simulators"]["robot"]["on_bus"] = True
    if not house:
        del sections["cameras"], sections["default_camera"], sections["simulators"]["camera"]
    config.write_text(yaml.safe_dump(sections), encoding="utf-8")
    return config


@contextmanager
def virtual(flat: Flat, *, house: bool, small: bool) -> Iterator[VirtualApartment]:
    """The flat in virtual time."""
    with tempfile.TemporaryDirectory() as name:
        config = configured(flat, Path(name), house=house)
        with VirtualApartment(config, {"APARTMENT_STATE": f"{name}/state"}) as apartment:
            if small and house:
                apartment.insides["ip1"].device.tables.write(list(SMALL.items()))
            yield apartment


def mission(flat: Flat, *, house: bool, small: bool = False) -> Run:
    """The mission in virtual time, with the house's camera or without; AssertionError when it has no end.

    `small`: with small pictures of the camera, which take less time to draw and show less.
    """
    with virtual(flat, house=house, small=small) as apartment:
        apartment.client.say(MISSION_ORDER.name(robot="tiago"), json.dumps({"find": TARGET, "id": "m"}))
        ends: list[MissionResult] = []
        sighted = False

        def over() -> bool:
            nonlocal sighted
            for message in apartment.client.pump():
                if message.topic == MISSION_RESULT.name(robot="tiago"):
                    ends.append(read(message, apartment.now).payload)
                sighted = sighted or message.topic == CAMERA_MARKER.name(cam="ip1", marker=str(TARGET))
            return bool(ends)

        assert apartment.until(over, LONGEST_S), f"seed {flat.seed}: no end after {LONGEST_S:.0f} s"
        return Run(ends[0], sighted)


def off_by(flat: Flat, result: MissionResult) -> float:
    """Metres in the plane between where the marker is and where the mission says that it is."""
    assert result.position is not None
    x, y, _ = flat.model.marker(TARGET).position
    return hypot(result.position.x - x, result.position.y - y)
