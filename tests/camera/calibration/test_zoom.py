"""The zoom is learnt from the simulated camera's own pictures, in virtual time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import SecretStr

from services.camera.address import Address
from services.camera.brands.amcrest import Amcrest
from services.camera.calibration import levels
from services.camera.calibration.zoom import Climb, Visit, table
from services.camera.plan import Plan, Until, ask, wait
from services.camera.ptz.goal import Limits
from services.camera.ptz.skill import Skill
from services.camera.requests import Refused, Reply, Snapshot
from services.camera.video import pictures
from services.camera.web.gate import Gate
from services.errors import ConfigError, DeviceError
from services.simulators.camera import Config
from services.simulators.camera.motors import Pose, magnification
from services.simulators.camera.program import inside
from services.virtual.wire import Wire
from services.vision.lens import Lens
from services.vision.zoom import WIDEST, Level, Magnification, at_level, measure
from tests import bounds

CONFIG = Path(__file__).parents[3] / "config"
START = 1000.0


class Camera:
    """The simulated camera, and a plan on it as the service runs it; `true` magnifications of the pictures taken."""

    def __init__(self) -> None:
        settings = Config.model_validate({"folder": CONFIG, "user": "ros", "password": "secret123"})
        self.behind = inside(settings, START)
        self.wire, self.now = Wire(self.behind), START
        for name, size in (("Width", 1152), ("Height", 648)):  # quicker to draw
            self.behind.device.tables.fix(f"Encode[0].MainFormat[0].Video.{name}", str(size))
        address = Address("http://192.0.2.9", "ros", SecretStr("secret123"))
        self.client = Amcrest(address, self.wire, Gate(clock=lambda: self.now, pause=lambda seconds: None))
        self.true: list[float] = []

    def run(self, plan: Plan[Any]) -> Any:
        answer: Reply | float | None = None
        while True:
            try:
                step = plan.send(answer)
            except StopIteration as stop:
                return stop.value
            if isinstance(step, Until):
                answer = self.now = max(self.now, step.at)
            else:
                self.wire.now, result, fault = self.now, None, None
                try:
                    result = self.client.send(step)
                except DeviceError as error:
                    fault = error
                answer = Reply(step, 1, result, fault, self.now, self.wire.now)
                self.now = self.wire.now

    def look(self, now: float) -> Plan[tuple[bytes, float]]:
        """A picture, and what it is truly magnified by."""
        yield from wait(now + 0.6)
        reply = yield from ask(Snapshot())
        pose, _ = self.behind.device.motion(reply.received)
        self.true.append(magnification(pose.zoom))
        return reply.result, reply.received

    def compare(self, wide: bytes, zoomed: bytes) -> Plan[tuple[Magnification, float]]:
        try:
            found = measure(pictures.decode(wide), pictures.decode(zoomed))
        except ValueError as error:
            raise Refused(str(error)) from error
        return found, (yield from wait(self.now))


@pytest.fixture(scope="module")
def learnt() -> tuple[Camera, Climb, tuple[Level, ...]]:
    camera = Camera()
    camera.behind.device.place(Pose(327.0, 41.0, 0.0), START)
    climb = Climb(Limits(), Skill(), camera.look, camera.compare, rounds=1)
    return camera, climb, camera.run(climb.plan())


def test_the_true_focal_length_of_every_visit_is_recovered(learnt: tuple[Camera, Climb, tuple[Level, ...]]) -> None:
    camera, climb, _ = learnt
    zoomed = [times for times in camera.true if times > 1.1]
    assert len(climb.visits) == len(zoomed) == 8
    for visit, true in zip(climb.visits, zoomed, strict=True):
        assert abs(visit.seen.times / true - 1) < bounds.CALIBRATED_FOCAL


def test_the_table_holds_what_a_level_is_magnified_by_and_how_surely(
    learnt: tuple[Camera, Climb, tuple[Level, ...]],
) -> None:
    camera, _, found = learnt
    assert [level.zoom for level in found] == [0, 2, 4, 6, 8]
    assert found[0].seen == WIDEST
    for true in camera.true:
        level = min(found, key=lambda level: abs(level.seen.times - true))
        assert abs(level.seen.times - true) <= 3 * max(level.seen.sigma, 0.001)


def test_the_camera_looks_where_it_did_before(learnt: tuple[Camera, Climb, tuple[Level, ...]]) -> None:
    camera, _, _ = learnt
    pose, _ = camera.behind.device.motion(camera.now)
    assert abs(pose.pan - 327.0) < 0.5
    assert abs(pose.tilt - 41.0) < 0.5
    assert pose.zoom < 1.0


def test_a_camera_that_shows_nothing_to_compare_is_refused_with_the_reason() -> None:
    camera = Camera()

    def look(now: float) -> Plan[tuple[bytes, float]]:
        return b"", (yield from wait(now))

    def nothing(wide: bytes, zoomed: bytes) -> Plan[tuple[Magnification, float]]:
        yield from wait(camera.now)
        raise Refused("too little in common")

    with pytest.raises(Refused, match="could be compared with the wide one: too little in common"):
        camera.run(Climb(Limits(), Skill(), look, nothing, rounds=1).plan())


def test_levels_that_scatter_are_unsure_and_those_that_do_not_are_sure() -> None:
    sure = [Visit(4, Magnification(2.0 + off, 0.0004)) for off in (0.0, 0.001, -0.001, 0.0)]
    scattered = [Visit(2, Magnification(1.5 + off, 0.0004)) for off in (-0.1, 0.1, -0.12, 0.12)]
    found = table([*sure, *scattered, Visit(6, Magnification(2.5, 0.001))], 0.0)
    assert [level.zoom for level in found] == [0, 2, 4]  # a single visit tells nothing of the next
    assert found[1].seen.relative > 0.05
    assert found[2].seen.relative < 0.002


def test_the_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = levels.of_lens(tmp_path / "ost.yaml")
    assert levels.read(file) == ()
    table = (Level(0.0, WIDEST), Level(2.0, Magnification(1.5, 0.01, 0.001, -0.002)))
    lens = Lens.from_camera_info({
        "image_width": 2304, "image_height": 1296,
        "camera_matrix": {"data": [1000, 0, 1152, 0, 1000, 648, 0, 0, 1]},
        "distortion_coefficients": {"data": [0, 0, 0, 0, 0]},
    })  # fmt: skip
    levels.write(file, table, lens)
    assert levels.read(file) == table
    assert "focal_px: 1500.0" in file.read_text()
    assert at_level(levels.read(file), 2.0) == table[1].seen


def test_a_wrong_file_is_told_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "zoom.yaml"
    file.write_text("levels:\n- zoom: 0\n  magnification: much\n  sigma: 0\n")
    with pytest.raises(ConfigError, match=r"zoom.yaml:3: levels\[0\].magnification: "):
        levels.read(file)
