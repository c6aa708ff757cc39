"""What the apartment brings along: listed, and nothing under a licence that would bind those who pass it on."""

from __future__ import annotations

import re

import pytest

from tests.dependencies import FREE, ONLY_FOR_TESTS, PAGE, ROOT, closure, extra, page, permitted


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "python -m tests.dependencies"


def test_what_runs_is_free_to_be_passed_on() -> None:
    packages = closure([*extra(""), *extra("embedded")])
    assert {"paho-mqtt", "pydantic", "numpy", "amqtt"} <= {one.name for one in packages}
    assert [one for one in packages if not permitted(one.licence)] == []


def test_what_the_tests_need_has_a_licence_that_is_known() -> None:
    assert [one for one in closure(extra("dev")) if not permitted(one.licence, (*FREE, *ONLY_FOR_TESTS))] == []


@pytest.mark.parametrize(
    ("licence", "may"),
    [("MIT", True), ("EPL-2.0 OR GPL-2.0-only", True), ("BSD-3-Clause AND 0BSD AND MIT", True), ("GPL-3.0-only", False),
     ("MIT AND AGPL-3.0-only", False), ("unknown: ['']", False), ("(MIT OR GPL-2.0-only)", True)],
)  # fmt: skip
def test_which_licences_are_let_in(licence: str, may: bool) -> None:
    assert permitted(licence) is may


def test_every_rule_that_is_left_out_says_why() -> None:
    """Of ruff's rules about security (S) above all: in the code that runs, and in the settings."""
    bare = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in (ROOT / "services").rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.search(r"# noqa(?!: [A-Z0-9, ]+(  # \w| \(\w))", line)
    ]
    assert bare == []
    settings = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.search(r'select = \[.*"S"\]', settings)
    (ignored,) = re.findall(r"^ignore = \[\n(.*?)^\]", settings, re.M | re.S)
    ones = re.findall(r"^\[tool.ruff.lint.per-file-ignores\]\n(.*?)^\[", settings, re.M | re.S)
    lines = [*ignored.splitlines(), *ones[0].splitlines()]
    assert [line for line in lines if '"S' in line and " # " not in line] == []
