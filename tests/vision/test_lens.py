from __future__ import annotations

import cv2
import numpy as np
import pytest

from services.vision.lens import Lens

OST: dict = {
    "image_width": 2304,
    "image_height": 1296,
    "camera_name": "ip1",
    "camera_matrix": {"rows": 3, "cols": 3, "data": [1150.0, 0, 1160.5, 0, 1152.0, 640.25, 0, 0, 1]},
    "distortion_model": "plumb_bob",
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [-0.30, 0.09, 0.0005, -0.0003, 0.001]},
    "rectification_matrix": {"rows": 3, "cols": 3, "data": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
    "projection_matrix": {"rows": 3, "cols": 4, "data": [1150.0, 0, 1160.5, 0, 0, 1152.0, 640.25, 0, 0, 0, 1, 0]},
}
RATIONAL = {
    **OST,
    "distortion_model": "rational_polynomial",
    "distortion_coefficients": {"rows": 1, "cols": 8, "data": [0.5, 0.1, 0.0005, -0.0003, 0.01, 0.8, 0.2, 0.02]},
}


def pixels(count: int = 400) -> np.ndarray:
    return np.random.default_rng(0).uniform((0, 0), (2303, 1295), (count, 2))


def with_depth(rays: np.ndarray) -> np.ndarray:
    return np.column_stack((rays, np.ones(len(rays))))


@pytest.mark.parametrize("content", [OST, RATIONAL], ids=["plumb_bob", "rational_polynomial"])
def test_projects_as_opencv_does_and_rays_lead_back(content):
    lens = Lens.from_camera_info(content)
    rays = lens.rays(pixels())
    theirs = cv2.projectPoints(with_depth(rays), np.zeros(3), np.zeros(3), lens.matrix, lens.distortion)[0][:, 0]
    np.testing.assert_allclose(lens.project(3.7 * with_depth(rays)), theirs, atol=1e-9)
    np.testing.assert_allclose(theirs, pixels(), atol=1e-6)


def test_point_behind_the_lens_is_not_in_the_picture():
    lens = Lens.from_camera_info(OST)
    assert np.isnan(lens.project(np.array([[0.1, 0.1, -1.0], [0.0, 0.0, 0.0]]))).all()


def test_pixel_that_no_ray_reaches_has_none():
    barrel = {**OST, "distortion_coefficients": {"data": [-0.3, 0, 0, 0, 0]}}  # bends back from 0.70 on
    rays = Lens.from_camera_info(barrel).rays(
        np.array([[1160.5, 640.25], [1160.5 + 0.69 * 1150, 640.25], [9000.0, 640]])
    )
    assert np.isnan(rays).all(axis=1).tolist() == [False, False, True]


def test_scaling_keeps_pixel_centres_on_whole_numbers():
    half = Lens.from_camera_info(OST).scaled(1152, 648)
    expected = [[575.0, 0, (1160.5 + 0.5) / 2 - 0.5], [0, 576.0, (640.25 + 0.5) / 2 - 0.5], [0, 0, 1]]
    np.testing.assert_allclose(half.matrix, expected)
    assert (half.width, half.height) == (1152, 648)


def test_scaled_lens_sees_the_same_rays():
    lens = Lens.from_camera_info(OST)
    small = (pixels() + 0.5) * (1920 / 2304) - 0.5
    np.testing.assert_allclose(lens.scaled(1920, 1080).rays(small), lens.rays(pixels()), atol=1e-9)


@pytest.mark.parametrize("size", [(640, 480), (2304, 1270)])
def test_picture_of_another_aspect_is_refused(size):
    with pytest.raises(ValueError, match=f"expected the aspect of 2304x1296, got {size[0]}x{size[1]}"):
        Lens.from_camera_info(OST).scaled(*size)


def test_zoomed_lens_sees_the_crop_about_the_middle():
    """At magnification 2, the pixel shown at (0, 0) is the one a quarter of the way to the middle from the corner."""
    lens = Lens.from_camera_info(OST)
    middle = np.array([[1151.5, 647.5]])
    shown, was = np.array([[0.0, 0.0]]), middle / 2
    np.testing.assert_allclose(lens.zoomed(2.0).rays(shown), lens.rays(was), atol=1e-9)
    np.testing.assert_allclose(lens.zoomed(2.0).rays(middle), lens.rays(middle), atol=1e-9)
    assert lens.zoomed(2.0).focal == pytest.approx(2 * lens.focal)


def without(key: str) -> dict:
    return {k: v for k, v in OST.items() if k != key}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (without("image_width"), "image_width: expected a whole number"),
        ({**OST, "image_height": "1296"}, "image_height: expected a whole number"),
        ({**OST, "image_height": True}, "image_height: expected a whole number"),
        ({**OST, "image_width": 0}, "image_width: expected a whole number"),
        (without("camera_matrix"), "camera_matrix.data: expected a list of 9 numbers, got None"),
        ({**OST, "camera_matrix": {"data": [1, 2, 3]}}, "camera_matrix.data: expected a list of 9"),
        ({**OST, "camera_matrix": {"data": [0.0, 0, 1, 0, 1, 1, 0, 0, 1]}}, "camera_matrix: expected .*above 0"),
        ({**OST, "camera_matrix": {"data": [1150.0, 0, 1, 0, 1150, 1, 0, 0, 2]}}, "camera_matrix: expected"),
        (
            {**OST, "distortion_coefficients": {"data": [0, 0, 0, 0]}},
            "distortion_coefficients.data: expected a list of 5",
        ),
        ({**OST, "distortion_coefficients": {"data": [0, 0, 0, 0, "a"]}}, "distortion_coefficients.data: expected"),
        ({**OST, "distortion_coefficients": {"data": [0, 0, 0, 0, float("nan")]}}, "distortion_coefficients.data"),
        ({**OST, "distortion_model": "rational_polynomial"}, "distortion_coefficients.data: expected a list of 8"),
        (
            {**OST, "distortion_model": "equidistant"},
            "distortion_model: expected one of plumb_bob, rational_polynomial",
        ),
    ],
)
def test_faulty_calibration_is_told_by_its_key(content, message):
    with pytest.raises(ValueError, match=message):
        Lens.from_camera_info(content)
