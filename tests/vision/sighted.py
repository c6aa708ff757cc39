"""Sightings of markers in random flats, drawn by the simulator: the frames, what a scan makes of them, and the truth.

Only the part of the picture around the marker is drawn, so that a trial can have hundreds. The whole picture is
drawn where two are compared (zoom).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil

import cv2
import numpy as np

from services.camera.device import Reading
from services.camera.scan.sightings import Eye, Sighting
from services.simulators.camera.view import prints
from services.simulators.camera.view.optics import Window, project, window
from services.simulators.camera.view.scene import Scene
from services.simulators.true_camera import Lens as TrueLens
from services.simulators.true_camera import TrueMount, WorldCamera
from services.simulators.world import Furniture, Marker, Pose2D, Room, Wall, World, WorldMap
from services.vision.detect import detect
from services.vision.frames import Array, Transform
from services.vision.lens import Lens
from services.vision.zoom import Magnification, measure

DICTIONARY = "DICT_5X5_1000"
SIZE_M = 0.14
FRAMES = 8
AROUND_PX = 70  # what is drawn around the marker
QUALITY = 88
STEEPEST_DEG = 65.0  # of the line of sight off the marker's normal
LOOKS = ("cupboard", "books", "poster", "wood", "fabric", "fridge", "counter", "table", "sofa", "bed", "print")


@dataclass(frozen=True)
class Flat:
    """A random flat: one room with furniture and one camera; `light` scales its picture, `noise` is in grey levels."""

    camera: WorldCamera
    world: World
    scene: Scene
    light: float
    noise: float

    @cached_property
    def lens(self) -> Lens:
        """The camera's lens as the service would know it."""
        true = self.camera.lens
        matrix = np.array([[true.fx, 0, true.cx], [0, true.fy, true.cy], [0, 0, 1]])
        return Lens(true.width, true.height, matrix, np.array(true.distortion))

    @property
    def eye(self) -> Eye:
        """What the service knows of the camera, all of it true."""
        return Eye("ip1", DICTIONARY, self.lens, self.camera.mount.frames)


def flat(seed: int) -> Flat:
    """A flat, the same for the same seed."""
    rng = np.random.default_rng((seed, 5))
    wide, deep, high = rng.uniform(6.5, 9), rng.uniform(6, 8.5), rng.uniform(2.4, 2.8)
    corners = [(0.0, 0.0), (wide, 0.0), (wide, deep), (0.0, deep)]
    walls = [Wall(start=a, end=b, height=high) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]
    mount = TrueMount(
        position=(rng.uniform(0.4, wide / 2), rng.uniform(0.4, deep / 2), high),
        yaw_deg=rng.uniform(-180, 180),
        lean_deg=tuple(rng.uniform(-1, 1, 2)),
        pan_to_tilt_m=(0.006, 0.078),
        tilt_to_lens_m=(0.024, 0.004),
        sensor_roll_deg=rng.uniform(-0.5, 0.5),
    )
    camera = WorldCamera(mount=mount, lens=_lens(rng))
    world = World(
        rooms={"Room": Room(label="Room", polygon=tuple(corners))},
        walls=tuple(walls),
        furniture=tuple(_furniture(rng, index, wide, deep) for index in range(rng.integers(8, 16))),
        map=WorldMap(apartment_to_map=Pose2D(x=0.0, y=0.0)),
    )
    return Flat(camera, world, Scene(world, camera.lens, seed), rng.uniform(0.45, 1.0), rng.uniform(2.0, 4.5))


def _lens(rng: np.random.Generator) -> TrueLens:
    focal = rng.uniform(1050, 1250)
    return TrueLens(
        width=2304,
        height=1296,
        fx=focal,
        fy=focal * rng.uniform(0.998, 1.002),
        cx=1151.5 + rng.uniform(-15, 15),
        cy=647.5 + rng.uniform(-15, 15),
        distortion=(rng.uniform(-0.09, 0.0), rng.uniform(0, 0.025), *rng.uniform(-6e-4, 6e-4, 2), -0.002),
    )


def _furniture(rng: np.random.Generator, index: int, wide: float, deep: float) -> Furniture:
    size = tuple(rng.uniform(0.4, 1.4, 2))
    x, y = rng.uniform(0.8, wide - 0.8), rng.uniform(0.8, deep - 0.8)
    turned = float(rng.choice([0, 90, 180, 270]))
    height = rng.uniform(0.3, 1.2)
    kind = str(rng.choice(LOOKS))
    return Furniture(
        label=f"thing {index}", room="Room", kind=kind, x=x, y=y, size=size, height=height, yaw_deg=turned
    )  # fmt: skip


@dataclass(frozen=True)
class Sighted:
    """A marker, what was seen of it, and the reading that belongs to the pictures."""

    marker: Marker
    seen: tuple[Sighting, ...]
    distance: float
    side_px: float

    def off(self, position: Array) -> Array:
        """How far a position is from the true one, m (3,)."""
        return np.asarray(position - np.array(self.marker.position), float)


