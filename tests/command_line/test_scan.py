"""`apartment scan`: what is asked for, how far it is, and what it found; a true scan by it runs in `test_docs.py`."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from services.client import Client
from services.command_line.scan import newest, progress, table
from services.payloads import Point, ScanResult, ScanState
from tests.command_line.playing import answer, taken
from tests.command_line.terminal import apartment, done

SEEN = ScanResult(
    camera="ip1", marker=582, dictionary="DICT_5X5_1000", place="Living room", position=Point(x=1.234, y=0.87, z=0.74),
    covariance=[[9e-6, 0, 0], [0, 9e-6, 0], [0, 0, 4e-4]], distance=3.1, first_seen="2026-01-31T07:05:00.123Z",
    stamp="2026-01-31T07:05:02.123Z", scan="s1",
)  # fmt: skip


def screen(*, terminal: bool) -> Console:
    return Console(file=io.StringIO(), width=140, force_terminal=terminal)


def text(console: Console) -> str:
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_what_was_found_is_a_table_with_units_and_how_sure_it_is() -> None:
    console = screen(terminal=False)
    nowhere = SEEN.model_copy(update={"marker": 17, "position": None, "covariance": None, "why": "no mount"})
    console.print(table([SEEN, nowhere]))
    first, second = (line for line in text(console).splitlines() if "Living room" in line)
    assert first.split("│")[1].strip() == "17"
    assert "no mount" in first
    for word in ("582", "1.234 m", "0.870 m", "0.740 m", "20 mm", "3.10 m", "07:05:02"):
        assert word in second


@pytest.mark.parametrize("quiet", [False, True])
def test_elsewhere_than_on_a_terminal_each_place_is_a_plain_line(quiet: bool) -> None:
    console = screen(terminal=False)
    with progress(console, quiet=quiet) as advance:
        for place, share in (("Sofa", 0.1), ("Sofa", 0.2), ("Kitchen", 0.6)):
            advance(ScanState(state="running", place=place, progress=share))
    assert text(console).split("\n") == ([""] if quiet else ["  looking from Sofa", "  looking from Kitchen", ""])


def test_on_a_terminal_it_is_a_bar() -> None:
    console = screen(terminal=True)
    with progress(console) as advance:
        advance(ScanState(state="running", place="Sofa", progress=0.5, frames_analysed=7))
    assert "Sofa (7 frames)" in text(console)
    assert "━" in text(console)


def seen(marker: int, place: str, stamp: str) -> ScanResult:
    return SEEN.model_copy(update={"marker": marker, "place": place, "stamp": f"2026-01-31T07:05:{stamp}Z"})


def test_of_a_marker_seen_at_several_places_the_newest_is_told() -> None:
    last, before, other = seen(582, "Sofa", "09.500"), seen(582, "Kitchen", "08.900"), seen(17, "TV", "01.000")
    for said in ([last, before, other], [other, before, last], ["offline", before, None, other, last]):
        assert newest(said) == {582: last, 17: other}


FOUND_582 = [seen(582, "Sofa", "09.500"), seen(582, "Kitchen", "08.900")]  # as a scan tells them


def scanned(
    config: Path, camera: Client, words: str, found: list[ScanResult], state: str = "done", error: str | None = None
) -> tuple[list[int], int, list[str]]:
    """The markers that such a command looks for, its exit code and what it prints, when that is found."""
    with apartment(config, "scan", "ip1", *words.split()) as terminal:
        order = taken(camera, "Scan")
        answer(camera, "Scan", order, "running")
        for one in found:
            camera.say("camera/ip1/scan/result", one.model_dump_json())
        answer(camera, "Scan", order, state, error)
        camera.pump()
        return order["value"]["targets"], terminal.ended(), terminal.rest()


@pytest.mark.parametrize(
    "words",
    ["--target 582 17", "--target 582 --target 17", "--target 582 17 --full", "--full --target 582 --target 17 582"],
)
def test_several_markers_are_given_after_one_word_or_after_one_each(words: str, config: Path, camera: Client) -> None:
    targets, code, lines = scanned(config, camera, words, [*FOUND_582, seen(17, "TV", "01.000")])
    assert (targets, code) == ([582, 17], 0)
    assert "not found" not in "".join(lines)


def test_a_scan_that_finds_only_some_of_the_markers_says_which_are_missing_and_exits_1(
    config: Path, camera: Client
) -> None:
    _, code, lines = scanned(config, camera, "--target 582 17 9", FOUND_582)
    assert (code, lines[-1]) == (1, "not found: 17, 9")
    shown = "\n".join(lines)
    assert "Sofa" in shown
    assert "Kitchen" not in shown


def test_a_scan_that_is_refused_says_why(config: Path, camera: Client) -> None:
    _, code, lines = scanned(config, camera, "--target 582", [], "refused", "no places to visit")
    assert (code, lines) == (1, ["not found: 582 (no places to visit)"])


def test_as_data_each_marker_that_was_found_is_a_line(config: Path, camera: Client) -> None:
    _, code, lines = scanned(config, camera, "--target 582 17 9 --json", [*FOUND_582, seen(17, "TV", "01.000")])
    told = {one["marker"]: one["place"] for one in map(json.loads, lines)}
    assert (code, told) == (1, {582: "Sofa", 17: "TV"})


def test_a_place_is_shown_as_it_is_named(config: Path, camera: Client) -> None:
    """Both on the way and in the table."""
    with apartment(config, "scan", "ip1", "--target", "582") as terminal:
        order = taken(camera, "Scan")
        answer(camera, "Scan", order, "running")
        for place in ("TV [old]", "Sofa [/b]"):
            camera.say("camera/ip1/scan/state", ScanState(state="running", place=place).model_dump_json(), retain=True)
            camera.pump()
            assert terminal.line() == f"  looking from {place}"
        camera.say("camera/ip1/scan/result", seen(582, "TV [old]", "09.500").model_dump_json())
        answer(camera, "Scan", order, "done")
        camera.pump()
        assert terminal.ended() == 0
    assert "TV [old]" in "".join(terminal.rest())


def test_a_place_that_looks_like_markup_is_no_markup_on_the_bar() -> None:
    console = screen(terminal=True)
    with progress(console) as advance:
        advance(ScanState(state="running", place="Sofa [/b] [old]\x1b[2J", progress=0.5, frames_analysed=7))
    assert "Sofa [/b] [old]\\x1b[2J (7 frames)" in text(console)


@pytest.mark.parametrize("words", ["", "582", "--target", "--target sofa", "--target 582 sofa"])
def test_a_scan_without_markers_is_wrong_usage(words: str, config: Path) -> None:
    assert done(config, "scan", "ip1", *words.split())[0] == 2
