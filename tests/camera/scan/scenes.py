"""Random flats for scans: markers of all sizes in all light, or none at all, among others that are not looked for.

A target that a visited place shows well has to be found; what is not there must not be. The trial of the soak, and of
the tests with fewer turns.
"""

from __future__ import annotations

import json
import random
import tempfile
from dataclasses import dataclass, field
from math import atan2, degrees, dist
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from services.simulators.camera.view.optics import project
from services.simulators.camera.view.solids import boxes
from services.simulators.world import Marker, World, load
from tests.camera.scan.virtual_scan import VirtualScan, virtual_scan

TARGETS = (601, 602, 603, 604)
OTHERS = tuple(range(605, 660))
WELL_PX, FRAME_PX = 26.0, 24.0  # a side that surely is enough, in the worst light; distance from the picture's edge
FACING = 0.5  # cosine: turned away by less than 60 degrees
NEAR_M = 0.12
SIZES = {"small": (0.13, 0.19), "large": (0.2, 0.3)}  # m, of markers: for the large stream, and for half of it


@dataclass
class Scene:
    """What is put into the flat, and how the scan is ordered."""

    markers: list[dict[str, Any]] = field(default_factory=list)
    places: list[str] = field(default_factory=list)
    zooms: dict[str, float] = field(
        default_factory=dict
    )  # of the saved places; a scan looks at the widest all the same
    brightness: int = 50

    @property
    def present(self) -> set[int]:
        """The targets that are there."""
        return {marker["id"] for marker in self.markers} & set(TARGETS)


def random_scene(rng: random.Random, world: dict[str, Any], sizes: tuple[float, float], places: int) -> Scene:
    """A third of them has no target."""
    all_places = world["cameras"]["ip1"]["places"]
    scene = Scene(places=rng.sample(sorted(all_places), places), brightness=rng.choice((30, 40, 50, 50, 60)))
    scene.zooms = {name: float(rng.choice((2, 4, 8))) for name in rng.sample(sorted(all_places), 2)}
    targets = rng.sample(TARGETS, rng.choice((0, 1, 2, 3)))
    eye = world["cameras"]["ip1"]["mount"]["position"]
    for marker in [*targets, *rng.sample(OTHERS, rng.randrange(4))]:
        place = rng.choice(scene.places if rng.random() < 0.8 else sorted(all_places))
        x, y, z = (about + rng.uniform(-0.4, 0.4) for about in all_places[place]["looks_at"])
        towards = degrees(atan2(eye[1] - y, eye[0] - x)) + rng.uniform(-40, 40)
        scene.markers.append(
            {
                "id": marker,
                "size": round(rng.uniform(*sizes), 3),
                "position": [round(one, 3) for one in (x, y, max(0.1, z + 0.2))],
                "facing": rng.choice(("up", round(towards, 1))),
                "spin_deg": round(rng.uniform(0, 360), 1),
                "where": world["furniture"][0]["label"],
                "room": world["furniture"][0]["room"],
                "place": place,
            }
        )
    return scene


def shown_well(world: World, trial: VirtualScan, marker: Marker, places: list[str]) -> bool:
    """Whether one of the places surely shows a marker: whole, large enough, facing the lens, nothing before it."""
    camera, things = world.cameras["ip1"], boxes(world)
    half = marker.size / 2
    flat = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0], [0, 0, 0]])
    points, normal = marker.pose.apply(1.3 * flat), marker.pose.rotation[:, 2]
    for name in places:
        pose = camera.pose(trial.places[name].pan, trial.places[name].tilt)
        ahead = pose.inverse().apply(points)
        to_eye = pose.translation - points[4]
        if (ahead[:, 2] < 0.2).any() or normal @ to_eye < FACING * np.linalg.norm(to_eye):
            continue
        pixels = project(ahead, camera.lens)
        inside = (pixels > FRAME_PX).all() and (
            pixels < (camera.lens.width - FRAME_PX, camera.lens.height - FRAME_PX)
        ).all()
        scale = trial.inside.pictures.size("MainFormat")[0] / camera.lens.width / 1.3
        side = scale * float(np.sqrt(cv2.contourArea(pixels[:4].astype(np.float32))))
        if inside and side >= WELL_PX and not any(box.hides(pose.translation, points).any() for box in things):
            return True
    return False


def scan_a_scene(rng: random.Random, *, places: int = 9, frames: int = 3, full_size: bool = True) -> float:
    """One random flat, scanned in virtual time; asserts that nothing is missed or invented, returns the seconds."""
    scenes: list[Scene] = []

    def furnish(world: dict[str, Any]) -> None:
        scenes.append(random_scene(rng, world, SIZES["small" if full_size else "large"], places))
        world["markers"] = scenes[0].markers

    with tempfile.TemporaryDirectory() as name, virtual_scan(Path(name), world=furnish) as trial:
        (scene,) = scenes
        video, tables = "Encode[0].MainFormat[0].Video.", trial.inside.device.tables
        if full_size:
            tables.write([(f"{video}Width", "2304"), (f"{video}Height", "1296")])
        tables.write([(f"VideoColor[0][{profile}].Brightness", str(scene.brightness)) for profile in range(3)])
        for place, zoom in scene.zooms.items():
            known = trial.service.places.named[place]
            trial.service.places.named[place] = known.model_copy(update={"zoom": zoom, "preset": None})
        world = load(Path(name) / "config" / "world.yaml")
        sure = {one.id for one in world.markers if shown_well(world, trial, one, scene.places)} & set(TARGETS)
        order = json.dumps({"targets": list(TARGETS), "places": scene.places, "frames": frames})
        _, seconds, last = trial.run(order)
        assert last.state == "done", last
        assert set(last.found) <= scene.present, f"invented: {set(last.found) - scene.present}, {scene}"
        assert sure <= set(last.found), f"missed: {sure - set(last.found)}, {scene}"
        for result in trial.results():
            truth = world.marker(result.marker)
            if result.position is not None and result.marker in sure and truth.size == 0.14:
                at = (result.position.x, result.position.y, result.position.z)
                assert dist(at, truth.position) < NEAR_M, (result, truth)
    return seconds
