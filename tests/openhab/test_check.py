"""The checker against files with one fault each, told at its line, and against files with none.

A fixture begins with the releases that it is for; in a wrong one `<--` marks the line. A folder is one fixture.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from services.openhab.check import Finding, check
from services.openhab.versions import parse

FIXTURES = Path(__file__).parents[1] / "fixtures" / "openhab"
WRONG = sorted((FIXTURES / "wrong").iterdir())
RIGHT = sorted((FIXTURES / "right").iterdir())


def texts(fixture: Path) -> dict[str, str]:
    """The files of a fixture, with their line ends."""
    files = sorted(fixture.iterdir()) if fixture.is_dir() else [fixture]
    return {file.name: file.read_bytes().decode() for file in files if file.suffix != ".txt"}


def releases(fixture: Path) -> list[str]:
    """What OpenHAB it is for."""
    about = fixture / "about.txt" if fixture.is_dir() else fixture
    found = re.match(r"// OpenHAB ([0-9. ]+):", about.read_text(encoding="utf-8"))
    assert found is not None, fixture
    return found[1].split()


def marked(files: dict[str, str]) -> tuple[str, int]:
    """The file and line of the mark."""
    places = [
        (name, at) for name, text in files.items() for at, line in enumerate(text.split("\n"), 1) if "<--" in line
    ]
    assert len(places) == 1
    return places[0]


CASES = [(fixture, release) for fixture in WRONG for release in releases(fixture)]
GOOD = [(fixture, release) for fixture in RIGHT for release in releases(fixture)]


def test_there_are_enough_of_both() -> None:
    assert len(WRONG) >= 60
    assert len(RIGHT) >= 30


@pytest.mark.parametrize(("fixture", "release"), CASES, ids=[f"{one.name}-{release}" for one, release in CASES])
def test_a_fault_is_told_at_its_line_and_nothing_else(fixture: Path, release: str) -> None:
    files = texts(fixture)
    found = check(files, parse(release))
    assert [(one.file, one.line) for one in found] == [marked(files)], [str(one) for one in found]


@pytest.mark.parametrize(("fixture", "release"), GOOD, ids=[f"{one.name}-{release}" for one, release in GOOD])
def test_a_right_file_is_good(fixture: Path, release: str) -> None:
    assert check(texts(fixture), parse(release)) == []


def test_a_finding_reads_like_a_compilers() -> None:
    found = check({"a.items": "Switch Lamp\nSwitch 1a"}, parse("5"))
    assert [str(one) for one in found] == [
        "a.items:2:8: error: expected a name of letters, digits and _ that begins with no digit, got '1a'"
    ]


def test_a_file_whose_grammar_is_wrong_makes_no_others_wrong() -> None:
    files = {"a.items": "Switch Lamp {", "home.sitemap": "sitemap home { Switch item=Lamp }"}
    assert [one.file for one in check(files, parse("5"))] == ["a.items"]


def test_the_faults_come_by_file_and_line() -> None:
    found = check({"b.items": "Switch 1a\nSwitch 2a", "a.items": "Switch 3a"}, parse("4"))
    assert found == sorted(found)
    assert all(isinstance(one, Finding) for one in found)
