"""Learning how the camera hangs as an order: it goes to the markers, and the true mount comes out, and is used."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from services.camera.service import CameraService
from services.virtual import VirtualApartment
from services.vision.frames import Mount, camera_in_apartment
from tests import bounds
from tests.camera.calibration.showing import ordered, world_of
from tests.camera.calibration.touring import calibrated, crooked_flat, mount_of, said_to_be
from tests.vision.mount_trials import angle_deg


@pytest.fixture
def flat(tmp_path: Path) -> Iterator[VirtualApartment]:
    with crooked_flat(tmp_path) as flat:
        yield flat


def in_use(flat: VirtualApartment) -> Mount:
    """The mount that the running service reckons with."""
    service = next(runner.service for runner in flat.runners if isinstance(runner.service, CameraService))
    assert service.scanner.eye.mount is not None
    return service.scanner.eye.mount


def test_five_markers_a_centimetre_off_give_the_mount_and_one_that_is_elsewhere_is_named(
    flat: VirtualApartment,
) -> None:
    truth, before = world_of(flat).cameras["ip1"].mount.frames, in_use(flat)
    assert np.linalg.norm(np.subtract(before.position, truth.position)) > 0.05
    markers = said_to_be(flat, np.random.default_rng(1))
    markers["100"] = [3.3, 5.2, 0.25]  # hangs at 5.549
    end, told = calibrated(flat, markers)
    assert (end.state, end.error) == ("done", None)
    found = mount_of(told[-1])
    assert np.linalg.norm(np.subtract(found.position, truth.position)) <= bounds.MOUNT_M
    turns = [
        angle_deg(camera_in_apartment(found, pan, tilt), camera_in_apartment(truth, pan, tilt))
        for pan, tilt in ((0.0, 10.0), (120.0, 45.0), (240.0, 80.0))
    ]
    assert max(turns) <= bounds.MOUNT_DEG
    assert told[-1].said == "not where they were said to be: 100"
    assert in_use(flat).position == pytest.approx(found.position, abs=1e-4)
    assert end.position is not None
    assert abs((end.position.pan + 180) % 360 - 180) <= 0.6  # back where it looked
    assert abs(end.position.tilt - 20.0) <= 0.6
    assert told[-1].report is not None
    page = Path(told[-1].report).read_text(encoding="utf-8")
    assert page.count("data:image/jpeg") >= 15
    assert "not where it was said to be" in page


@pytest.mark.parametrize(
    ("markers", "state", "why"),
    [
        ({"582": [3.9, 4.5, 0.46]}, "refused", "1 markers at known places, 3 are needed"),
        ({"7": [3.9, 4.5, 0.46], "8": [1.0, 1.0, 0.0], "9": [2.0, 1.0, 1.0]}, "cancelled", "stopped"),
    ],
)
def test_without_markers_there_is_no_mount(
    flat: VirtualApartment, markers: dict[str, list[float]], state: str, why: str
) -> None:
    def stops_the_search(told: object) -> None:
        if getattr(told, "views", 0) >= 1:
            flat.client.say("camera/ip1/order/Move", "Stop")

    old = in_use(flat)
    end, told = ordered(flat, "CalibrateMount", json.dumps({"value": {"markers": markers}}), stops_the_search)
    assert end.state == state
    assert why in (end.error or "")
    assert [one.state for one in told][-1:] == ([] if state == "refused" else ["cancelled"])
    assert in_use(flat) == old
