"""Every expected value is worked out by hand from section 7 of the contract."""

from __future__ import annotations

from math import cos, radians, sin, sqrt

import numpy as np
import pytest

from services.vision.frames import (
    Mount,
    Transform,
    camera_in_apartment,
    quaternion,
    rotation_x,
    rotation_y,
    rotation_z,
)

HALF = sqrt(0.5)
PLATE = (3.0, 2.0, 2.6)
CEILING = Mount(PLATE)
SHELF = Mount(PLATE, kind="shelf")
LEVERS = {"pan_to_tilt_m": (0.006, 0.078), "tilt_to_lens_m": (0.024, 0.004)}


def azimuth(degrees: float) -> tuple[float, float, float]:
    return cos(radians(degrees)), sin(radians(degrees)), 0.0


@pytest.mark.parametrize(
    ("mount", "pan", "tilt", "right", "down", "forward"),
    [
        pytest.param(CEILING, 0, 0, (0, -1, 0), (0, 0, -1), (1, 0, 0), id="ceiling looks along +x at pan 0"),
        pytest.param(CEILING, 90, 0, (-1, 0, 0), (0, 0, -1), (0, -1, 0), id="ceiling pans clockwise seen from above"),
        pytest.param(CEILING, 0, 90, (0, -1, 0), (-1, 0, 0), (0, 0, -1), id="ceiling tilt 90 looks straight down"),
        pytest.param(CEILING, 90, 90, (-1, 0, 0), (0, 1, 0), (0, 0, -1), id="ceiling pan turns the view from above"),
        pytest.param(CEILING, 0, 45, (0, -1, 0), (-HALF, 0, -HALF), (HALF, 0, -HALF), id="ceiling tilt 45"),
        pytest.param(CEILING, 180, 0, (0, 1, 0), (0, 0, -1), (-1, 0, 0), id="ceiling half a turn"),
        pytest.param(SHELF, 0, 0, (0, -1, 0), (0, 0, -1), (1, 0, 0), id="shelf looks along +x at pan 0"),
        pytest.param(SHELF, 90, 0, (1, 0, 0), (0, 0, -1), (0, 1, 0), id="shelf pans counter-clockwise"),
        pytest.param(SHELF, 0, 30, (0, -1, 0), (0.5, 0, -HALF * sqrt(1.5)), (HALF * sqrt(1.5), 0, 0.5), id="tilts up"),
    ],
)
def test_camera_axes_follow_pan_and_tilt(mount, pan, tilt, right, down, forward):
    camera = camera_in_apartment(mount, pan, tilt)
    np.testing.assert_allclose(camera.rotation, np.column_stack((right, down, forward)), atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "pan", "expected"),
    [("ceiling", 0, 35), ("ceiling", 41.1, -6.1), ("ceiling", 350, 45), ("shelf", 0, 35), ("shelf", 41.1, 76.1)],
)
def test_azimuth_is_yaw_minus_pan_on_a_ceiling_and_plus_on_a_shelf(kind, pan, expected):
    camera = camera_in_apartment(Mount(PLATE, kind=kind, yaw_deg=35.0), pan, 0.0)
    np.testing.assert_allclose(camera.rotation[:, 2], azimuth(expected), atol=1e-12)


@pytest.mark.parametrize(
    ("mount", "pan", "tilt", "lens"),
    [
        pytest.param(CEILING, 0, 0, (3.0, 2.0, 2.6), id="without levers the lens is at the plate"),
        pytest.param(Mount(PLATE, **LEVERS), 0, 0, (3.030, 2.0, 2.526), id="level: forward adds, down 78, up 4"),
        pytest.param(Mount(PLATE, **LEVERS), 0, 90, (3.010, 2.0, 2.498), id="down: along is down, up is forward"),
        pytest.param(Mount(PLATE, **LEVERS), 90, 0, (3.0, 1.970, 2.526), id="levers turn with the pan"),
        pytest.param(Mount(PLATE, kind="shelf", **LEVERS), 0, 0, (3.030, 2.0, 2.682), id="shelf: away is up"),
        pytest.param(Mount(PLATE, kind="shelf", **LEVERS), 0, 90, (3.002, 2.0, 2.702), id="shelf looking up"),
        pytest.param(Mount(PLATE, yaw_deg=90, **LEVERS), 0, 0, (3.0, 2.030, 2.526), id="yaw turns the levers"),
    ],
)
def test_lens_stands_where_the_lever_arms_put_it(mount, pan, tilt, lens):
    np.testing.assert_allclose(camera_in_apartment(mount, pan, tilt).translation, lens, atol=1e-12)


def test_lean_is_about_the_axes_of_the_base():
    """Leaning 10 degrees about x leaves the view along x, and lets the view along the base's y drop by 10."""
    mount = Mount(PLATE, lean_deg=(10.0, 0.0))
    np.testing.assert_allclose(camera_in_apartment(mount, 0, 0).rotation[:, 2], (1, 0, 0), atol=1e-12)
    side = camera_in_apartment(mount, 90, 0).rotation[:, 2]
    np.testing.assert_allclose(side, (0, -cos(radians(10)), -sin(radians(10))), atol=1e-12)


def test_sensor_roll_turns_the_picture_about_the_optical_axis():
    camera = camera_in_apartment(Mount(PLATE, sensor_roll_deg=90.0), 0, 0)
    np.testing.assert_allclose(camera.rotation[:, 0], (0, 0, -1), atol=1e-12)
    np.testing.assert_allclose(camera.rotation[:, 2], (1, 0, 0), atol=1e-12)


def test_point_on_the_optical_axis_is_seen_in_front():
    camera = camera_in_apartment(CEILING, 0, 45)
    np.testing.assert_allclose(camera.inverse().apply(np.array([4.0, 2.0, 1.6])), (0, 0, sqrt(2)), atol=1e-12)


def test_transforms_chain_and_undo():
    there = Transform(rotation_z(30) @ rotation_x(20), np.array([1.0, 2.0, 3.0]))
    points = np.array([[0.0, 0, 0], [1, -2, 3]])
    np.testing.assert_allclose((there.inverse() @ there).apply(points), points, atol=1e-12)
    np.testing.assert_allclose((there @ there).apply(points), there.apply(there.apply(points)), atol=1e-12)


@pytest.mark.parametrize(
    ("rotation", "expected"),
    [
        (np.eye(3), (0, 0, 0, 1)),
        (rotation_x(180), (1, 0, 0, 0)),
        (rotation_y(180), (0, 1, 0, 0)),
        (rotation_z(180), (0, 0, 1, 0)),
        (rotation_z(90), (0, 0, HALF, HALF)),
        (rotation_x(-90), (-HALF, 0, 0, HALF)),
        (rotation_y(240), (0, -sqrt(0.75), 0, 0.5)),
    ],
)
def test_quaternion_of_known_rotations(rotation, expected):
    np.testing.assert_allclose(quaternion(rotation), expected, atol=1e-12)
