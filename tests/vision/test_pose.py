from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.vision.detect import detect
from services.vision.frames import Mount, Transform, camera_in_apartment, rotation_x, rotation_z
from services.vision.pose import Located, View, locate, locate_each
from services.vision.prior import Prior
from services.vision.views import FIXED_PX, RANDOM_PX, average
from services.vision.zoom import Magnification
from tests.vision.rendering import Print, facing, picture, pinhole, true_corners

LENS = pinhole()
SIZE = 0.14
HERE = Transform(np.eye(3), np.zeros(3))
CEILING = Mount((3.05, 2.25, 2.60), yaw_deg=35.0, pan_to_tilt_m=(0.006, 0.078), tilt_to_lens_m=(0.024, 0.004))
POINTS = 40  # of a side that a line is fitted to
CORNER_VARIANCE = 6.2  # of a right corner on one axis, over that of one point by their number
EXACT = 1e-4  # degrees: pan and tilt without noise


def before(camera: Transform, seed: int, distance: float, tilt: tuple[float, float]) -> Print:
    """A marker in view of the camera, its normal off the line of sight by an angle between these two."""
    rng = np.random.default_rng(seed)
    place = np.array([rng.uniform(-0.15, 0.15), rng.uniform(-0.12, 0.12), 1.0]) * distance
    return Print(582, "DICT_5X5_1000", SIZE, camera @ facing(rng, place, rng.uniform(*tilt)))


def sighted(camera: Transform, marker: Print, rng: np.random.Generator, noise: float, angle: float = EXACT) -> View:
    """Its corners with this noise in pixels."""
    return View(LENS, camera, fitted(true_corners(LENS, camera, marker), rng, noise), SIZE, angle)


def fitted(square: np.ndarray, rng: np.random.Generator, noise: float) -> np.ndarray:
    """Its corners as they are found: where lines cross that are fitted to noisy points of the sides."""
    share = np.linspace(0.12, 0.88, POINTS)
    along = np.roll(square, -1, axis=0) - square
    normal = np.column_stack((along[:, 1], -along[:, 0])) / np.linalg.norm(along, axis=1)[:, None]
    slope, start = np.polyfit(share, rng.normal(0, noise * np.sqrt(POINTS / CORNER_VARIANCE), (POINTS, 4)), 1)
    here = np.stack((np.roll(normal, 1, axis=0), normal), axis=1)  # of the two sides that meet in a corner
    return square + np.linalg.solve(here, np.column_stack((np.roll(start + slope, 1), start))[..., None])[..., 0]


def photographed(camera: Transform, marker: Print, seed: int, **kwargs) -> View:
    """The corners as `detect` finds them in a picture."""
    image = picture(LENS, camera, [marker], np.random.default_rng(seed), **kwargs)
    (found,) = detect(image, "DICT_5X5_1000", {582})
    return View(LENS, camera, found.corners, SIZE)


def turned_deg(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(one.T @ other) - 1) / 2, -1, 1))))


def off_mm(located: Located, marker: Print) -> float:
    return float(np.linalg.norm(located.position - marker.pose.translation)) * 1000


def surprise(located: Located, marker: Print) -> float:
    """Squared Mahalanobis distance of the truth; its mean is 3 where the covariance is right."""
    off = located.position - marker.pose.translation
    return float(off @ np.linalg.solve(located.covariance, off))


def test_marker_flat_on_a_table_is_placed_by_hand_computed_numbers():
    """The camera looks straight down from 2.6 m onto a marker at 0.6 m, its top towards +x of the apartment."""
    camera = camera_in_apartment(Mount((3.0, 2.0, 2.6)), 0.0, 90.0)
    half = 1152 * 0.07 / 2.0
    middle = np.array([LENS.matrix[0, 2], LENS.matrix[1, 2]])
    corners = middle + half * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    located = locate([View(LENS, camera, corners, SIZE)])
    np.testing.assert_allclose(located.position, (3.0, 2.0, 0.6), atol=1e-6)
    expected = np.column_stack(((0, -1, 0), (1, 0, 0), (0, 0, 1)))
    np.testing.assert_allclose(located.orientations[0][0], expected, atol=1e-3)
    assert located.distance == pytest.approx(2.0, abs=1e-6)
    assert located.frames == 1


