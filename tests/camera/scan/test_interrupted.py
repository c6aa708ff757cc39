"""A scan in trouble: it is cancelled, the camera restarts, the stream stands still, frames are broken."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from services.camera.ptz.kept import recalled
from services.camera.scan.analysis import Analysed
from services.camera.scan.findings import Frame
from services.camera.scan.footage import Glimpse, Visit
from services.camera.scan.search import Scan
from services.camera.video.newest import Frame as VideoFrame
from services.payloads import FINAL
from tests.camera.scan.virtual_scan import Seer, VirtualScan, how_it_looks, virtual_scan

PLACES = ["Sofa", "TV", "Kitchen", "Dining"]
ORDER = json.dumps({"full": True, "places": PLACES, "frames": 4})
WHOLE = 2 * len(PLACES) * 4


@pytest.fixture
def trial(tmp_path: Path) -> Iterator[VirtualScan]:
    with virtual_scan(tmp_path) as trial:
        trial.sees({})
        yield trial


def once(condition: Callable[[Scan], bool], act: Callable[[], Any]) -> Callable[[Scan], None]:
    """Does something when a condition holds for the first time."""
    done: list[Any] = []

    def each(scan: Scan) -> None:
        if not done and condition(scan):
            done.append(act())

    return each


def stands(trial: VirtualScan) -> bool:
    return not any(trial.inside.device.motion(trial.flat.now)[1][:2])


def answers(trial: VirtualScan) -> list[dict[str, Any]]:
    """How orders ended."""
    said = [json.loads(one.payload) for one in trial.flat.client.seen if one.topic == "camera/ip1/order_result"]
    return [one for one in said if one["state"] in FINAL]


@pytest.mark.parametrize("cancelled", [False, True])
def test_what_a_scan_taught_of_the_motors_is_kept(trial: VirtualScan, tmp_path: Path, *, cancelled: bool) -> None:
    def cancel() -> None:
        trial.flat.client.say("camera/ip1/order/Scan", "False")

    _, _, state = trial.run(ORDER, once(lambda scan: cancelled and len(scan.findings.taken) >= 12, cancel))
    assert state.state == ("cancelled" if cancelled else "done")
    trial.service.trips.kept.written()
    kept, taught = recalled(tmp_path / "state", "ip1"), trial.service.trips.skill
    assert kept is not None
    assert kept.timing.took == taught.timing.took  # how long answers take
    assert kept.presets == taught.presets
    assert len(taught.presets) >= 2  # where the first of its places were seen to look


@pytest.mark.parametrize("frames", [0, 5, 12, 20])
def test_a_scan_is_cancelled_within_a_second_wherever_it_is(trial: VirtualScan, frames: int) -> None:
    tables = trial.inside.device.tables
    before = how_it_looks(tables), tables.colour
    scan = trial.begin(ORDER)
    assert trial.flat.until(lambda: len(scan.findings.taken) >= frames and not stands(trial), 60.0)
    ordered = trial.flat.now
    trial.flat.client.say("camera/ip1/order/Scan", "OFF")
    assert trial.flat.until(lambda: stands(trial) and trial.service.scanner.scan is None, 1.0)
    assert trial.flat.now - ordered <= 1.0
    trial.flat.until(lambda: False, 12.0)
    assert stands(trial)
    assert trial.states()[-1].state == "cancelled"
    assert {one["state"] for one in answers(trial)} == {"cancelled", "done"}
    assert (how_it_looks(tables), tables.colour) == before


@pytest.mark.parametrize(("place", "mode"), [("Sofa", "auto"), ("Dining", "bw")])
def test_missing_frames_are_fetched_on_the_way(trial: VirtualScan, place: str, mode: str) -> None:
    moving, tables = trial.service.scanner.moving, trial.inside.device.tables
    assert moving is not None
    footage, looks = moving.footage, tables.looks
    whole, arrived = footage.take, []

    def some(glimpse: Glimpse) -> list[tuple[Visit, VideoFrame]]:
        scan = trial.service.scanner.scan
        of = [spot for spot in scan.spots if (spot.place, spot.mode) == (place, mode)] if scan is not None else []
        if of and glimpse.like == "same" and 0.0 < footage.at(glimpse.frame) - of[0].since < 1.5:
            arrived.append(glimpse)
            return whole(glimpse) if len(arrived) <= 1 else []
        return whole(glimpse)

    footage.take = some  # type: ignore[method-assign]
    # Eight frames of each: at the next place it is known that they are missing, and not only where the way is past it.
    scan, _, last = trial.run(json.dumps({**json.loads(ORDER), "frames": 8}))
    assert (last.state, last.frames_analysed) == ("done", 2 * WHOLE)
    turns = {one: [spot.place for spot in scan.spots if spot.mode == one] for one in ("auto", "bw")}
    assert turns[mode].count(place) == 2
    assert turns[mode][-1] == (PLACES if mode == "auto" else PLACES[::-1])[-1], "not at the very end"
    assert turns["auto" if mode == "bw" else "bw"] == (PLACES if mode == "bw" else PLACES[::-1])
    assert tables.looks - looks == 2, "mode and contrast at once, there and back"


def test_a_camera_that_restarts_is_awaited_and_the_scan_goes_on(trial: VirtualScan) -> None:
    restart = once(
        lambda scan: len(scan.findings.taken) >= 6 and not stands(trial),
        lambda: trial.inside.device.reboot(trial.flat.now),
    )
    scan, seconds, last = trial.run(ORDER, restart)
    assert (last.state, last.frames_analysed) == ("done", WHOLE)
    assert seconds > 60.0, "it takes a minute to restart"
    assert any("the camera is away" in state.reason for state in trial.states() if state.state == "running")
    assert {spot.place for spot in scan.spots if spot.got} == set(PLACES)
    assert stands(trial)


def test_a_camera_that_stays_away_fails_the_scan_with_the_reason(trial: VirtualScan) -> None:
    def gone() -> None:
        trial.inside.device.boots_until = trial.flat.now + 1000.0

    _, _, last = trial.run(ORDER, once(lambda scan: len(scan.findings.taken) >= 6, gone))
    assert last.state == "failed"
    assert "camera" in last.reason
    assert [one["state"] for one in answers(trial)] == ["failed"]


def test_a_stream_that_stands_still_is_replaced_by_snapshots(trial: VirtualScan) -> None:
    def freeze() -> None:
        trial.flat.films["ip1"].frozen = trial.flat.now

    scan, _, last = trial.run(ORDER, once(lambda scan: len(scan.findings.taken) >= 6, freeze))
    assert (last.state, last.frames_analysed) == ("done", WHOLE)
    assert all(sum(spot.got for spot in scan.spots if spot.place == place) == 8 for place in PLACES)


def test_frames_of_a_visit_that_was_broken_off_are_looked_at_all_the_same(tmp_path: Path) -> None:
    """They are with those who look when the camera goes away; what is seen in them is kept, and its picture."""
    with virtual_scan(tmp_path, scan_pictures="snapshot") as trial:
        sofa, scanner = trial.places["Sofa"], trial.service.scanner
        trial.sees({582: (sofa.pan, sofa.tilt)})
        late: list[Analysed] = []
        take = scanner.take
        scanner.take = late.append  # type: ignore[method-assign]

        def away() -> None:
            trial.inside.device.boots_until = trial.flat.now + 30.0

        def broken_off(scan: Scan) -> list[Frame]:
            return [one for one in scan.findings.taken if one.spot not in scan.spots]

        goes = once(lambda scan: bool(scan.spots) and scan.spots[-1].got == 2, away)

        def each(scan: Scan) -> None:
            goes(scan)
            if broken_off(scan):
                scanner.take = take  # type: ignore[method-assign]
                while late:
                    take(replace(late.pop(0), jpeg=b"a picture"))

        scan, _, last = trial.run(json.dumps({"full": True, "places": PLACES, "targets": [582]}), each)
        assert broken_off(scan)
        assert (last.state, last.found) == ("done", [582])


def test_places_whose_frames_are_broken_are_visited_once_more(trial: VirtualScan) -> None:
    broken = range(5, 11)
    trial.service.scanner.analyst = lambda: Seer(trial, {}, fails=lambda number: "no JPEG" if number in broken else "")
    scan, _, last = trial.run(ORDER)
    assert last.state == "done"
    assert last.frames_analysed == WHOLE + len(broken)
    assert all(sum(spot.got for spot in scan.spots if spot.place == place) == 8 for place in PLACES)


def test_a_scan_of_which_nothing_can_be_read_fails_with_the_reason(trial: VirtualScan) -> None:
    trial.service.scanner.analyst = lambda: Seer(trial, {}, fails=lambda number: "expected a whole JPEG")
    scan, _, last = trial.run(ORDER)
    assert last.state == "failed"
    assert "no picture of Sofa" in last.reason
    assert len(scan.spots) <= 3 * 2 * len(PLACES), "it does not try for ever"
    assert "expected a whole JPEG" in last.reason


def test_an_order_of_a_human_ends_the_scan_and_is_carried_out(trial: VirtualScan) -> None:
    scan = trial.begin(ORDER)
    assert trial.flat.until(lambda: len(scan.findings.taken) >= 6, 60.0)
    trial.flat.client.say("camera/ip1/order/Goto", "Hall")
    assert trial.flat.until(lambda: len(answers_now(trial)) == 2, 30.0)
    assert [(one["key"], one["state"]) for one in answers_now(trial)] == [("Scan", "cancelled"), ("Goto", "done")]


def answers_now(trial: VirtualScan) -> list[dict[str, Any]]:
    trial.states()
    return answers(trial)


@pytest.mark.parametrize("firmware", ["ip3m-941w-2019", "2020s-dahua"])
def test_the_picture_is_restored_by_the_next_life_of_a_service_that_was_killed(tmp_path: Path, firmware: str) -> None:
    with virtual_scan(tmp_path / "one", firmware=firmware) as trial:
        trial.sees({})
        before = how_it_looks(trial.inside.device.tables)
        trial.begin(ORDER)
        assert trial.flat.until(lambda: trial.inside.device.tables.colour == "bw", 60.0)
        note = trial.service.scanner.modes.file
        assert note is not None
        kept = note.read_text(encoding="utf-8")
    with virtual_scan(tmp_path / "two", note=kept, firmware=firmware) as trial:
        tables, note = trial.inside.device.tables, trial.service.scanner.modes.file
        assert trial.flat.until(lambda: tables.number("VideoColor[0][0].Contrast") == 50, 10.0)
        assert tables.colour == "auto"
        assert how_it_looks(tables) == before
        assert note is not None
        assert trial.flat.until(lambda: not note.exists(), 10.0)


def test_a_note_of_one_mode_for_all_profiles_is_followed(tmp_path: Path) -> None:
    """As an older version left it: which profile it was of is not known."""
    with virtual_scan(tmp_path, note='{"mode": "auto", "contrast": [50, 45, 50]}') as trial:
        note = trial.service.scanner.modes.file
        assert note is not None
        assert trial.flat.until(lambda: not note.exists(), 10.0)
        kept = how_it_looks(trial.inside.device.tables)
        assert {value for key, value in kept.items() if key.endswith("DayNightColor")} == {"1"}
        assert [value for key, value in kept.items() if key.endswith("Contrast")] == ["50", "45", "50"]
