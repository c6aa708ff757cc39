"""Learning the lens as an order: a person shows a board, and the true lens comes out, is kept and used."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from services import document
from services.camera.service import CameraService
from services.virtual import VirtualApartment
from services.vision.board import Board
from services.vision.lens import Lens
from tests import bounds
from tests.camera.calibration.showing import ordered, person, true_lens, world_of
from tests.trials import virtual_flat
from tests.vision.lens_trials import reprojection

INFO = {
    "width": 2304, "height": 1296, "distortion_model": "plumb_bob", "D": [-0.1, 0.02, 0.0, 0.0, 0.0],
    "K": [1200.0, 0.0, 1150.0, 0.0, 1201.0, 650.0, 0.0, 0.0, 1.0],
}  # fmt: skip


@pytest.fixture
def flat(tmp_path: Path) -> Iterator[VirtualApartment]:
    with virtual_flat(tmp_path) as flat:
        yield flat


@pytest.fixture(scope="module")
def untouched(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualApartment]:
    """One for all orders that are refused."""
    with virtual_flat(tmp_path_factory.mktemp("untouched")) as flat:
        yield flat


def in_use(flat: VirtualApartment) -> Lens:
    """The lens that the running service reckons with."""
    service = next(runner.service for runner in flat.runners if isinstance(runner.service, CameraService))
    assert service.scanner.eye.lens is not None
    return service.scanner.eye.lens


def test_a_board_that_is_shown_gives_the_true_lens(flat: VirtualApartment, tmp_path: Path) -> None:
    file, truth = tmp_path / "config" / "ip1" / "ost.yaml", true_lens(world_of(flat).cameras["ip1"].lens)
    old = file.read_bytes()
    flat.look("ip1", tilt=45.0)
    end, told = ordered(flat, "CalibrateLens", "True", person(flat, Board(), np.random.default_rng(1)))
    assert (end.state, end.error) == ("done", None)
    found = Lens.from_camera_info(document.must(document.read(file)))
    assert np.diag(found.matrix)[:2] == pytest.approx(np.diag(truth.matrix)[:2], rel=bounds.LENS)
    assert found.matrix[:2, 2] == pytest.approx(truth.matrix[:2, 2], abs=5.0)
    assert reprojection(found, truth) < 2.0
    assert in_use(flat).matrix == pytest.approx(found.matrix, abs=1e-4)
    assert [one.read_bytes() for one in file.parent.glob("ost.yaml.*.bak")] == [old]
    assert "show it at the top far left" in told[0].said
    assert [one.progress for one in told] == sorted(one.progress for one in told)
    assert told[-1].state == "done"
    assert told[-1].report is not None
    page = Path(told[-1].report).read_text(encoding="utf-8")
    assert page.count("data:image/jpeg") == told[-1].views
    assert not re.search(r"(src|href)='?http", page)


def test_it_can_be_stopped_and_says_so(flat: VirtualApartment) -> None:
    def stops(_: object) -> None:
        flat.client.say("camera/ip1/order/Move", "Stop")

    end, told = ordered(flat, "CalibrateLens", "True", stops)
    assert end.state == "cancelled"
    assert told[-1].state == "cancelled"


def test_when_nothing_is_shown_it_fails_with_the_reason_and_changes_nothing(
    flat: VirtualApartment, tmp_path: Path
) -> None:
    old = (tmp_path / "config" / "ip1" / "ost.yaml").read_bytes()
    end, told = ordered(flat, "CalibrateLens", json.dumps({"value": {"seconds": 2}}))
    assert end.state == "failed"
    assert "no board is seen yet" in (end.error or "")
    assert told[-1].state == "failed"
    assert (tmp_path / "config" / "ip1" / "ost.yaml").read_bytes() == old


def test_a_lens_that_ros_has_calibrated_is_written_as_ros_reads_it_and_used(
    flat: VirtualApartment, tmp_path: Path
) -> None:
    end, _ = ordered(flat, "SetCameraInfo", json.dumps({"value": INFO, "id": "ros-1"}))
    assert (end.state, end.id) == ("done", "ros-1")
    content = document.must(document.read(tmp_path / "config" / "ip1" / "ost.yaml"))
    assert content["camera_matrix"] == {"rows": 3, "cols": 3, "data": INFO["K"]}
    assert content["distortion_coefficients"] == {"rows": 1, "cols": 5, "data": INFO["D"]}
    assert content["projection_matrix"]["data"][:4] == [1200.0, 0.0, 1150.0, 0.0]
    assert in_use(flat).matrix[0, 0] == 1200.0


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("SetCameraInfo", "True", "expected width, height"),
        ("SetCameraInfo", {**INFO, "K": [0.0] * 9}, "camera_matrix: expected"),
        ("SetCameraInfo", {**INFO, "D": [1.0]}, "distortion_coefficients.data: expected a list of 5"),
        ("SetCameraInfo", {**INFO, "distortion_model": "fisheye"}, "distortion_model: expected one of"),
        ("SetCameraInfo", {**INFO, "height": 1728}, "shape of"),
        ("CalibrateLens", {"columns": 2}, "squares each way"),
        ("CalibrateLens", {"board": "fridge"}, "board: "),
        ("CalibrateLens", {"dictionary": "DICT_4X4_50", "columns": 30, "rows": 20}, "dictionary of 300 markers"),
        ("CalibrateLens", "False", "expected True"),
        ("CalibrateMount", {"markers": {"582": [1, 2]}}, "markers.582"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(
    untouched: VirtualApartment, key: str, value: object, why: str
) -> None:
    end, _ = ordered(untouched, key, json.dumps({"value": value}))
    assert end.state == "refused"
    assert why in (end.error or "")