@pytest.mark.parametrize("spin", [0.0, 30.0, 90.0, 180.0])
@pytest.mark.parametrize("place", [(0.0, 0.0, 2.0), (0.4, 0.2, 2.0), (-0.5, 0.3, 4.0)])
def test_marker_exactly_parallel_to_the_picture_is_placed(spin, place):
    marker = Print(582, "DICT_5X5_1000", SIZE, Transform(rotation_x(180) @ rotation_z(spin), np.array(place)))
    located = locate([View(LENS, HERE, true_corners(LENS, HERE, marker), SIZE)])
    assert off_mm(located, marker) < 0.01
    assert turned_deg(located.orientations[0][0], marker.pose.rotation) < 1


def test_rendered_markers_are_placed_within_millimetres_at_three_metres():
    """And the orientation is right wherever it is said to be clear."""
    errors, ambiguous = [], 0
    for seed in range(40):
        camera = camera_in_apartment(CEILING, 41.1 + 7 * seed, 20.0 + seed)
        marker = before(camera, seed, 3.0, (5, 60))
        located = locate([photographed(camera, marker, seed, blur=1.0, noise=5.0)])
        errors.append(off_mm(located, marker))
        ambiguous += len(located.orientations) - 1
        nearest = min(turned_deg(rotation, marker.pose.rotation) for rotation, _ in located.orientations)
        assert nearest < 10
    assert np.median(errors) < 3
    assert np.max(errors) < 10
    assert ambiguous < 10


def test_clear_orientations_are_right_and_unclear_ones_hold_the_right_one():
    wrong = 0
    for seed in range(300):
        marker = before(HERE, seed, 4.0, (0, 60))
        located = locate([sighted(HERE, marker, np.random.default_rng(seed), RANDOM_PX)])
        nearest = min(turned_deg(rotation, marker.pose.rotation) for rotation, _ in located.orientations)
        wrong += nearest > 12
    assert wrong <= 6


def test_nearly_frontal_far_marker_is_ambiguous_with_both_candidates():
    both = 0
    for seed in range(40):
        marker = before(HERE, seed, 6.0, (4, 8))
        located = locate([sighted(HERE, marker, np.random.default_rng(seed), 0.05)])
        weights = [weight for _, weight in located.orientations]
        assert sum(weights) == pytest.approx(1.0)
        assert weights == sorted(weights, reverse=True)
        both += len(weights) == 2
    assert both >= 36


def test_two_candidates_of_a_square_mirror_each_other_about_the_line_of_sight():
    """Two poses tilted by 15 degrees to either side: their normals are about 30 degrees apart."""
    marker = Print(582, "DICT_5X5_1000", SIZE, Transform(rotation_x(180 + 15), np.array([0.0, 0.0, 6.0])))
    (one, _), (other, _) = locate([sighted(HERE, marker, np.random.default_rng(1), 0.05)]).orientations
    assert turned_deg(one, other) == pytest.approx(30, abs=8)


def test_second_camera_decides_what_one_leaves_open():
    flat = Print(582, "DICT_5X5_1000", SIZE, Transform(rotation_x(8), np.array([0.3, 0.2, 0.7])))
    down = Transform(np.diag([1.0, -1.0, -1.0]), np.array([0.3, 0.2, 4.7]))
    aside = Transform(rotation_x(-135.0), np.array([0.3, -2.8, 3.7]))
    single, joint = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        views = [sighted(down, flat, rng, 0.1), sighted(aside, flat, rng, 0.1)]
        single.append(len(locate(views[:1]).orientations))
        located = locate(views)
        joint.append(len(located.orientations))
        assert turned_deg(located.orientations[0][0], flat.pose.rotation) < 10
    assert single.count(2) >= 15
    assert joint.count(1) >= 18


@pytest.mark.parametrize("distance", [2.0, 3.0, 5.0])
def test_covariance_is_honest_for_the_corner_noise_it_assumes(distance):
    surprises = []
    for seed in range(200):
        marker = before(HERE, seed, distance, (0, 60))
        noise = average(true_corners(LENS, HERE, marker)[None])[1]
        surprises.append(surprise(locate([sighted(HERE, marker, np.random.default_rng(seed), noise)]), marker))
    assert 2.0 < np.mean(surprises) < 4.5
    assert np.mean(np.array(surprises) > 11.3) < 0.04  # 1 % of a chi-square with three degrees of freedom


