"""The zoom as an order, learnt from the simulated camera's own pictures in virtual time; its table and its file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from services.apartment import zoom_levels
from services.camera.calibration.zoom import Visit, table
from services.camera.service import CameraService
from services.errors import ConfigError
from services.payloads import Calibration, OrderResult
from services.simulators.camera.motors import magnification
from services.virtual import VirtualApartment
from services.vision.lens import Lens
from services.vision.zoom import WIDEST, Level, Magnification, at_level
from tests import bounds
from tests.camera.calibration.showing import ordered
from tests.trials import virtual_flat

SIZE = {"Width": 1152, "Height": 648}  # of the stream: quicker to draw


@dataclass
class Learnt:
    """A calibration that has ended: `visits` holds the measured and the true magnification of each."""

    flat: VirtualApartment
    end: OrderResult | None = None
    last: Calibration | None = None
    visits: list[tuple[float, float]] = field(default_factory=list)

    def hear(self, told: Calibration) -> None:
        if measured := re.search(r": ([0-9.]+) times", told.said):
            pose, _ = self.flat.insides["ip1"].device.motion(self.flat.now)
            self.visits.append((float(measured[1]), magnification(pose.zoom)))


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualApartment]:
    with virtual_flat(tmp_path_factory.mktemp("zoom")) as flat:
        for name, pixels in SIZE.items():
            flat.insides["ip1"].device.tables.fix(f"Encode[0].MainFormat[0].Video.{name}", str(pixels))
        yield flat


@pytest.fixture(scope="module")
def learnt(flat: VirtualApartment) -> Learnt:
    flat.look("ip1", pan=327.0, tilt=41.0, zoom=0.0)
    learnt = Learnt(flat)
    learnt.end, told = ordered(flat, "CalibrateZoom", "True", learnt.hear)
    learnt.last = told[-1]
    return learnt


def test_the_true_focal_length_of_every_visit_is_recovered(learnt: Learnt) -> None:
    assert learnt.end is not None
    assert (learnt.end.state, learnt.end.error) == ("done", None)
    assert len(learnt.visits) == 16
    for measured, true in learnt.visits:
        assert abs(measured / true - 1) < bounds.CALIBRATED_FOCAL


def test_the_table_holds_every_level_s_focal_length_and_how_surely_and_is_in_use(learnt: Learnt) -> None:
    service = next(one.service for one in learnt.flat.runners if isinstance(one.service, CameraService))
    found, lens, last = service.scanner.eye.levels, service.scanner.eye.lens, learnt.last
    assert [level.zoom for level in found] == [0, 2, 4, 6, 8]
    assert found[0].seen == WIDEST
    for _, true in learnt.visits:
        level = min(found, key=lambda level: abs(level.seen.times - true))
        assert abs(level.seen.times - true) <= 3 * max(level.seen.sigma, 0.001)
    assert last is not None
    assert lens is not None
    assert last.values["zoom 4"][0] == pytest.approx(lens.focal * found[2].seen.times)
    assert last.file is not None
    assert [level.zoom for level in zoom_levels.read(Path(last.file))] == [0, 2, 4, 6, 8]


def test_the_report_shows_what_each_visit_saw(learnt: Learnt) -> None:
    assert learnt.last is not None
    assert learnt.last.report is not None
    page = Path(learnt.last.report).read_text(encoding="utf-8")
    assert page.count("<polygon") == 16
    assert "data:image/jpeg" in page


def test_the_camera_looks_where_it_did_before(learnt: Learnt) -> None:
    assert learnt.end is not None
    position = learnt.end.position
    assert position is not None
    assert abs(position.pan - 327.0) < 0.6
    assert abs(position.tilt - 41.0) < 0.6
    assert position.zoom == 0.0


def test_a_camera_that_shows_nothing_to_compare_is_refused_with_the_reason(flat: VirtualApartment) -> None:
    hidden = flat.order("ip1", "Privacy", "ON")
    assert hidden is not None
    assert hidden.state == "done", hidden
    end, told = ordered(flat, "CalibrateZoom", "True")
    assert end.state in ("refused", "failed")
    assert "no zoomed picture could be compared with the wide one: the zoomed picture" in (end.error or "")
    assert told[-1].state == "failed"


def test_levels_that_scatter_are_unsure_and_those_that_do_not_are_sure() -> None:
    sure = [Visit(4, Magnification(2.0 + off, 0.0004)) for off in (0.0, 0.001, -0.001, 0.0)]
    scattered = [Visit(2, Magnification(1.5 + off, 0.0004)) for off in (-0.1, 0.1, -0.12, 0.12)]
    found = table([*sure, *scattered, Visit(6, Magnification(2.5, 0.001))], 0.0)
    assert [level.zoom for level in found] == [0, 2, 4]  # a single visit tells nothing of the next
    assert found[1].seen.relative > 0.05
    assert found[2].seen.relative < 0.002


def test_the_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = zoom_levels.of_lens(tmp_path / "ost.yaml")
    assert zoom_levels.read(file) == ()
    table = (Level(0.0, WIDEST), Level(2.0, Magnification(1.5, 0.01, 0.001, -0.002)))
    lens = Lens.from_camera_info({
        "image_width": 2304, "image_height": 1296,
        "camera_matrix": {"data": [1000, 0, 1152, 0, 1000, 648, 0, 0, 1]},
        "distortion_coefficients": {"data": [0, 0, 0, 0, 0]},
    })  # fmt: skip
    zoom_levels.write(file, table, lens)
    assert zoom_levels.read(file) == table
    assert "focal_px: 1500.0" in file.read_text()
    assert at_level(zoom_levels.read(file), 2.0) == table[1].seen


def test_a_wrong_file_is_told_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "zoom.yaml"
    file.write_text("levels:\n- zoom: 0\n  magnification: much\n  sigma: 0\n")
    with pytest.raises(ConfigError, match=r"zoom.yaml:3: levels\[0\].magnification: "):
        zoom_levels.read(file)
