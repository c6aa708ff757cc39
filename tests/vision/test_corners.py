from __future__ import annotations

import cv2
import numpy as np
import pytest

from services.vision.corners import refine, sample, unbent
from services.vision.frames import Transform
from services.vision.lens import Lens
from tests.vision.rendering import Print, facing, picture, pinhole, true_corners

CAMERA = Transform(np.eye(3), np.zeros(3))
LENS = pinhole(320, 240)


def view(seed: int, side_px: float, **kwargs) -> tuple[np.ndarray, np.ndarray]:
    """A marker about this large, tilted up to 45 degrees: the picture and its true corners."""
    rng = np.random.default_rng(seed)
    depth = LENS.focal * 0.14 / side_px
    place = np.array([*rng.uniform(-0.03, 0.03, 2), 1.0]) * depth
    marker = Print(582, "DICT_5X5_1000", 0.14, facing(rng, place, rng.uniform(0, 45)))
    return picture(LENS, CAMERA, [marker], rng, **kwargs), true_corners(LENS, CAMERA, marker)


def aside(
    lens: Lens, seed: int, depth: float, least: tuple[float, float] = (0.8, 0.5)
) -> tuple[np.ndarray, np.ndarray]:
    """A marker far from the lens's axis: the picture and its true corners."""
    rng = np.random.default_rng(seed)
    across, down = (rng.uniform(low, low + 0.2) for low in least)
    place = np.array([across, down, 1.0]) * depth
    marker = Print(582, "DICT_5X5_1000", 0.14, facing(rng, place, rng.uniform(0, 30)))
    return picture(lens, CAMERA, [marker], rng), true_corners(lens, CAMERA, marker)


def mean_error(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(found - truth, axis=-1).mean())


@pytest.mark.parametrize("side_px", [30, 45, 60, 80])
@pytest.mark.parametrize(("blur", "noise", "limit"), [(0.7, 3.0, 0.04), (1.0, 6.0, 0.1)])
def test_corners_are_exact_to_a_tenth_of_a_pixel_and_beat_subpix(side_px, blur, noise, limit):
    ours, theirs, truths = [], [], []
    for seed in range(15):
        image, truth = view(seed, side_px, blur=blur, noise=noise)
        rough = truth + np.random.default_rng(seed).uniform(-0.7, 0.7, (4, 2))
        window = max(2, round(0.3 * side_px / 7))
        criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 0.01)
        start = rough.astype(np.float32)[:, None].copy()
        theirs.append(cv2.cornerSubPix(image, start, (window, window), (-1, -1), criteria)[:, 0])
        ours.append(refine(image, rough, 7))
        truths.append(truth)
    error = mean_error(np.array(ours), np.array(truths))
    assert error < limit
    assert error < mean_error(np.array(theirs), np.array(truths))


@pytest.mark.parametrize("offset", [0.0, 0.25, 0.5, 0.75])
def test_corners_have_no_fixed_offset(offset):
    """A square drawn by area on a plain picture: its corners are where they are at every place on the pixel grid."""
    over, (low, high) = 20, (30.0 + offset, 70.0 + offset)
    grid = (np.arange(100 * over) + 0.5) / over - 0.5
    inside = ((grid > low) & (grid < high)).astype(float)
    inside = inside.reshape(100, over).mean(axis=1)
    image = np.rint(205 - 170 * cv2.GaussianBlur(np.outer(inside, inside), (0, 0), 0.7)).astype(np.uint8)
    truth = np.array([[low, low], [high, low], [high, high], [low, high]])
    rough = truth + np.array([[0.6, -0.4], [-0.5, 0.5], [0.4, 0.6], [-0.6, -0.3]])
    found = refine(image, rough, 7)
    np.testing.assert_allclose(found, truth, atol=0.04)