def test_covariance_is_honest_with_noisy_angles_at_several_places():
    """Each place reads its pan and tilt with an error of its own; all frames of one place share it."""
    surprises = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        readings = (41.0, 50.0), (44.0, 47.0), (37.0, 52.0)
        marker = before(camera_in_apartment(CEILING, 41.0, 50.0), seed, 3.0, (10, 50))
        views = []
        for pan, tilt in readings:
            truly = camera_in_apartment(CEILING, pan + rng.normal(0, 0.05), tilt + rng.normal(0, 0.05))
            square = true_corners(LENS, truly, marker)
            fixed = fitted(square, rng, FIXED_PX) - square
            for _ in range(4):
                view = sighted(truly, marker, rng, RANDOM_PX, 0.05)
                views.append(
                    replace(view, camera=camera_in_apartment(CEILING, pan, tilt), corners=view.corners + fixed)
                )
        located = locate(views)
        surprises.append(surprise(located, marker))
        assert located.frames == 12
    assert 1.5 < np.mean(surprises) < 4.5


def spread_mm(located: Located) -> tuple[float, float]:
    """Along the ray and across it, for a camera that looks along z."""
    along, across = np.sqrt(np.diag(located.covariance)[[2, 0]]) * 1000
    return float(along), float(across)


def test_frames_of_one_place_sharpen_the_distance_but_not_the_angle():
    marker = Print(582, "DICT_5X5_1000", SIZE, Transform(rotation_x(180 + 30), np.array([0.0, 0.0, 4.0])))
    rng = np.random.default_rng(0)
    one, many = (locate([sighted(HERE, marker, rng, 0.0, 0.1) for _ in range(k)]) for k in (1, 16))
    assert spread_mm(many)[0] < 0.75 * spread_mm(one)[0]
    assert spread_mm(many)[1] == pytest.approx(spread_mm(one)[1], rel=0.01)
    assert spread_mm(many)[1] == pytest.approx(4000 * np.radians(0.1), rel=0.02)


def test_reading_that_jitters_between_frames_is_still_one_place():
    marker = before(camera_in_apartment(CEILING, 41.0, 50.0), 1, 4.0, (30, 40))
    cameras = [camera_in_apartment(CEILING, 41.0 + jitter, 50.0) for jitter in (0.0, 0.1, -0.1, 0.0)]
    corners = true_corners(LENS, cameras[0], marker)
    still = locate([View(LENS, cameras[0], corners, SIZE)] * 4)
    jittered = locate([View(LENS, camera, corners, SIZE) for camera in cameras])
    np.testing.assert_allclose(jittered.covariance, still.covariance, rtol=1e-6)


def test_nearer_view_weighs_more():
    marker = Print(582, "DICT_5X5_1000", SIZE, Transform(rotation_x(180 + 30), np.array([0.0, 0.0, 2.0])))
    far = Transform(np.eye(3), np.array([0.0, 0.0, -4.0]))
    rng = np.random.default_rng(0)
    near_view, far_view = sighted(HERE, marker, rng, 0.0), sighted(far, marker, rng, 0.0)
    wrong_by = Transform(np.eye(3), np.array([0.0, 0.0, -3.99]))  # the far one says 10 mm too far
    located = locate([near_view, replace(far_view, camera=wrong_by)])
    assert abs(located.position[2] - 2.0) < 0.001
    assert located.distance == pytest.approx(2.0, abs=0.002)


def test_views_that_disagree_widen_the_covariance():
    camera = camera_in_apartment(CEILING, 41.0, 50.0)
    marker = before(camera, 1, 3.0, (30, 40))
    agree = [
        sighted(camera_in_apartment(CEILING, p, 50.0), marker, np.random.default_rng(0), 0.0, 0.05) for p in (41, 43)
    ]
    disagree = [agree[0], replace(agree[1], camera=camera_in_apartment(CEILING, 44.0, 50.0))]
    assert np.trace(locate(disagree).covariance) > 10 * np.trace(locate(agree).covariance)


def corners_of_a_square() -> np.ndarray:
    return np.array([[300.0, 200], [360, 200], [360, 260], [300, 260]])


