"""The magnification of a zoomed picture, from pictures of the simulator's scenes and from a calibrated table."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from services.simulators.camera.view.optics import window
from services.simulators.camera.view.scene import Scene
from services.simulators.world import load
from services.vision.lens import Lens
from services.vision.zoom import Level, Magnification, at_level, measure
from tests.vision import sighted
from tests.vision.sighted import flat

WORLD = load(Path(__file__).parents[2] / "config/world.yaml")
CAMERA = WORLD.cameras["ip1"]
SIZE = (1152, 648)  # half the sensor's: enough here, and quicker


def photograph(scene: Scene, place: str, times: float, seed: int, turned: float = 0.0) -> np.ndarray:
    """What the camera delivers there at this magnification, with noise and JPEG."""
    rng = np.random.default_rng(seed)
    pan, tilt = CAMERA.aim(CAMERA.places[place].looks_at)
    sensor = tuple(min(full, round(side / times)) for full, side in zip(SIZE, (2304, 1296), strict=True))
    image = scene.draw(CAMERA.pose(pan + turned, tilt), window(CAMERA.lens, times, *sensor))
    noisy = np.clip(image + rng.normal(0, 2.2, image.shape), 0, 255).astype(np.uint8)
    _, data = cv2.imencode(".jpg", cv2.resize(noisy, SIZE), [cv2.IMWRITE_JPEG_QUALITY, 88])
    return cv2.imdecode(data, cv2.IMREAD_COLOR)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(WORLD, CAMERA.lens, seed=4)


@pytest.mark.parametrize(
    ("place", "times"), [("Living room", 1.31), ("Kitchen", 1.77), ("Window", 2.05), ("Desk", 2.9), ("Hall", 1.0)]
)
def test_the_magnification_is_measured_to_a_tenth_of_a_percent(scene: Scene, place: str, times: float) -> None:
    found = measure(photograph(scene, place, 1.0, 1), photograph(scene, place, times, 2))
    assert abs(found.times / times - 1) < 0.001
    assert abs(found.times - times) < 4 * found.sigma
    assert max(abs(found.right), abs(found.down)) < 0.001


def test_another_picture_mode_and_less_light_do_not_disturb(scene: Scene) -> None:
    wide, zoomed = photograph(scene, "Living room", 1.0, 1), photograph(scene, "Living room", 1.6, 2)
    grey = cv2.cvtColor(zoomed, cv2.COLOR_BGR2GRAY)
    hard = np.clip((grey.astype(float) - 128) * 2 + 100, 0, 255).astype(np.uint8)
    dark = np.clip(zoomed * 0.25 + np.random.default_rng(1).normal(0, 5, zoomed.shape), 0, 255).astype(np.uint8)
    for other in (hard, dark):
        assert abs(measure(wide, other).times / 1.6 - 1) < 0.002


@pytest.mark.parametrize(
    ("seed", "pan", "tilt", "times"), [(213, 88, 14, 2.0), (213, 210, 15, 2.6), (217, 81, 5, 2.4), (229, 39, 15, 1.9)]
)
def test_where_hardly_more_than_a_wall_is_seen_its_clouds_tell(seed: int, pan: float, tilt: float, times: float):
    room, rng = flat(seed), np.random.default_rng(seed)
    pose = room.camera.pose(pan, tilt)
    found = measure(sighted.photograph(room, pose, 1.0, rng), sighted.photograph(room, pose, times, rng))
    assert abs(found.times / times - 1) < 0.002
    assert abs(found.times - times) < 4 * found.sigma


@pytest.mark.parametrize("titled", [False, True])
def test_walls_without_anything_never_deceive_even_with_a_title_over_both_pictures(titled: bool) -> None:
    """Some are told by their clouds, a few grey levels deep, and the line to the ceiling; others are refused."""
    off = []
    for seed in range(12):
        furnished, rng, times = flat(seed), np.random.default_rng(seed), (1.4, 2.0, 2.6)[seed % 3]
        bare = furnished.world.model_copy(update={"furniture": ()})
        room = replace(furnished, world=bare, scene=Scene(bare, furnished.camera.lens, seed))
        pose = room.camera.pose(40.0 * seed, 6.0)
        wide, zoomed = (sighted.photograph(room, pose, each, rng) for each in (1.0, times))
        for image in (wide, zoomed) if titled else ():
            cv2.putText(image, "2026-11-23 10:00:00", (1750, 60), cv2.FONT_HERSHEY_SIMPLEX, 1.6, (255, 255, 255), 3)
            cv2.putText(image, "Living room", (40, 1260), cv2.FONT_HERSHEY_SIMPLEX, 1.6, (255, 255, 255), 3)
        with suppress(ValueError):
            found = measure(wide, zoomed)
            off.append((found.times - times, found.sigma))
    assert off
    assert all(abs(wrong) < 4 * sigma < 0.04 for wrong, sigma in off), off


def test_what_somebody_moved_meanwhile_does_not_disturb(scene: Scene) -> None:
    wide, zoomed = photograph(scene, "Living room", 1.0, 1), photograph(scene, "Living room", 1.6, 2)
    zoomed[150:450, 100:550] = np.random.default_rng(1).integers(0, 255, (300, 450, 3))
    assert abs(measure(wide, zoomed).times / 1.6 - 1) < 0.002


def test_a_camera_that_turned_meanwhile_is_refused(scene: Scene) -> None:
    with pytest.raises(ValueError, match="no zoom turns"):
        measure(photograph(scene, "Living room", 1.0, 1), photograph(scene, "Living room", 1.6, 2, turned=3.0))


def test_pictures_of_two_places_and_of_nothing_are_refused(scene: Scene) -> None:
    wide = photograph(scene, "Living room", 1.0, 1)
    blank = np.clip(np.random.default_rng(2).normal(200, 2, wide.shape), 0, 255).astype(np.uint8)
    for other in (photograph(scene, "Kitchen", 1.6, 2), blank):
        with pytest.raises(ValueError, match="the zoomed picture and the wide one"):
            measure(wide, other)


def test_pictures_of_two_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="another shape"):
        measure(np.zeros((480, 640), np.uint8), np.zeros((360, 640), np.uint8))


def test_the_lens_of_a_zoomed_picture_sends_every_ray_to_the_enlarged_pixel() -> None:
    matrix = np.array([[580.0, 0, 570.0], [0, 578.0, 330.0], [0, 0, 1]])
    lens = Lens(*SIZE, matrix, np.array([-0.1, 0.02, 0.001, -0.001, 0.0]))
    points = np.array([[0.1, 0.2, 1.0], [-0.3, 0.1, 1.0]])
    middle = np.array([575.5, 323.5])
    zoomed = Magnification(1.7, 0.0, right=0.01, down=-0.02).through(lens)
    wanted = 1.7 * (lens.project(points) - middle) + middle + 1152 * np.array([0.01, -0.02])
    np.testing.assert_allclose(zoomed.project(points), wanted, atol=1e-9)


def test_a_level_of_the_table_is_known_with_its_uncertainty() -> None:
    levels = [Level(4, Magnification(2.0, 0.02)), Level(0, Magnification(1.0, 0.0)), Level(2, Magnification(1.5, 0.01))]
    assert at_level(levels, 2) == Magnification(1.5, 0.01)
    between = at_level(levels, 3)
    assert between is not None
    assert between.times == pytest.approx(1.75)
    assert between.sigma > 0.1
    assert at_level(levels, 6) is None
    assert at_level([], 0) is None
