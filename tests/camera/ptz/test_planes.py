"""The scale of the relative form: learnt from hops at whatever zoom, and from where hops led that began in flight."""

from __future__ import annotations

import random
from math import atan, degrees, log, pi, radians, sin, tan
from pathlib import Path
from statistics import median

import pytest

from services.camera.device import Identity
from services.camera.ptz.kept import Kept
from services.camera.ptz.planes import LEVELS, POINT, TURN, Planes, Strays
from services.camera.ptz.skill import Skill
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.latency import TAIL
from services.simulators.camera.motors import magnification
from tests.camera.goals import Rig, random_goals

WAY_DEG = 12.0
NOISE_DEG = 0.1


def seen(planes: Planes, axis: int, zoom: float, truth: float) -> None:
    """A hop of WAY_DEG by what is known, and where it truly led."""
    way = radians(WAY_DEG)
    led = degrees(atan(tan(way) / planes.at(zoom)[axis] * truth))
    planes.learn(planes.weights(axis, zoom) * sin(2 * way) / 2 * 180 / pi, led - WAY_DEG, NOISE_DEG)


@pytest.mark.parametrize("turn", range(10))
def test_a_scale_and_a_magnification_that_nobody_has_told_are_learnt_from_few_hops(turn: int) -> None:
    rng = random.Random(turn)
    wide, steep = (rng.uniform(0.7, 1.4), rng.uniform(0.4, 0.8)), rng.uniform(0.2, 0.3)
    planes = Planes()
    for _ in range(40):
        zoom, axis = rng.uniform(0.0, LEVELS - 1.0), rng.choice((0, 1))
        seen(planes, axis, zoom, wide[axis] / (1.0 + steep * zoom))
    for zoom in (0.0, 2.0, 4.0, 8.0):
        for axis, known in enumerate(planes.at(zoom)):
            off = abs(log(known * (1.0 + steep * zoom) / wide[axis]))
            assert off < 0.01 + 3 * planes.doubt(planes.weights(axis, zoom)) < 0.2


def test_what_pan_shows_at_a_level_tilt_knows_there_too() -> None:
    planes = Planes()
    for _ in range(3):
        seen(planes, 0, 0.0, 1.1)
        seen(planes, 1, 0.0, 0.6)
        seen(planes, 0, 6.0, 1.1 / 2.8)  # the picture is 2.8 times as large; 2.5 is the guess
    assert planes.at(6.0)[1] == pytest.approx(0.6 / 2.8, rel=0.03)
    assert planes.doubt(planes.weights(1, 6.0)) < planes.doubt(planes.weights(1, 2.0)) < 0.1


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_on_long_ways_the_scale_is_told_from_the_place_where_a_hop_began(seed: int) -> None:
    rig = Rig(PROFILES["ip2m-841b-strict"], seed)
    for goal in random_goals(50, seed):
        rig.go(goal)
        rig.now += 1.0
    lens = rig.camera.lens
    halves = lens.width / (2 * lens.fx), lens.height / (2 * lens.fy)
    levels = (0.0, 2.0, 4.0, 6.0, 8.0)
    planes = rig.skill.scales["Position"].planes
    assert planes.law is POINT
    known = [planes.at(zoom)[axis] * magnification(zoom) / halves[axis] for zoom in levels for axis in (0, 1)]
    assert median(abs(one - 1.0) for one in known) < 0.03
    assert max(abs(one - 1.0) for one in known) < 0.08


def test_what_was_learnt_of_it_is_kept(tmp_path: Path) -> None:
    identity, skill, again = Identity("M", "S1", "V1"), Skill(), Skill()
    point, _, turn = skill.scales["Position"].laws
    seen(point, 0, 0.0, 1.3)
    turn.likely = 5.0
    skill.scales["Position"].rested.add(0.1)
    skill.scales["Position"].flying.add(0.2)
    kept = Kept(tmp_path, "ip1")
    kept.recall(identity, skill)
    kept.save(skill)
    kept.written()
    Kept(tmp_path, "ip1").recall(identity, again)
    known = again.scales["Position"].laws[0]
    assert known.at(4.0) == pytest.approx(point.at(4.0))
    assert known.doubt(known.weights(0, 0.0)) < 0.1
    assert again.scales["Position"].planes.law is TURN
    shares = [(scale.rested.share, scale.flying.share) for scale in (one.scales["Position"] for one in (again, skill))]
    assert shares[0] == shares[1]
    assert len({*shares[0], Skill().scales["Position"].rested.share}) == 3


def test_where_hops_end_as_reckoned_experience_leaves_little_doubt_until_one_strays() -> None:
    strays = Strays()
    first = strays.share
    for _ in range(60):
        strays.add(0.1)
    assert 0.1 < strays.share < 0.2 < first
    strays.add(3.0)
    assert strays.share > 0.2
    for _ in range(40):
        strays.add(2.0)
    assert strays.share == 1.0  # there is no more doubt than all that is learnt leaves


@pytest.mark.parametrize("late", range(2, 7))
def test_a_hop_that_is_late_near_the_dead_arc_pushes_nothing_against_it(
    late: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = PROFILES["ip2m-841b-strict"]
    rig, latest = Rig(profile, 8), TAIL[1] * (profile.latency_s + profile.latency_spread_s)
    for goal in random_goals(8, 8):
        rig.go(goal)
    usual, asked = rig.device.latency.control, 0

    def control(now: float) -> float:
        nonlocal asked
        asked += 1
        return latest if asked == late else usual(now)

    for pan in range(156, 179, 2):
        assert not rig.go((20.0, 60.0, 6.0)).error
        asked = 0
        with monkeypatch.context() as patch:
            patch.setattr(rig.device.latency, "control", control)
            outcome = rig.go((float(pan), 58.0, 2.0))
        assert outcome.error is None
        assert outcome.pushed == 0.0
