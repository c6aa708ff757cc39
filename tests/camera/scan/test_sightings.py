"""From sightings to results: what is published of a marker, and why sometimes there is no position."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.camera.device import Reading
from services.camera.scan.sightings import Eye, Sighting, Sought, results
from services.camera.settings import MarkerSizes
from services.payloads import ScanResult
from services.vision.detect import Detection
from services.vision.frames import Array, Mount, Transform, camera_in_apartment, rotation_x, rotation_z
from services.vision.prior import Prior
from services.vision.zoom import Level, Magnification
from tests.vision.rendering import Print, pinhole, true_corners

LENS = pinhole(2304, 1296)
MOUNT = Mount((3.05, 2.25, 2.60), yaw_deg=35.0, pan_to_tilt_m=(0.006, 0.078), tilt_to_lens_m=(0.024, 0.004))
EYE = Eye("ip1", "DICT_5X5_1000", LENS, MOUNT, angle_noise_deg=0.001)
TURNED = rotation_z(40.0) @ rotation_x(15.0)
HERE = Reading(30.0, 45.0, 0.0)
SOUGHT = Sought(582, 0.14)


def ahead(reading: Reading, metres: float = 2.5, aside: float = 0.0) -> Print:
    """A marker before the camera."""
    camera = camera_in_apartment(MOUNT, reading.pan, reading.tilt)
    return Print(582, "DICT_5X5_1000", 0.14, Transform(TURNED, camera.apply(np.array([aside, 0.1, metres]))))


def seen(
    marker: Print, reading: Reading = HERE, at: float = 100.0, times: float = 1.0, frames: int = 3
) -> list[Sighting]:
    """Its exact corners, a second apart."""
    lens = Magnification(times, 0.0).through(LENS)
    corners = true_corners(lens, camera_in_apartment(MOUNT, reading.pan, reading.tilt), marker)
    detection = Detection(582, corners, 0.9)
    return [Sighting(detection, f"pan {reading.pan:g}", reading, at + k, (2304, 1296)) for k in range(frames)]


def said(sightings: list[Sighting], eye: Eye = EYE, sought: Sought = SOUGHT) -> list[ScanResult]:
    return results(eye, sought, sightings, "scan", "color")


def place(result: ScanResult) -> Array:
    assert result.position is not None, result.why
    return np.array([result.position.x, result.position.y, result.position.z])


def off_mm(result: ScanResult, marker: Print) -> float:
    return 1000 * float(np.linalg.norm(place(result) - marker.pose.translation))


@pytest.mark.parametrize(
    ("eye", "zoom", "degrees"),
    [
        (EYE, 0.0, 0.0),
        (EYE, 0.5, 0.0),  # hardly zoomed, if at all
        (EYE, 2.0, 2.2),
        (replace(EYE, lens=None), 2.0, 2.3),
        (replace(EYE, levels=(Level(2.0, Magnification(1.05, 0.0)), Level(4.0, Magnification(2.0, 0.0)))), 2.0, 1.1),
        (replace(EYE, levels=(Level(2.0, Magnification(1.05, 0.0)), Level(4.0, Magnification(2.0, 0.0)))), 4.0, 3.0),
    ],
)
def test_beside_a_place_that_was_saved_zoomed_the_widest_picture_shows_it_whole(
    eye: Eye, zoom: float, degrees: float
) -> None:
    assert eye.slack_deg(zoom) == pytest.approx(degrees, abs=0.2)


def test_what_is_seen_is_published_with_place_time_and_number_of_frames() -> None:
    marker = ahead(HERE)
    (result,) = said(seen(marker))
    assert off_mm(result, marker) < 0.5
    assert (result.place, result.frames, result.zoom, result.why) == ("pan 30", 3, 0.0, None)
    assert result.first_seen < result.stamp


@pytest.mark.parametrize(
    ("eye", "why"),
    [(replace(EYE, lens=None), "the camera has no camera_info"), (replace(EYE, mount=None), "the camera has no mount")],
)
def test_a_camera_that_is_not_known_gives_no_position_and_the_reason(eye: Eye, why: str) -> None:
    (result,) = said(seen(ahead(HERE)), eye)
    assert result.position is None
    assert result.covariance is None
    assert result.why == why
    assert result.frames == 3


ZOOMED = Reading(30.0, 45.0, 4.0)


def test_a_zoomed_picture_of_unknown_magnification_gives_no_position_and_the_reason() -> None:
    zoomed = seen(ahead(ZOOMED), ZOOMED, times=1.93)
    coarse = replace(EYE, levels=(Level(0, Magnification(1.0, 0.0)), Level(4, Magnification(2.0, 0.15))))
    for eye in (EYE, coarse):
        (result,) = said(zoomed, eye)
        assert result.position is None
        assert result.why is not None
        assert "zoom 4" in result.why


def test_a_zoomed_picture_is_placed_where_its_magnification_was_measured_or_its_level_is_exact() -> None:
    marker = ahead(ZOOMED)
    zoomed = seen(marker, ZOOMED, times=1.93)
    measured = [replace(one, magnified=Magnification(1.931, 0.001)) for one in zoomed]
    exact = replace(EYE, levels=(Level(0, Magnification(1.0, 0.0)), Level(4, Magnification(1.931, 0.001))))
    for result in (*said(measured), *said(zoomed, exact)):
        assert off_mm(result, marker) < 3
        assert result.zoom == 4.0
        depth = np.sqrt(np.linalg.eigvalsh(np.array(result.covariance))[-1])
        assert 0.001 < depth < 0.003  # a two-thousandth of 2.5 m


def test_zoomed_pictures_of_unknown_magnification_do_not_disturb_the_wide_ones() -> None:
    marker = ahead(HERE)
    (result,) = said([*seen(marker), *seen(marker, ZOOMED, at=110.0, times=1.93)])
    assert off_mm(result, marker) < 0.5
    assert result.frames == 3


def test_a_marker_that_was_moved_is_published_where_it_is_now() -> None:
    old, new = ahead(HERE), ahead(HERE, aside=0.5)
    other = Reading(35.0, 47.0, 0.0)
    (result,) = said([*seen(old), *seen(new, other, at=200.0)])
    assert off_mm(result, new) < 0.5
    assert result.frames == 3
    assert result.place == "pan 35"
    assert result.first_seen == said(seen(new, other, at=200.0))[0].first_seen


def test_two_markers_of_one_id_that_are_seen_together_are_two_results() -> None:
    one, other = ahead(HERE), ahead(HERE, aside=0.5)
    found = said([*seen(one), *seen(other)])
    assert len(found) == 2
    assert sorted(round(min(off_mm(result, marker) for result in found), 1) for marker in (one, other)) <= [0.5, 0.5]


def test_a_marker_at_the_picture_s_edge_counts_less_than_one_that_is_seen_whole() -> None:
    marker, aside = ahead(HERE), Reading(30.0, 19.0, 0.0)  # there the picture's edge goes through it
    whole, cut = seen(marker), seen(marker, aside, at=110.0)
    assert all(one.detection.whole(2304, 1296) for one in whole)
    assert not any(one.detection.whole(2304, 1296) for one in cut)
    wrong = [replace(one, detection=replace(one.detection, corners=one.detection.corners + 0.3)) for one in cut]
    (both,), (alone,) = said([*whole, *wrong]), said(cut)
    assert off_mm(both, marker) < 0.5
    assert np.trace(np.array(alone.covariance)) > 4 * np.trace(np.array(said(whole)[0].covariance))


def test_the_mount_s_own_doubt_is_in_the_covariance() -> None:
    sightings = seen(ahead(HERE, metres=4.0))
    doubt = np.diag(np.square([0.01] * 3 + [np.radians(0.1)] * 3))
    exact, doubted = said(sightings)[0], said(sightings, replace(EYE, mount_doubt=doubt))[0]
    grown = np.linalg.eigvalsh(np.array(doubted.covariance) - np.array(exact.covariance))
    assert grown[0] == pytest.approx(0.01**2, rel=0.01)  # along the arm: its place alone
    assert grown[2] == pytest.approx(0.01**2 + (4.03 * np.radians(0.1)) ** 2, rel=0.1)


def test_the_settings_say_of_each_marker_how_it_lies() -> None:
    markers = MarkerSizes.model_validate({"size": 0.14, "faces": "up", "facing": {17: "wall", 20: None}})
    assert markers.prior(582) == Prior("up")
    assert markers.prior(17) == Prior("wall")
    assert markers.prior(20) is None
    assert MarkerSizes().prior(582) is None