@pytest.mark.parametrize(
    "views",
    [
        pytest.param([], id="none"),
        pytest.param([View(LENS, HERE, corners_of_a_square()[::-1], SIZE)], id="counter-clockwise, as in a mirror"),
        pytest.param([View(LENS, HERE, np.full((4, 2), np.nan), SIZE)], id="not numbers"),
        pytest.param([View(LENS, HERE, np.full((4, 2), 300.0), SIZE)], id="a single point"),
    ],
)
def test_views_that_no_marker_explains_are_refused(views):
    with pytest.raises(ValueError, match="no pose explains them"):
        locate(views)


def visits(marker: Print, readings: list[tuple[float, float]], seed: int, began: float = 0.0) -> list[View]:
    """Four frames at each of these readings, one second apart."""
    rng, views = np.random.default_rng(seed), []
    for pan, tilt in readings:
        camera = camera_in_apartment(CEILING, pan, tilt)
        for _ in range(4):
            view = sighted(camera, marker, rng, RANDOM_PX, 0.05)
            views.append(replace(view, at=began + len(views)))
    return views


def shifted(marker: Print, metres: tuple[float, float, float]) -> Print:
    return replace(marker, pose=Transform(marker.pose.rotation, marker.pose.translation + np.array(metres)))


@pytest.mark.parametrize("metres", [(0.15, 0.0, 0.0), (0.0, -0.4, 0.1)])
@pytest.mark.parametrize("readings", [(41.0, 50.0), (44.0, 48.0)])
def test_a_marker_that_was_moved_is_not_averaged_and_the_newer_place_counts(readings, metres):
    marker = before(camera_in_apartment(CEILING, 41.0, 50.0), 3, 3.0, (20, 40))
    moved = shifted(marker, metres)
    views = visits(marker, [(41.0, 50.0), (43.0, 52.0)], 1) + visits(moved, [readings], 2, began=100.0)
    for order in (views, views[::-1]):
        (located,) = locate_each(order)
        assert off_mm(located, moved) < 20
        assert located.frames == 4
        assert all(order[index].at >= 100.0 for index in located.used)


def test_a_marker_that_was_moved_while_the_camera_stayed_is_not_averaged():
    marker = before(camera_in_apartment(CEILING, 41.0, 50.0), 3, 3.0, (20, 40))
    moved = shifted(marker, (0.03, 0.03, 0.0))
    views = visits(marker, [(41.0, 50.0)], 1) + visits(moved, [(41.0, 50.0)], 2, began=4.0)
    (located,) = locate_each(views)
    assert off_mm(located, moved) < 10
    assert located.frames == 4


def test_two_markers_of_one_id_in_the_same_frames_are_both_placed():
    one = before(camera_in_apartment(CEILING, 41.0, 50.0), 3, 3.0, (20, 40))
    other = shifted(one, (0.3, -0.2, 0.0))
    views = visits(one, [(41.0, 50.0), (43.0, 52.0)], 1) + visits(other, [(41.0, 50.0), (43.0, 52.0)], 2)
    located = locate_each(views)
    assert len(located) == 2
    for marker in (one, other):
        assert min(off_mm(found, marker) for found in located) < 20
    assert {found.frames for found in located} == {8}


def test_a_single_frame_that_many_contradict_is_left_out_even_when_it_is_the_newest():
    marker = before(camera_in_apartment(CEILING, 41.0, 50.0), 3, 3.0, (20, 40))
    views = visits(marker, [(41.0, 50.0)], 1)
    wrong = replace(views[0], corners=views[0].corners + np.array([40.0, 0.0]), at=50.0)
    (located,) = locate_each([*views, wrong])
    assert located.used == (0, 1, 2, 3)
    assert off_mm(located, marker) < 10


def test_a_frame_with_one_bad_corner_hardly_moves_the_mean():
    marker = before(HERE, 3, 4.0, (20, 40))
    rng = np.random.default_rng(1)
    views = [sighted(HERE, marker, rng, RANDOM_PX) for _ in range(8)]
    good = locate(views)
    spoilt = locate(
        [replace(views[0], corners=views[0].corners + np.array([[0.9, 0], [0, 0], [0, 0], [0, 0]])), *views[1:]]
    )
    assert np.linalg.norm(good.position - spoilt.position) < 0.01


def flat_on_a_table(seed: int, distance: float) -> tuple[Transform, Print]:
    """Seen obliquely from above, nearly at the limit of its two poses."""
    rng = np.random.default_rng(seed)
    marker = Print(582, "DICT_5X5_1000", SIZE, Transform(rotation_z(rng.uniform(0, 360)), np.array([0.1, 0.1, 0.0])))
    slant = rotation_x(180 + rng.uniform(6, 14))
    return Transform(slant, -slant @ np.array([0.0, 0.0, distance])), marker


