"""A calibration of the mount from markers' corners alone, and how far off it is: for the tests and `make soak`."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import degrees

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.aim import readings_at
from services.vision.calibrate_mount import MountFit, fit
from services.vision.frames import Mount, Transform, camera_in_apartment, rotation_x, rotation_z
from services.vision.mount_squares import SQUARE, Known, Look
from tests import bounds
from tests.vision.lens_trials import PLAIN, lens_trial

Array = NDArray[np.float64]
SIZE_M = 0.14
ARMS = {"pan_to_tilt_m": (0.006, 0.078), "tilt_to_lens_m": (0.024, 0.004)}
PLACED_M = 0.01  # how far off the markers were put
NOISE_PX, READING_DEG = 0.08, 0.03  # of a corner, and of a reading beyond its rounding to 0.1
ASIDE = ((0.0, 0.0), (12.0, 6.0), (-12.0, -6.0))  # readings at which each marker is looked at, from centred


@dataclass(frozen=True)
class MountTrial:
    """How far off it is: where the pan axis leaves the plate, and the camera's orientation, at worst over its range."""

    place_m: float
    turn_deg: float
    sigmas: Array  # of the place, each in its own standard deviations


def judged(found: MountFit, truth: Mount) -> MountTrial:
    """A fit against the truth."""
    off = np.subtract(found.mount.position, truth.position)
    turns = [
        angle_deg(camera_in_apartment(found.mount, pan, tilt), camera_in_apartment(truth, pan, tilt))
        for pan in (0.0, 120.0, 240.0)
        for tilt in (10.0, 45.0, 80.0)
    ]
    return MountTrial(float(np.linalg.norm(off)), max(turns), off / found.position_doubt)


def angle_deg(one: Transform, other: Transform) -> float:
    """Of the rotation between two orientations."""
    return degrees(float(np.linalg.norm(cv2.Rodrigues(one.rotation.T @ other.rotation)[0])))


def hung(rng: np.random.Generator) -> Mount:
    """A camera under a ceiling, nearly level, with its little faults."""
    x, y = rng.uniform(2.0, 4.0, 2)
    lean = rng.normal(0, 0.7, 2)
    mount = Mount((float(x), float(y), 2.6), "ceiling", float(rng.uniform(-180, 180)), (float(lean[0]), float(lean[1])))
    return replace(mount, **ARMS, sensor_roll_deg=float(rng.normal(0, 0.3)), tilt_zero_deg=float(rng.normal(0, 0.4)))


def spread(rng: np.random.Generator, mount: Mount, count: int) -> dict[int, Transform]:
    """Markers all around the camera, on the floor, on tables and on walls."""
    start, markers = rng.uniform(0, 360), {}
    for index in range(count):
        way = np.radians(start + 360 / count * index + rng.uniform(-20, 20))
        out, high = rng.uniform(1.2, 3.5), rng.uniform(0, 1.6)
        place = np.array([mount.position[0] + out * np.cos(way), mount.position[1] + out * np.sin(way), high])
        turn = rotation_z(float(rng.uniform(0, 360)))
        if high > 1.0:  # on a wall, facing the camera
            turn = rotation_z(float(np.degrees(way)) - 90 + float(rng.uniform(-30, 30))) @ rotation_x(90.0)
        markers[100 + index] = Transform(turn, place)
    return markers


def looks_at(
    mount: Mount,
    markers: dict[int, Transform],
    rng: np.random.Generator,
    noise_px: float = NOISE_PX,
    reading_deg: float | None = READING_DEG,
) -> list[Look]:
    """Each marker from three readings as the camera tells them (None: exactly), and what else is in the picture."""
    looks = []
    for marker in markers.values():
        pan, tilt = readings_at(mount, marker.translation)
        for aside, below in ASIDE:
            true = (pan + aside, tilt + below)
            camera = camera_in_apartment(mount, *true)
            told = true if reading_deg is None else tuple(round(a + rng.normal(0, reading_deg), 1) for a in true)
            for name, other in markers.items():
                corners = seen(camera, other)
                if corners is not None:
                    noisy = corners + rng.normal(0, noise_px, (4, 2))
                    looks.append(Look(name, noisy, PLAIN, *told))
    return looks


def seen(camera: Transform, marker: Transform) -> Array | None:
    """The corners where the marker is in the picture and faces the camera."""
    points = camera.inverse().apply(marker.apply(SQUARE * SIZE_M))
    facing = float(marker.rotation[:, 2] @ (camera.translation - marker.translation))
    if (points[:, 2] < 0.3).any() or facing < 0.2:
        return None
    pixels = PLAIN.project(points)
    away = np.abs(points[:, :2] / points[:, 2:]).max() > 1.0
    outside = (pixels < 20).any() or (pixels > np.array([PLAIN.width, PLAIN.height]) - 20).any()
    return None if away or outside else pixels


def placed(rng: np.random.Generator, markers: dict[int, Transform], off_m: float = PLACED_M) -> dict[int, Known]:
    """Where somebody says that they are: each off by so much, in any direction."""
    known = {}
    for name, marker in markers.items():
        way = rng.normal(size=3)
        x, y, z = marker.translation + off_m * way / np.linalg.norm(way)
        known[name] = Known((float(x), float(y), float(z)), SIZE_M, 0.01)
    return known


def mount_trial(rng: np.random.Generator, count: int = 5) -> MountTrial:
    """One calibration."""
    truth = hung(rng)
    markers = spread(rng, truth, count)
    found = fit(looks_at(truth, markers, rng), placed(rng, markers), Mount((0.0, 0.0, 0.0), "ceiling", **ARMS))
    return judged(found, truth)


@contextmanager
def calibrations() -> Iterator[Callable[[random.Random], float]]:
    """Turns of `make soak`: a lens, held to its bound, and a mount; how far off that is, mm."""

    def turn(rng: random.Random) -> float:
        dice = np.random.default_rng(rng.getrandbits(64))
        assert lens_trial(dice).focal_off <= bounds.LENS
        trial = mount_trial(dice)
        assert trial.turn_deg <= 3 * bounds.MOUNT_DEG, trial
        return 1000 * trial.place_m

    yield turn