@pytest.mark.parametrize("seed", range(10))
def test_scratch_across_one_side_does_not_move_the_corners(seed):
    image, truth = view(seed, 60)
    start, end = 0.65 * truth[0] + 0.35 * truth[1], 0.55 * truth[0] + 0.45 * truth[1]
    cv2.line(image, np.rint(start).astype(int).tolist(), np.rint(end).astype(int).tolist(), 205, 3)
    assert mean_error(refine(image, truth, 7), truth) < 0.1


@pytest.mark.parametrize("seed", range(5))
def test_edges_of_a_few_grey_levels_are_enough(seed: int) -> None:
    image, truth = view(seed, 120, blur=2.5, noise=2.0)
    faint = np.rint(image * 0.05 + 10).astype(np.uint8)
    found = refine(faint, truth + np.random.default_rng(seed).uniform(-0.7, 0.7, (4, 2)), 7)
    assert found is not None
    assert mean_error(found, truth) < 0.5


def test_where_the_lens_bends_the_sides_corners_are_put_right() -> None:
    lens = Lens(320, 240, np.array([[180.0, 0, 40], [0, 180, 30], [0, 0, 1]]), np.array([-0.2, 0.03, 0, 0, 0]))
    plain, right = [], []
    for seed in range(10):
        image, truth = aside(lens, seed, 0.35)
        found = refine(image, truth, 7)
        assert found is not None
        plain.append(mean_error(found, truth))
        right.append(mean_error(unbent(found, lens), truth))
    assert np.mean(plain) > 0.5
    assert np.mean(right) < 0.1


def cut_off(seed: int, edge: int) -> tuple[np.ndarray, np.ndarray]:
    """A picture that ends within the marker, at its left (0), top, right or bottom edge, and the true corners."""
    image, truth = view(seed, 40 + seed)
    low, high = truth[:, 0].min(), truth[:, 0].max()
    first = round(low + np.random.default_rng(seed).uniform(0.0, 0.25) * (high - low))
    image, truth = image[:, first:], truth - (first, 0)
    for _ in range(edge):
        image, truth = np.rot90(image, -1), np.column_stack((image.shape[0] - 1 - truth[:, 1], truth[:, 0]))
    return np.ascontiguousarray(image), truth


@pytest.mark.parametrize("edge", range(4))
def test_corners_beyond_the_picture_are_told_by_what_is_seen_of_their_sides_or_not_at_all(edge: int) -> None:
    off = []
    for seed in range(40):
        image, truth = cut_off(seed, edge)
        beyond = ((truth < 0) | (truth > np.array(image.shape[::-1]) - 1)).any(axis=1)
        found = refine(image, truth + np.random.default_rng(seed).uniform(-0.7, 0.7, (4, 2)), 7)
        if beyond.any() and found is not None:
            off.append(np.linalg.norm(found - truth, axis=1).max())
    assert len(off) >= 15
    assert np.median(off) < 0.15
    assert max(off) < 1.5


@pytest.mark.parametrize("edge", range(4))
def test_a_side_beyond_the_picture_is_not_taken_for_the_picture_s_own_edge(edge: int) -> None:
    image, truth = np.full((240, 320), 205, np.uint8), np.array([[100.0, -10], [140, -10], [140, 30], [100, 30]])
    image[:31, 100:141] = 35
    for _ in range(edge):
        image, truth = np.rot90(image, -1), np.column_stack((image.shape[0] - 1 - truth[:, 1], truth[:, 0]))
    shown = np.clip(truth, 0, np.array(image.shape[::-1]) - 1)
    assert refine(np.ascontiguousarray(image), shown, 7) is None


def test_square_without_edges_is_none():
    square = np.array([[100.0, 100], [140, 100], [140, 140], [100, 140]])
    assert refine(np.full((240, 320), 120, np.uint8), square, 7) is None


def test_sample_is_bilinear_and_ends_at_the_picture():
    image = np.array([[0, 10], [20, 30]], np.uint8)
    x, y = np.array([0.0, 0.5, 0.5, 9.0, -9.0]), np.array([0.0, 0.0, 0.5, 0.0, 0.0])
    np.testing.assert_allclose(sample(image, x, y), [0, 5, 15, 10, 0], atol=0.05)
