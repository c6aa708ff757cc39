"""Random flats for scans: markers of all sizes in all light, or none at all, among others that are not looked for.

A target that a visited place shows well has to be found; what is not there must not be. The trial of the soak, and of
the tests with fewer turns. The soak's whole scans (nine places, both picture modes, K = 8) make a table, with how exact
the positions are, and the time over the least and the report's.
"""

from __future__ import annotations

import json
import random
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import atan2, degrees, dist
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np
import yaml
from rich.console import Console
from rich.table import Table

from services.simulators.camera.view.optics import project
from services.simulators.camera.view.prints import paper
from services.simulators.camera.view.solids import boxes
from services.simulators.world import Marker, World, load
from services.vision.frames import Array
from tests import bounds
from tests.camera.scan.virtual_scan import CONFIG, FRAMES, VirtualScan, virtual_scan
from tests.vision.positions import NINETY

TARGETS = (601, 602, 603, 604)
OTHERS = tuple(range(605, 660))
WELL_PX, FRAME_PX = 26.0, 24.0  # a side that surely is enough, in the worst light; distance from the picture's edge
FACING = 0.5  # cosine: turned away by less than 60 degrees
NEAR_M = 0.12
GRID = np.linspace(-1.0, 1.0, 15)  # a board may come out of a sheet between its corners
PLACES = 9
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
    spots = marker.pose.apply(1.3 * np.array([[x, y, 0] for x in half * GRID for y in half * GRID]))
    for name in places:
        pose = camera.pose(trial.places[name].pan, trial.places[name].tilt)
        ahead = pose.inverse().apply(points)
        to_eye = pose.translation - points[4]
        if (ahead[:, 2] < 0.2).any() or normal @ to_eye < FACING * np.linalg.norm(to_eye):
            continue
        pixels = project(ahead, camera.lens)
        reach = dist(points[4], pose.translation) + 2 * half
        nearer = [one for one in world.markers if one is not marker and dist(one.position, pose.translation) < reach]
        if any(_overlap(pixels[:4], project(pose.inverse().apply(paper(one)), camera.lens)) for one in nearer):
            continue  # another sheet may lie over it
        inside = (pixels > FRAME_PX).all() and (
            pixels < (camera.lens.width - FRAME_PX, camera.lens.height - FRAME_PX)
        ).all()
        scale = trial.inside.pictures.size("MainFormat")[0] / camera.lens.width / 1.3
        side = scale * float(np.sqrt(cv2.contourArea(pixels[:4].astype(np.float32))))
        if inside and side >= WELL_PX and not any(box.hides(pose.translation, spots).any() for box in things):
            return True
    return False


def _overlap(one: Array, other: Array) -> bool:
    """Whether two convex outlines in the picture have a part in common."""
    return bool(cv2.intersectConvexConvex(one.astype(np.float32), other.astype(np.float32))[0] > 0)


@dataclass(frozen=True)
class Scanned:
    """What a scan told of a scene: `sure` are the targets that it has to find, `off_m` how far positions are off.

    `inside` tells of each position whether it is off by no more than its 90 % ellipsoid says.

    `least` is what such a scan needs at least, `report` what the report's scan takes, seconds. `cold` is how many times
    the least the very first scan took, in which the motors are learnt.
    """

    scene: Scene
    sure: set[int]
    found: set[int]
    off_m: list[float]
    inside: list[bool]
    seconds: float
    least: float
    report: float
    cold: float

    @property
    def missed(self) -> set[int]:
        """Shown well, and not found."""
        return self.sure - self.found

    @property
    def invented(self) -> set[int]:
        """Found, and not there."""
        return self.found - self.scene.present


