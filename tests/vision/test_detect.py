from __future__ import annotations

import cv2
import numpy as np
import pytest

from services.vision.detect import DICTIONARIES, Detection, detect
from services.vision.frames import Transform
from tests.vision.rendering import Print, facing, picture, pinhole, true_corners

CAMERA = Transform(np.eye(3), np.zeros(3))
LENS = pinhole()


def shown(seed: int, side_px: float, dictionary: str = "DICT_5X5_1000", marker: int = 582, tilt: float = 30.0) -> Print:
    """A marker about this large in the picture, anywhere near its middle and turned anyhow."""
    rng = np.random.default_rng(seed)
    depth = LENS.focal * 0.14 / side_px
    place = np.array([rng.uniform(-0.12, 0.12), rng.uniform(-0.1, 0.1), 1.0]) * depth
    return Print(marker, dictionary, 0.14, facing(rng, place, tilt))


def seen(*prints: Print, seed: int = 0, **kwargs) -> np.ndarray:
    return picture(LENS, CAMERA, prints, np.random.default_rng(seed), **kwargs)


def corner_error(detection: Detection, marker: Print) -> float:
    return float(np.linalg.norm(detection.corners - true_corners(LENS, CAMERA, marker), axis=1).max())


@pytest.mark.parametrize(
    ("dictionary", "marker"),
    [
        ("DICT_ARUCO_ORIGINAL", 582),
        ("DICT_4X4_50", 17),
        ("DICT_4X4_1000", 582),
        ("DICT_5X5_1000", 582),
        ("DICT_6X6_250", 17),
        ("DICT_7X7_1000", 582),
        ("DICT_APRILTAG_36h11", 582),
        ("DICT_ARUCO_MIP_36h12", 17),
    ],
)
@pytest.mark.parametrize("targeted", [True, False])
def test_markers_of_every_dictionary_are_read(dictionary, marker, targeted):
    for seed in range(3):
        on_wall = shown(seed, 50, dictionary, marker)
        (found,) = detect(seen(on_wall), dictionary, {marker} if targeted else None)
        assert found.marker == marker
        assert corner_error(found, on_wall) < 0.3
        assert 0.9 < found.confidence <= 1.0


@pytest.mark.parametrize("tilt", [0, 20, 45, 60])
def test_corners_start_at_the_markers_own_top_left_however_it_is_turned(tilt):
    """`facing` turns the print at random; a wrong order would be an error of a whole side."""
    for seed in range(12):
        on_wall = shown(seed, 70, tilt=tilt)
        (found,) = detect(seen(on_wall), "DICT_5X5_1000", {582})
        assert corner_error(found, on_wall) < 0.3


@pytest.mark.parametrize(
    ("side_px", "blur", "noise"), [(15, 0.6, 2.0), (17, 1.0, 5.0), (28, 1.5, 4.0)], ids=["sharp", "usual", "blurred"]
)
def test_small_targets_are_found(side_px, blur, noise):
    hits = [detect(seen(shown(s, side_px), seed=s, blur=blur, noise=noise), "DICT_5X5_1000", {582}) for s in range(20)]
    assert sum(len(found) == 1 for found in hits) >= 19


@pytest.mark.parametrize(("factor", "noise"), [(0.25, 3.0), (0.12, 2.0)])
def test_dark_pictures_are_read(factor, noise):
    for seed in range(5):
        on_wall = shown(seed, 40)
        dark = np.random.default_rng(seed).normal(seen(on_wall, noise=0.0) * factor + 8, noise)
        (found,) = detect(np.clip(np.rint(dark), 0, 255).astype(np.uint8), "DICT_5X5_1000", {582})
        assert corner_error(found, on_wall) < 1.0


def test_colour_is_read_as_grey_is():
    grey = seen(shown(0, 50))
    (found,) = detect(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), "DICT_5X5_1000", {582})
    np.testing.assert_allclose(found.corners, detect(grey, "DICT_5X5_1000", {582})[0].corners)


def side_by_side(*markers: tuple[str, int]) -> list[Print]:
    places = np.linspace(-0.5, 0.5, len(markers))
    upright = np.diag([1.0, -1.0, -1.0])
    return [
        Print(m, d, 0.14, Transform(upright, np.array([x, 0.1, 3.0])))
        for x, (d, m) in zip(places, markers, strict=True)
    ]


def test_only_targets_are_told_and_each_instance_of_them():
    book = "DICT_5X5_1000"
    image = seen(*side_by_side((book, 582), (book, 17), (book, 582)))
    assert [d.marker for d in detect(image, book, {582})] == [582, 582]
    assert [d.marker for d in detect(image, book, {17})] == [17]
    assert sorted(d.marker for d in detect(image, book)) == [17, 582, 582]
    assert detect(image, book, ()) == []


