"""How the camera hangs, from markers: as close as the markers' places allow, honest about it, not misled by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.vision.calibrate_mount import fit
from services.vision.frames import Mount, Transform, rotation_z
from services.vision.mount_squares import Known
from tests import bounds
from tests.vision.mount_trials import ARMS, SIZE_M, hung, judged, looks_at, mount_trial, placed, spread

GUESS = Mount((0.0, 0.0, 0.0), "ceiling", **ARMS)


def test_five_markers_that_are_a_centimetre_off_give_the_mount_to_a_centimetre_and_a_third_of_a_degree() -> None:
    rng = np.random.default_rng(1)
    trials = [mount_trial(rng) for _ in range(5)]
    assert np.median([one.place_m for one in trials]) <= bounds.MOUNT_M
    assert max(one.place_m for one in trials) <= 0.020
    assert max(one.turn_deg for one in trials) <= 0.45
    assert np.median([one.turn_deg for one in trials]) <= bounds.MOUNT_DEG


@pytest.mark.parametrize("kind", ["ceiling", "shelf"])
def test_without_any_error_it_is_exact_in_every_number(kind: str) -> None:
    truth = Mount((3.1, 2.2, 2.6), "ceiling", 35.0, (0.8, -1.1), **ARMS, sensor_roll_deg=0.4, tilt_zero_deg=-0.7)
    markers = spread(np.random.default_rng(2), truth, 6)
    if kind == "shelf":
        over = Transform(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 3.0]))  # all of it upside down
        markers = {name: over @ one for name, one in markers.items()}
        truth = replace(truth, kind="shelf", position=(3.1, -2.2, 0.4), yaw_deg=-35.0, sensor_roll_deg=0.4)
    quiet = np.random.Generator(np.random.PCG64(1))
    looks = looks_at(truth, markers, quiet, noise_px=0.0, reading_deg=None)
    found = fit(looks, placed(quiet, markers, 0.0), replace(GUESS, kind=truth.kind))
    assert found.mount.position == pytest.approx(truth.position, abs=2e-4)
    assert found.mount.yaw_deg == pytest.approx(truth.yaw_deg, abs=0.01)
    assert found.mount.lean_deg == pytest.approx(truth.lean_deg, abs=0.02)
    assert found.mount.tilt_zero_deg == pytest.approx(truth.tilt_zero_deg, abs=0.03)
    assert found.mount.sensor_roll_deg == pytest.approx(truth.sensor_roll_deg, abs=0.03)
    assert all(not one.misplaced for one in found.markers.values())


def test_what_it_says_about_its_doubt_is_true() -> None:
    rng, sigmas = np.random.default_rng(3), []
    for _ in range(10):
        truth = hung(rng)
        markers = spread(rng, truth, 5)
        known = {
            name: Known(tuple(float(v) for v in one.translation + rng.normal(0, 0.01, 3)), SIZE_M, 0.01 * 3**0.5)
            for name, one in markers.items()
        }
        sigmas.append(judged(fit(looks_at(truth, markers, rng), known, GUESS), truth).sigmas)
    assert 0.65 < float(np.sqrt(np.mean(np.square(sigmas)))) < 1.35


def test_a_marker_that_is_not_where_it_was_said_to_be_is_named_and_hardly_pulls() -> None:
    rng = np.random.default_rng(4)
    truth = hung(rng)
    markers = spread(rng, truth, 6)
    known = placed(rng, markers)
    x, y, z = known[102].position
    known[102] = Known((x + 0.3, y - 0.2, z), SIZE_M)
    found = fit(looks_at(truth, markers, rng), known, GUESS)
    assert [name for name, one in found.markers.items() if one.misplaced] == [102]
    assert np.linalg.norm(found.markers[102].offset) == pytest.approx(0.36, abs=0.06)
    assert judged(found, truth).place_m < 0.03


def test_arms_that_nobody_measured_are_found_as_well_as_they_can_be() -> None:
    rng = np.random.default_rng(5)
    truth = hung(rng)
    markers = spread(rng, truth, 8)
    found = fit(looks_at(truth, markers, rng), placed(rng, markers, 0.002), Mount((0.0, 0.0, 0.0), "ceiling"))
    assert judged(found, truth).turn_deg < 0.3
    eye = np.array(found.mount.position) - truth.position
    assert abs(eye[2] + (found.mount.pan_to_tilt_m[1] - 0.078) * -1) < 0.03  # the height of the tilt axis is what shows
    assert np.linalg.norm(eye[:2]) < 0.03


@pytest.mark.parametrize(
    ("count", "places", "why"),
    [
        (2, None, "at least 3 markers"),
        (4, [(1.0 + 0.7 * i, 2.0, 0.0) for i in range(4)], "in one line"),
    ],
)
def test_what_gives_no_mount_is_said(count: int, places: list[tuple[float, float, float]] | None, why: str) -> None:
    rng = np.random.default_rng(6)
    truth = hung(rng)
    markers = spread(rng, truth, count)
    if places:
        markers = {i: Transform(rotation_z(20.0 * i), np.array(place)) for i, place in enumerate(places)}
    with pytest.raises(ValueError, match=why):
        fit(looks_at(truth, markers, rng), placed(rng, markers), GUESS)
