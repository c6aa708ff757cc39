"""A click in the picture brings what was clicked at to the middle, whatever the camera looks at."""

from __future__ import annotations

import numpy as np
import pytest

from services.dashboard.aim import Sight
from services.vision.frames import Mount, camera_in_apartment
from services.vision.lens import Lens

LENS = Lens(
    1152, 648, np.array([[579.2, 0, 573.6], [0, 578.4, 326.4], [0, 0, 1.0]]), np.array([-0.061, 0.018, 0, 0, 0])
)
CEILING = Mount((3.05, 2.25, 2.6), "ceiling", 35.0, (0.4, -0.3), (0.006, 0.078), (0.024, 0.004), 0.5)
SHELF = Mount((1.0, 0.2, 1.2), "shelf", 100.0, (0.0, 0.0), (0.006, 0.078), (0.024, 0.004))


@pytest.mark.parametrize("mount", [CEILING, SHELF])
@pytest.mark.parametrize("zoom", [0.0, 4.0])
@pytest.mark.parametrize(("pan", "tilt"), [(0.0, 20.0), (271.0, 45.0), (120.0, 5.0)])
@pytest.mark.parametrize("click", [(0.5, 0.5), (0.9, 0.2), (0.1, 0.8)])
def test_what_was_clicked_at_is_in_the_middle_afterwards(
    mount: Mount, zoom: float, pan: float, tilt: float, click: tuple[float, float]
) -> None:
    sight = Sight(mount, LENS)
    found = sight.centring(*click, pan, tilt, zoom)
    assert found is not None
    lens = LENS.zoomed(sight.magnification(zoom))
    (ray,) = lens.rays(np.array([[click[0] * 1152 - 0.5, click[1] * 648 - 0.5]]))
    point = camera_in_apartment(mount, pan, tilt).apply(np.array([*ray, 1.0]) * 30.0)
    (pixel,) = lens.project(camera_in_apartment(mount, *found).inverse().apply(point)[None])
    off = np.linalg.norm(pixel - lens.matrix[:2, 2])
    assert off < 8.0 * sight.magnification(zoom)  # the mount leans, and the sensor is rolled, by half a degree


def test_calibrated_levels_of_zoom_count() -> None:
    sight = Sight(CEILING, LENS, ((2.0, 1.5), (4.0, 3.0)))
    assert sight.magnification(0.0) == 1.0
    assert sight.magnification(3.0) == pytest.approx(2.25)
    assert sight.magnification(9.0) == 3.0
