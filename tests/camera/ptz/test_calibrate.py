"""Learning the motors on purpose, as an order: every speed is known afterwards, and kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.camera.ptz.calibrate import calibrate
from services.camera.ptz.goal import Limits
from services.camera.ptz.kept import recalled
from services.camera.ptz.skill import Skill
from services.simulators.camera.firmwares import PROFILES
from tests.camera.flat import Flat
from tests.camera.goals import Rig
from tests.camera.motors import PAN, Motors, drive


@pytest.fixture
def flat(tmp_path: Path) -> Flat:
    return Flat(tmp_path, motors=Motors(acceleration=120.0, faster=1.3), state=tmp_path / "state").online()


def test_every_speed_is_known_afterwards_and_kept(flat: Flat, tmp_path: Path) -> None:
    before = flat.motors.pose
    flat.order("CalibratePtz", "True")
    flat.until(flat.ended, 300.0)
    assert flat.last()["state"] == "done", flat.last()
    skill = recalled(tmp_path / "state", "ip1")
    assert skill is not None
    for speed, rate in enumerate(PAN, start=1):
        assert skill.paces[0].rate(speed) == pytest.approx(1.3 * rate, rel=0.08)
    assert flat.motors.pushed == 0.0
    assert not flat.motors.moving
    assert abs((flat.motors.pose[0] - before[0] + 180) % 360 - 180) <= 0.5


def test_it_can_be_stopped(flat: Flat) -> None:
    flat.order("CalibratePtz", "True", order_id="a")
    flat.run(8)
    flat.order("Move", "Stop", order_id="b")
    flat.until(lambda: flat.ended("a") and flat.ended("b"))
    assert flat.states("a")[-1] == "cancelled"
    assert not flat.motors.moving


def test_it_is_not_begun_by_a_no(flat: Flat) -> None:
    flat.order("CalibratePtz", "False")
    assert flat.last()["state"] == "refused"


def test_parts_of_the_picture_are_known_at_every_zoom_afterwards_where_the_firmware_goes_by_them() -> None:
    motors, skill, limits = Motors(relative="picture", acceleration=120.0), Skill(), Limits()
    skill.forget_senses(flip=True, mirror=True)
    run, _ = drive(calibrate(limits, skill), motors, limit_s=420.0)
    assert run.error is None
    assert skill.honours["Position"] == "yes"
    planes = skill.scales["Position"].planes
    doubts = [planes.doubt(planes.weights(axis, zoom)) for axis in (0, 1) for zoom in (0.0, 4.0, 8.0)]
    assert max(doubts) < 0.1  # of the part; 0.5 before
    assert motors.pushed == 0.0


@pytest.mark.parametrize("seed", range(1, 7))
def test_there_zoom_is_known_to_a_hundredth_for_how_far_a_hop_goes_depends_on_where_it_is(seed: int) -> None:
    profile = PROFILES["ip2m-841b-strict"]
    rig = Rig(profile, seed)
    rig.calibrate()
    assert rig.skill.drive(2).rate(1) == pytest.approx(profile.zoom_speed, rel=0.01)


@pytest.mark.parametrize(("rate", "grid"), [(2.0, 2.0), (5.0, 2.0), (4.0, 1.0)])
def test_how_fast_zoom_is_is_known_afterwards_although_it_is_told_in_coarse_steps(rate: float, grid: float) -> None:
    motors, skill, limits = Motors(zoom_rate=rate, zoom_grid=grid, acceleration=120.0), Skill(), Limits()
    run, _ = drive(calibrate(limits, skill), motors, limit_s=300.0)
    assert run.error is None
    assert skill.paces[2].rate(1) == pytest.approx(rate, rel=0.1)
    assert skill.paces[2].doubt(1) < 0.1 * rate
    assert motors.pushed == 0.0
    assert not motors.moving


def test_and_how_fast_a_position_drives_it_where_tilt_is_ignored() -> None:
    motors, skill, limits = (
        Motors(absolute="pan-only", zoom_rate=3.0, zoom_grid=2.0, acceleration=120.0),
        Skill(),
        Limits(),
    )
    run, _ = drive(calibrate(limits, skill), motors, limit_s=300.0)
    assert run.error is None
    assert skill.honours["PositionABS"] == "pan"
    rate, doubt = skill.zoom_rate.known()
    assert rate == pytest.approx(3.0, rel=0.03)
    assert doubt < 0.02
