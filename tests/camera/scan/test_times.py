"""How long a scan takes, beside the least time that motors and frames need, and beside the report's scan."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from statistics import mean

import pytest

from services.camera.ptz.skill import Skill
from services.camera.scan.search import Scan
from services.camera.scan.source import Source
from services.simulators.camera.motors import Pose
from tests import bounds
from tests.camera.scan.virtual_scan import VirtualScan, how_it_looks, virtual_scan

EVERY = 2 * 9 * 8


@pytest.fixture
def trial(tmp_path: Path) -> Iterator[VirtualScan]:
    with virtual_scan(tmp_path) as trial:
        yield trial


def test_a_full_scan_takes_little_more_than_motors_and_frames_need_and_looks_at_every_frame_once(
    trial: VirtualScan,
) -> None:
    trial.sees({})
    ratios, factors = [], []
    for _ in range(3):
        least, (report, _) = trial.least(turns=2), trial.report()
        scan, seconds, last = trial.run('{"full": true}')
        assert (last.state, last.frames_taken, last.frames_analysed, last.progress) == ("done", EVERY, EVERY, 1.0)
        assert sorted(frame.number for frame in scan.findings.taken) == list(range(EVERY))
        assert {(spot.place, spot.mode) for spot in scan.spots} == {
            (p, m) for p in trial.places for m in ("auto", "bw")
        }
        ratios.append(seconds / least.seconds)
        factors.append(report / seconds)
    assert mean(ratios) <= bounds.SCAN_OVER_LEAST, ratios
    assert min(factors) >= bounds.SCAN_QUICKER, factors


def test_a_frame_is_placed_by_a_reading_at_rest(trial: VirtualScan) -> None:
    truth: dict[int, Pose] = {}

    def watch(scan: Scan) -> None:
        pose, speeds = trial.inside.device.motion(trial.flat.now)
        if scan.spots and not any(speeds):
            truth.setdefault(len(scan.spots), pose)

    trial.sees({})
    scan, _, _ = trial.run('{"full": true}', watch)
    assert len(truth) == len(scan.spots) == 18
    for spot, pose in zip(scan.spots, truth.values(), strict=True):
        assert spot.reading.pan == pytest.approx(pose.pan, abs=0.051)
        assert spot.reading.tilt == pytest.approx(pose.tilt, abs=0.051)


@pytest.mark.parametrize(
    ("read", "reckoned", "rested"),
    [(10.0, 9.5, 9.5), (10.0, 8.0, 10.0), (10.0, 10.1, 10.1), (10.0, 0.0, 10.0)],
    ids=["read at rest", "reckoned badly", "read on its last bit of way", "it did not turn"],
)
def test_frames_count_from_when_a_motion_was_reckoned_to_end(read: float, reckoned: float, rested: float) -> None:
    source = Source(None, Skill(), None)
    source.rested = read
    source.reckon(reckoned)
    assert source.rested == rested


def test_a_place_that_was_saved_zoomed_is_shown_whole_and_costs_no_correction(trial: VirtualScan) -> None:
    trial.sees({})
    zoomed = {"Dining": 2.0, "Window": 8.0}
    named = trial.service.places.named
    for place, zoom in zoomed.items():
        named[place] = named[place].model_copy(update={"zoom": zoom, "preset": None})
    trial.run('{"full": true}')
    least = trial.least(turns=2)
    scan, seconds, last = trial.run('{"full": true}')
    assert (last.state, last.frames_analysed) == ("done", EVERY)
    assert seconds / least.seconds <= bounds.SCAN_OVER_LEAST
    for spot in scan.spots:
        place, slack = named[spot.place], 3.0 if spot.place in zoomed else 0.5
        assert max(abs(spot.reading.pan - place.pan), abs(spot.reading.tilt - place.tilt)) <= slack, spot.place
        assert spot.reading.zoom == 0.0


def test_a_target_is_seen_in_a_quarter_of_the_time_that_the_report_s_scan_needs(trial: VirtualScan) -> None:
    markers = {number: (place.pan, place.tilt) for number, place in enumerate(trial.places.values(), 1)}
    trial.sees(markers)
    trial.run('{"full": true}')  # the motors are known, and where the camera's own presets lead
    trial.service.scanner.seen_at.clear()
    _, places = trial.report()
    began, seen = trial.flat.now, {}

    def each(scan: Scan) -> None:
        for marker in markers:
            if scan.findings.found(marker):
                seen.setdefault(marker, trial.flat.now - began)

    scan, _, last = trial.run('{"targets": [1, 2, 3, 4, 5, 6, 7, 8, 9], "frames": 4}', each)
    assert last.state == "done"
    shown = {marker: {one.place for one in seen} for marker, seen in scan.findings.seen.items()}
    report = [min(places[place] for place in shown[marker]) for marker in markers]
    assert mean(seen.values()) <= bounds.SIGHTING_SHARE * mean(report)


def test_what_is_found_is_told_at_once(trial: VirtualScan) -> None:
    markers = {number: (place.pan, place.tilt) for number, place in enumerate(trial.places.values(), 1)}
    trial.sees(markers)
    found: dict[int, float] = {}
    told: dict[int, float] = {}

    def each(scan: Scan) -> None:
        for marker in filter(scan.findings.found, markers):
            found.setdefault(marker, trial.flat.now)
        for marker in trial.states()[-1].found:
            told.setdefault(marker, trial.flat.now)

    trial.run('{"targets": [1, 2, 3, 4, 5, 6, 7, 8, 9]}', each)
    assert len(found) == len(told) == len(markers)
    assert max(told[marker] - found[marker] for marker in markers) < 0.05


@pytest.mark.parametrize("firmware", ["ip3m-941w-2019", "2020s-dahua"])
@pytest.mark.parametrize("profile", [0, 1])
@pytest.mark.parametrize("order", ['{"full": true}', '{"targets": [17], "places": ["Sofa", "Kitchen"]}'])
def test_the_picture_is_as_it_was_after_a_scan_in_both_modes(
    tmp_path: Path, order: str, profile: int, firmware: str
) -> None:
    """Day and night, also where they differ."""
    with virtual_scan(tmp_path, firmware=firmware) as trial:
        trial.sees({})
        tables = trial.inside.device.tables
        tables.write([("VideoInMode[0].Config[0]", str(profile)), ("VideoColor[0][1].Contrast", "40")])
        before = how_it_looks(tables), tables.colour
        assert tables.colour == ("auto", "bw")[profile]
        _, _, last = trial.run(order)
        assert (last.state, last.turn) == ("done", 2)
        assert (how_it_looks(tables), tables.colour) == before


def test_only_where_the_first_turn_has_missed_a_target_there_is_a_second(trial: VirtualScan) -> None:
    kitchen = trial.places["Kitchen"]
    trial.sees({582: (kitchen.pan, kitchen.tilt)})
    _, _, last = trial.run("ON")
    assert (last.state, last.turn, last.found) == ("done", 1, [582])
    _, _, last = trial.run('{"targets": [17], "places": ["Sofa", "Kitchen"]}')
    assert (last.state, last.turn, last.found) == ("done", 2, [])
    assert last.frames_taken == 2 * 2 * 8


def test_progress_grows_and_ends_at_one(trial: VirtualScan) -> None:
    trial.sees({})
    trial.run('{"full": true, "places": ["Sofa", "TV", "Kitchen"]}')
    progress = [state.progress for state in trial.states()]
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    assert len(set(progress)) > 8
