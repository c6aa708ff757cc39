"""The plan that `apartment scan --plot` draws: rooms, places, what was found, and where it truly is when simulated."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from services.command_line import scanned
from services.vision.chart import RED, Mark, Plan, aim, draw, ellipse
from services.vision.frames import Mount
from tests.camera.scan.virtual_scan import virtual_scan

ROOMS = {"Living area": [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]}
MOUNT = Mount((2.0, 1.5, 2.6), yaw_deg=90.0)


def test_a_scan_is_drawn_from_what_was_said_about_it(tmp_path: Path) -> None:
    with virtual_scan(tmp_path, targets=[582]) as trial:
        trial.run('{"places": ["Living room", "Sofa"], "frames": 3}')
        heard = [*trial.flat.hub.retained.values(), *trial.flat.client.seen]
        said = [one for one in heard if one.topic.startswith("camera/ip1/") and not one.topic.endswith("order_result")]
        scanned.plot(trial.flat.apartment, "ip1", said, tmp_path / "out.png", None)
    image = cv2.imread(str(tmp_path / "out.png"))
    assert image is not None
    assert min(image.shape[:2]) > 900
    assert (np.abs(image.astype(int) - RED).max(axis=2) < 30).sum() > 30


def test_a_marker_is_drawn_where_it_was_found() -> None:
    def red(x: float, y: float) -> tuple[float, float]:
        image = draw(Plan("", ROOMS, MOUNT, {}, [Mark(582, (x, y))])).astype(int)
        rows, columns = np.nonzero(np.abs(image[:-200] - RED).max(axis=2) < 30)
        return float(np.median(columns)), float(np.median(rows))

    (left, low), (right, high) = red(1.0, 1.0), red(3.0, 2.0)
    assert right - left == pytest.approx(320, abs=3)
    assert low - high == pytest.approx(160, abs=3)


def test_the_figures_of_many_markers_are_all_within_the_picture() -> None:
    def told(markers: int) -> tuple[int, int]:
        marks = [Mark(600 + number, (1.0, 1.0), true=(1.1, 1.0)) for number in range(markers)]
        image = draw(Plan("ip1", ROOMS, MOUNT, {}, marks))
        below = image[round(4.2 * 160) + 2 :]  # without the line between
        assert (below[:, -6:] == 255).all(), "nothing is cut off at the right"
        return len(below), int((below < 128).all(axis=2).sum())

    (rows, ink), (more_rows, more_ink) = told(2), told(20)
    assert more_rows > rows
    assert more_ink > 5 * ink / 2


def test_the_ellipse_holds_nine_in_ten() -> None:
    rng = np.random.default_rng(1)
    covariance = np.array([[4e-4, 1.5e-4], [1.5e-4, 1e-4]])
    long, short, turn = ellipse(covariance)
    angle = np.radians(turn)
    points = rng.multivariate_normal([0, 0], covariance, 20_000)
    along = points @ [np.cos(angle), np.sin(angle)]
    across = points @ [-np.sin(angle), np.cos(angle)]
    assert np.mean((along / long) ** 2 + (across / short) ** 2 <= 1) == pytest.approx(0.9, abs=0.01)


def test_a_place_is_where_the_camera_looks() -> None:
    assert aim(MOUNT, 0.0, 45.0) == pytest.approx((2.0, 1.5 + 1.8), abs=0.05)
    assert aim(MOUNT, 90.0, 45.0) == pytest.approx((2.0 + 1.8, 1.5), abs=0.05)
    assert np.hypot(*np.subtract(aim(MOUNT, 0.0, -5.0), (2.0, 1.5))) < 4.1
