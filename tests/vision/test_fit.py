from __future__ import annotations

import cv2
import numpy as np
import pytest

from services.vision import codes
from services.vision.corners import refine
from services.vision.detect import detect
from services.vision.fit import fit, unbent
from services.vision.lens import Lens
from services.vision.views import straight
from tests.vision.test_corners import aside, mean_error, view

CELLS = codes.cells("DICT_5X5_1000", 582)
IN_A_LINE = np.array([[10.0, 50], [40, 50], [70, 50], [40, 50]])


def both(image: np.ndarray, truth: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """What the sides tell, and what the whole code tells from there."""
    by_sides = refine(image, truth + np.random.default_rng(seed).uniform(-0.7, 0.7, (4, 2)), 7)
    assert by_sides is not None
    by_code = fit(image, by_sides, CELLS)
    assert by_code is not None
    return by_sides, by_code


@pytest.mark.parametrize(("blur", "noise"), [(0.5, 2.0), (0.7, 3.0), (1.0, 6.0), (1.5, 3.0)])
@pytest.mark.parametrize("side_px", [24, 45, 100])
def test_a_whole_code_is_more_exact_than_its_sides(side_px: float, blur: float, noise: float) -> None:
    seen = [view(seed, side_px, blur=blur, noise=noise) for seed in range(10)]
    found = [both(image, truth, seed) for seed, (image, truth) in enumerate(seen)]
    truths = np.array([truth for _, truth in seen])
    by_sides, by_code = (mean_error(np.array(one), truths) for one in zip(*found, strict=True))
    assert by_code < 0.7 * by_sides


@pytest.mark.parametrize("quality", [15, 25, 40])
def test_what_an_encoder_does_to_its_blocks_moves_a_whole_code_half_as_far(quality: int) -> None:
    by_sides, by_code, truths = [], [], []
    for seed in range(20):
        image, truth = view(seed, 45)
        packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        sides, code = both(cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE), truth, seed)
        by_sides, by_code, truths = [*by_sides, sides], [*by_code, code], [*truths, truth]
    assert mean_error(np.array(by_code), np.array(truths)) < 0.5 * mean_error(np.array(by_sides), np.array(truths))


@pytest.mark.parametrize("offset", [0.0, 0.25, 0.5, 0.75])
@pytest.mark.parametrize("blur", [0.4, 0.7, 1.5])
def test_corners_have_no_fixed_offset_and_no_fixed_size(offset: float, blur: float) -> None:
    """Drawn by area, without noise: wherever it lies on the pixel grid, and however blurred it is."""
    over, begin, cell = 20, 20.0 + offset, 7.3
    at = ((np.arange(100 * over) + 0.5) / over - 0.5 - begin) / cell
    index = np.clip(np.floor(at).astype(int), -1, 7) + 1
    sharp = CELLS[np.ix_(index, index)].reshape(100, over, 100, over).mean(axis=(1, 3))
    image = np.rint(35 + 170 * cv2.GaussianBlur(sharp, (0, 0), blur)).astype(np.uint8)
    truth = begin + 7 * cell * np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    found = fit(image, truth + np.array([[0.3, -0.2], [-0.3, 0.2], [0.1, 0.3], [-0.2, -0.3]]), CELLS)
    np.testing.assert_allclose(found, truth, atol=0.02)


def test_where_the_lens_bends_a_marker_corners_are_put_right() -> None:
    lens = Lens(320, 240, np.array([[180.0, 0, 40], [0, 180, 30], [0, 0, 1]]), np.array([-0.1, 0.02, 0, 0, 0]))
    plain, right = [], []
    for seed in range(10):
        image, truth = aside(lens, seed, 0.45)
        found = both(image, truth, seed)[1]
        plain.append(mean_error(found, truth))
        right.append(mean_error(unbent(found, lens), truth))
    assert np.mean(plain) > 0.2
    assert np.mean(right) < 0.3 * np.mean(plain)


def shaded(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Half of it in a shadow."""
    half = np.arange(image.shape[1]) > truth[:, 0].mean()
    return np.rint(image * np.where(half, 0.35, 1.0)).astype(np.uint8)


def touched(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """A finger lies over a corner, and over a quarter of it."""
    middle = np.rint(0.8 * truth[0] + 0.2 * truth[2]).astype(int).tolist()
    return cv2.circle(image.copy(), middle, round(0.3 * np.linalg.norm(truth[0] - truth[1])), 140, -1)


def another(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Light and dark are the other way round."""
    return 240 - image


@pytest.mark.parametrize("spoilt", [shaded, touched, another])
@pytest.mark.parametrize("seed", range(8))
def test_where_the_code_does_not_explain_what_is_seen_there_is_no_answer(spoilt, seed: int) -> None:
    image, truth = view(seed, 60)
    assert fit(image, truth, CELLS) is not None
    assert fit(spoilt(image, truth), truth, CELLS) is None


@pytest.mark.parametrize("seed", range(5))
def test_another_code_there_is_no_answer(seed: int) -> None:
    image, truth = view(seed, 60)
    assert fit(image, truth, codes.cells("DICT_5X5_1000", 581)) is None
    assert fit(image, np.roll(truth, 1, axis=0), CELLS) is None


@pytest.mark.parametrize(
    "square", [np.full((4, 2), np.nan), np.full((4, 2), 50.0), np.eye(4, 2), 1e4 + 50 * np.eye(4, 2), IN_A_LINE]
)
def test_what_is_no_square_has_no_answer(square: np.ndarray) -> None:
    assert fit(view(0, 60)[0], square, CELLS) is None


def test_a_detection_tells_what_its_corners_come_from() -> None:
    image, truth = view(3, 60)
    (plain,), (shadow,) = (detect(one, "DICT_5X5_1000", {582}) for one in (image, shaded(image, truth)))
    assert plain.sides is not None
    assert shadow.sides is None
    assert mean_error(plain.corners, truth) < 0.02
    assert mean_error(shadow.corners, truth) < 0.3


@pytest.mark.parametrize(("bend", "limit"), [(-0.02, 0.03), (-0.06, 0.05), (-0.1, 0.06)])
def test_however_much_a_lens_bends_a_marker_its_corners_are_put_right(bend: float, limit: float) -> None:
    lens = Lens(320, 240, np.array([[180.0, 0, 40], [0, 180, 30], [0, 0, 1]]), np.array([bend, 0, 0, 0, 0]))
    off = []
    for seed in range(10):
        image, truth = aside(lens, seed, 0.45, (0.7, 0.4))
        (found,) = detect(image, "DICT_5X5_1000", {582})
        off.append(mean_error(straight(found.corners, found.sides, lens), truth))
    assert np.mean(off) < limit