def test_a_marker_known_to_lie_flat_is_placed_better_and_turned_the_right_way():
    errors, open_before, open_after = [], 0, 0
    for seed in range(60):
        camera, marker = flat_on_a_table(seed, 5.0)
        view = sighted(camera, marker, np.random.default_rng(seed), 0.1)
        plain, known = locate([view]), locate([view], Prior("up"))
        errors.append((off_mm(plain, marker), off_mm(known, marker)))
        open_before += len(plain.orientations) - 1
        open_after += len(known.orientations) - 1
        assert turned_deg(known.orientations[0][0], marker.pose.rotation) < 6
    plain_mm, known_mm = np.sqrt((np.array(errors) ** 2).mean(axis=0))
    assert known_mm < 0.9 * plain_mm
    assert open_before > 30
    assert open_after < 5


def test_a_marker_on_a_wall_is_told_from_its_mirror_image():
    open_after = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        hung = Print(
            582, "DICT_5X5_1000", SIZE, Transform(rotation_z(rng.uniform(-20, 20)) @ rotation_x(90), np.zeros(3))
        )
        camera = Transform(rotation_x(-90 - 20), np.array([0.0, -4.7, 1.7]))
        known = locate([sighted(camera, hung, rng, 0.1)], Prior("wall"))
        open_after += len(known.orientations) - 1
        assert turned_deg(known.orientations[0][0], hung.pose.rotation) < 12
    assert open_after < 8


def test_a_marker_that_does_not_lie_as_was_said_is_placed_all_the_same():
    marker = before(camera_in_apartment(CEILING, 41.0, 50.0), 3, 2.5, (20, 40))
    views = visits(marker, [(41.0, 50.0)], 1)
    assert abs(marker.pose.rotation[2, 2]) < 0.95
    located = locate(views, Prior("up"))
    assert off_mm(located, marker) < 10
    assert turned_deg(located.orientations[0][0], marker.pose.rotation) < 5


def test_an_unsure_focal_length_widens_the_depth_alone():
    marker = Print(582, "DICT_5X5_1000", SIZE, Transform(rotation_x(180 + 30), np.array([0.0, 0.0, 4.0])))
    view = sighted(HERE, marker, np.random.default_rng(0), 0.0)
    exact, unsure = locate([view]), locate([replace(view, focal_doubt=0.01)])
    assert spread_mm(unsure)[0] == pytest.approx(40, rel=0.05)
    assert spread_mm(unsure)[1] == pytest.approx(spread_mm(exact)[1], rel=0.01)


def test_zoomed_and_wide_views_are_put_together_by_what_each_knows():
    """The zoomed one's focal length is wrong by as much as it may be: the wide one counts for the distance."""
    marker = Print(582, "DICT_5X5_1000", SIZE, Transform(rotation_x(180 + 30), np.array([0.0, 0.0, 3.0])))
    rng = np.random.default_rng(0)
    wide = sighted(HERE, marker, rng, 0.01)
    far = Magnification(2.0, 0.02)
    corners = far.through(LENS).project(marker.corners())
    zoomed = View(Magnification(2.02, 0.02).through(LENS), HERE, corners, SIZE, EXACT, far.relative)
    located = locate([wide, zoomed])
    assert located.frames == 2
    assert off_mm(located, marker) < 6


def test_coarse_corners_add_nothing_to_clear_ones_of_a_place_and_alone_they_tell_how_coarse_they_are() -> None:
    marker = before(HERE, 3, 3.0, (20.0, 40.0))
    clear = sighted(HERE, marker, np.random.default_rng(1), 0.0, angle=0.05)
    swollen = clear.corners + 0.002 * (clear.corners - clear.corners.mean(axis=0))
    coarse = replace(clear, corners=swollen, enlarged=6.0)
    both, alone = locate([clear, clear, coarse, coarse]), locate([coarse, coarse])
    assert off_mm(both, marker) < 0.5 < 3.0 < off_mm(alone, marker)
    assert surprise(alone, marker) < 6.25
    assert both.covariance[2, 2] < alone.covariance[2, 2] / 10  # along the line of sight