@pytest.mark.parametrize("neighbour", [838, 70, 518, 578, 583, 580, 590, 598, 614, 710])
def test_nearest_codes_of_the_dictionary_are_not_taken_for_the_target(neighbour):
    """These differ from 582 in three cells of 25, the least in this dictionary."""
    for seed in range(3):
        image = seen(shown(seed, 22, "DICT_ARUCO_ORIGINAL", neighbour), seed=seed, blur=1.0, noise=5.0)
        assert detect(image, "DICT_ARUCO_ORIGINAL", {582}) == []


def textures() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(5)
    noise = rng.integers(0, 256, (480, 640))
    blobs = cv2.GaussianBlur(rng.normal(128, 400, (480, 640)), (0, 0), 3)
    boxes = np.full((480, 640), 180.0)
    for _ in range(300):
        box = cv2.boxPoints(((rng.uniform(0, 640), rng.uniform(0, 480)), rng.uniform(8, 90, 2), rng.uniform(0, 90)))
        cv2.fillPoly(boxes, [box.astype(np.int32)], float(rng.uniform(0, 255)))
    tiles = np.kron(rng.integers(0, 2, (40, 54)) * 180 + 30, np.ones((12, 12)))[:480, :640]
    letters = np.full((480, 640), 230, np.uint8)
    for row in range(20, 480, 18):
        text = "".join(rng.choice(list("HOME0815#@MWBQ "), 60))
        cv2.putText(letters, text, (0, row), cv2.FONT_HERSHEY_PLAIN, 1.2, 20, 2)
    flat = rng.normal(90, 2, (480, 640))
    pictures = {"noise": noise, "blobs": blobs, "boxes": boxes, "tiles": tiles, "letters": letters, "flat": flat}
    return {name: np.clip(np.rint(image), 0, 255).astype(np.uint8) for name, image in pictures.items()}


@pytest.mark.parametrize("name", ["noise", "blobs", "boxes", "tiles", "letters", "flat"])
@pytest.mark.parametrize("dictionary", ["DICT_5X5_1000", "DICT_ARUCO_ORIGINAL"])
def test_nothing_is_found_where_nothing_is(name, dictionary):
    image = textures()[name]
    assert detect(image, dictionary, {582, 17, 70}) == []
    assert detect(image, dictionary) == []


def random_cells(rng: np.random.Generator) -> np.ndarray:
    """Squares with a dark border as a marker's, but any cells inside: printed codes of other makers, a crossword."""
    image = np.full((480, 640), 205.0)
    for x, y in np.ndindex(12, 9):
        inside = rng.integers(0, 2, (5, 5)) * 170.0 + 35
        image[y * 52 + 8 : y * 52 + 43, x * 52 + 8 : x * 52 + 43] = np.kron(
            np.pad(inside, 1, constant_values=35), np.ones((5, 5))
        )
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.8) + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)


def test_squares_with_random_cells_are_rarely_a_target():
    """Chance alone makes one in some hundreds nearest to 582 and near enough; ten pictures hold about a thousand."""
    false = [d for seed in range(10) for d in detect(random_cells(np.random.default_rng(seed)), "DICT_5X5_1000", {582})]
    assert len(false) <= 2


def test_a_marker_is_whole_where_all_its_corners_are_in_the_picture() -> None:
    square = np.array([[10.0, 10], [50, 10], [50, 50], [10, 50]])
    assert Detection(582, square, 1.0).whole(640, 480)
    for move in ((-20, 0), (0, -20), (595, 0), (0, 435), (-9, 0), (0, 428.5)):
        assert not Detection(582, square + np.array(move), 1.0).whole(640, 480)


def test_unknown_dictionary_names_the_choices():
    with pytest.raises(ValueError, match=r"dictionary: expected one of .*DICT_5X5_1000.*got 'DICT_9X9'"):
        detect(np.zeros((48, 64), np.uint8), "DICT_9X9")
    assert "DICT_ARUCO_ORIGINAL" in DICTIONARIES


def test_target_outside_the_dictionary_is_refused():
    with pytest.raises(ValueError, match=r"targets: expected ids 0 to 49 of DICT_4X4_50, got \[582\]"):
        detect(np.zeros((48, 64), np.uint8), "DICT_4X4_50", {582})


@pytest.mark.parametrize("image", [np.zeros((48, 64)), np.zeros((48, 64, 4), np.uint8), np.zeros(64, np.uint8)])
def test_other_kinds_of_pictures_are_refused(image):
    with pytest.raises(ValueError, match="image: expected uint8"):
        detect(image, "DICT_5X5_1000")


@pytest.mark.parametrize("shape", [(1, 1), (2, 300), (20, 20)])
def test_tiny_pictures_are_no_trouble(shape):
    assert detect(np.zeros(shape, np.uint8), "DICT_5X5_1000", {582}) == []
