"""`apartment scan`: how far it is, and what it found, as people read it; the command itself runs in `test_docs.py`."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from services.command_line.scan import progress, table
from services.payloads import Point, ScanResult, ScanState

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