def scanned(rng: random.Random, *, places: int, frames: int, full_size: bool, whole: bool) -> Scanned:
    """One random flat, scanned in virtual time: all of it in both picture modes, or some places in their order."""
    flat = yaml.safe_load((CONFIG / "world.yaml").read_text())
    scene = random_scene(rng, flat, SIZES["small" if full_size else "large"], places)

    def furnish(world: dict[str, Any]) -> None:
        world["markers"] = scene.markers

    sizes = {"size": 0.14, "sizes": {marker["id"]: marker["size"] for marker in scene.markers}}
    with tempfile.TemporaryDirectory() as name, virtual_scan(Path(name), world=furnish, markers=sizes) as trial:
        video, tables = "Encode[0].MainFormat[0].Video.", trial.inside.device.tables
        if full_size:
            tables.write([(f"{video}Width", "2304"), (f"{video}Height", "1296")])
        tables.write([(f"VideoColor[0][{profile}].Brightness", str(scene.brightness)) for profile in range(3)])
        for place, zoom in scene.zooms.items():
            known = trial.service.places.named[place]
            trial.service.places.named[place] = known.model_copy(update={"zoom": zoom, "preset": None})
        world = load(Path(name) / "config" / "world.yaml")
        sure = {one.id for one in world.markers if shown_well(world, trial, one, scene.places)} & set(TARGETS)
        cold = _blindfold(trial) if whole else 0.0
        least, (report, _) = trial.least(turns=2), trial.report()
        which = {"full": True} if whole else {"places": scene.places}
        _, seconds, last = trial.run(json.dumps({"targets": list(TARGETS), "frames": frames} | which))
        assert last.state == "done", last
        off, inside = [], []
        for result in trial.results():
            if result.position is not None and result.marker in sure:
                away = np.subtract(
                    (result.position.x, result.position.y, result.position.z), world.marker(result.marker).position
                )
                off.append(float(np.linalg.norm(away)))
                inside.append(bool(away @ np.linalg.solve(np.array(result.covariance), away) < NINETY))
        return Scanned(scene, sure, set(last.found), off, inside, seconds, least.seconds, report, cold)


def _blindfold(trial: VirtualScan) -> float:
    """The first scan of this camera, of which no picture is drawn: its time over the least."""
    frame, analyst = trial.inside.pictures.frame, trial.service.scanner.analyst
    least = trial.least(turns=2).seconds
    trial.sees({})
    _, seconds, _ = trial.run('{"full": true}')
    trial.inside.pictures.frame, trial.service.scanner.analyst = frame, analyst  # type: ignore[method-assign]
    return seconds / least


def scan_a_scene(rng: random.Random, *, places: int = PLACES, frames: int = 3, full_size: bool = True) -> float:
    """A search of some places: asserts that nothing is missed, invented or far off, returns the seconds."""
    found = scanned(rng, places=places, frames=frames, full_size=full_size, whole=False)
    assert not found.invented, f"invented: {found.invented}, {found.scene}"
    assert not found.missed, f"missed: {found.missed}, {found.scene}"
    assert all(off < NEAR_M for off in found.off_m), found
    return found.seconds


@contextmanager
def whole_scans() -> Iterator[Callable[[random.Random], float]]:
    """Turns of a whole scan each; its figure is the time over the least time. At the end the table of all."""
    done: list[Scanned] = []

    def turn(rng: random.Random) -> float:
        done.append(scanned(rng, places=PLACES, frames=FRAMES, full_size=True, whole=True))
        return done[-1].seconds / done[-1].least

    yield turn
    Console(width=180).print(table(done))
    assert not any(one.missed or one.invented for one in done)
    assert all(off < NEAR_M for one in done for off in one.off_m)


def table(done: list[Scanned]) -> Table:
    """A row for each scene."""
    title = f"{PLACES} places, both picture modes, K = {FRAMES}, virtual time: every frame rate is kept"
    rows = Table("targets there", "shown well", "found", "missed", "invented", "median mm off", "worst", "in 90 %",
                 "seconds", f"over the least (<= {bounds.SCAN_OVER_LEAST})",
                 f"the report's (>= {bounds.SCAN_QUICKER} x)",
                 "the first, over the least", title=title)  # fmt: skip
    for one in done:
        off = [1000 * off for off in one.off_m]
        rows.add_row(
            str(len(one.scene.present)), str(len(one.sure)), str(len(one.found)), str(len(one.missed)),
            str(len(one.invented)), f"{median(off):.0f}" if off else "", f"{max(off):.0f}" if off else "",
            f"{sum(one.inside)} of {len(off)}", f"{one.seconds:.1f}", f"{one.seconds / one.least:.2f}",
            f"{one.report / one.seconds:.2f} x", f"{one.cold:.2f}",
        )  # fmt: skip
    return rows