def placed(flat: Flat, rng: np.random.Generator, distance: tuple[float, float] = (2.0, 6.0)) -> Marker:
    """A marker of a random id at a place that the camera can see, facing up or hung on something upright."""
    eye = np.array(flat.camera.mount.position) - [0, 0, 0.08]
    low, high = flat.scene.order.corners.min(axis=(0, 1)) + 0.2, flat.scene.order.corners.max(axis=(0, 1)) - 0.2
    while True:
        away, azimuth, z = rng.uniform(*distance), rng.uniform(-np.pi, np.pi), rng.uniform(0.02, 2.0)
        out = np.sqrt(max(away**2 - (eye[2] - z) ** 2, 0.0))
        place = np.array([eye[0] + out * np.cos(azimuth), eye[1] + out * np.sin(azimuth), z])
        facing = "up" if rng.random() < 0.5 else np.degrees(azimuth) + 180 + rng.uniform(-60, 60)
        marker = Marker(
            id=int(rng.integers(1, 1000)), size=SIZE_M, position=tuple(place), facing=facing,
            spin_deg=rng.uniform(-180, 180), where="thing 0", room="Room", place="",
        )  # fmt: skip
        steep = np.degrees(np.arccos(marker.pose.rotation[:, 2] @ (eye - place) / np.linalg.norm(eye - place)))
        sheet = prints.paper(marker)
        inside = (place > low).all() and (place < high).all() and out > 0
        if inside and steep < STEEPEST_DEG and not any(box.hides(eye, sheet).any() for box in flat.scene.boxes):
            return marker


def looking(flat: Flat, marker: Marker, rng: np.random.Generator, times: float = 1.0) -> tuple[float, float]:
    """Readings at which the marker is somewhere in the picture, but not at its edge."""
    while True:
        pan, tilt = flat.camera.aim(marker.position)
        pan, tilt = pan + rng.uniform(-38, 38) / times, tilt + rng.uniform(-22, 22) / times
        pixels = _pixels(flat, flat.camera.pose(pan, tilt), marker, times)
        if (pixels > AROUND_PX).all() and (pixels < np.array([2304, 1296]) - AROUND_PX).all():
            return pan, tilt


def _pixels(flat: Flat, pose: Transform, marker: Marker, times: float) -> Array:
    """Where its corners are in the picture of full size at this magnification."""
    lens = flat.camera.lens
    upright = project(pose.inverse().apply(prints.corners(marker)), lens)
    return window(lens, times, lens.width, lens.height).from_sensor(upright)


def photograph(flat: Flat, pose: Transform, times: float, rng: np.random.Generator) -> np.ndarray:
    """The whole picture of the sensor's size as it is delivered."""
    lens = flat.camera.lens
    sensor = window(lens, times, round(lens.width / times), round(lens.height / times))
    return _delivered(flat, flat.scene.draw(pose, sensor), (lens.width, lens.height), rng)


def _delivered(flat: Flat, still: np.ndarray, size: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    grain = rng.standard_normal((*still.shape[:2], 1), np.float32) * np.float32(flat.noise)
    image = cv2.add(cv2.convertScaleAbs(still, alpha=flat.light), np.repeat(grain, 3, axis=2), dtype=cv2.CV_8U)
    if (image.shape[1], image.shape[0]) != size:
        image = cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


def sighted(
    flat: Flat,
    marker: Marker,
    rng: np.random.Generator,
    *,
    frames: int = FRAMES,
    noise_deg: float = 0.0,
    times: float = 1.0,
    at: float = 0.0,
) -> Sighted:
    """What a scan sees of it at one place; the readings are off by `noise_deg`. `seen` may be empty.

    With `times`, the picture is zoomed, and its magnification measured against the wide one of the same place.
    """
    pan, tilt = looking(flat, marker, rng, times)
    pose = flat.camera.pose(pan, tilt)
    off = rng.normal(0, noise_deg, 2) if noise_deg else np.zeros(2)
    reading = Reading(pan + off[0], tilt + off[1], 0.0 if times == 1 else 2.0 * ceil(2 * (times - 1)))
    still, to_full = _around(flat, marker, pose, times)
    magnified = None if times == 1 else _measured(flat, pose, times, rng)
    size = (flat.camera.lens.width, flat.camera.lens.height)
    scale = size[0] / round(size[0] / times)
    crop = (round(still.shape[1] * scale), round(still.shape[0] * scale))
    seen = []
    for number in range(frames):
        found = detect(_delivered(flat, still, crop, rng), DICTIONARY, {marker.id})
        if found:
            corners = (found[0].corners + 0.5) / (np.array(crop) / still.shape[1::-1]) - 0.5
            detection = replace(found[0], corners=to_full(corners))
            seen.append(Sighting(detection, "place", reading, at + number, size, magnified))
    true = _pixels(flat, pose, marker, times)
    side = float(np.sqrt(cv2.contourArea(true.astype(np.float32))))
    return Sighted(marker, tuple(seen), float(np.linalg.norm(pose.translation - marker.position)), side)


def _measured(flat: Flat, pose: Transform, times: float, rng: np.random.Generator) -> Magnification | None:
    try:
        return measure(photograph(flat, pose, 1.0, rng), photograph(flat, pose, times, rng), (1.0, 4.0))
    except ValueError:
        return None


def _around(flat: Flat, marker: Marker, pose: Transform, times: float):
    """The still picture around the marker, as fine as the sensor; and from its pixels to the full picture's."""
    lens, world = flat.camera.lens, flat.scene.world
    whole = window(lens, times, round(lens.width / times), round(lens.height / times))
    true = whole.from_sensor(project(pose.inverse().apply(prints.corners(marker)), lens))
    low = np.maximum(np.floor(true.min(axis=0)).astype(int) - AROUND_PX, 0)
    high = np.minimum(np.ceil(true.max(axis=0)).astype(int) + AROUND_PX, (whole.width, whole.height))
    size = high - low
    k = np.array([whole.across / whole.width, whole.down / whole.height])
    part = Window(*(low * k + (whole.left, whole.top)), *(size * k), int(size[0]), int(size[1]))
    flat.scene.world = world.model_copy(update={"markers": (marker,)})
    try:
        still = flat.scene.draw(pose, part)
    finally:
        flat.scene.world = world
    full = np.array([lens.width, lens.height]) / (whole.width, whole.height)
    return still, lambda corners: (corners + low + 0.5) * full - 0.5
