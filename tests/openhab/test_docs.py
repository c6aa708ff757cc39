"""The two pages about OpenHAB and Alexa cannot go stale: their commands exist, and what they name is in the home."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from services.__main__ import app
from services.openhab.generate import files
from services.openhab.site import Site
from services.openhab.versions import parse
from tests.openhab.homes import CAMERAS, shipped

DOCS = Path(__file__).parents[2] / "docs"
PAGES = {name: (DOCS / name).read_text(encoding="utf-8") for name in ("openhab.md", "alexa.md")}
COMMANDS = sorted({line for page in PAGES.values() for line in re.findall(r"apartment openhab [^`\n]+", page)})


@pytest.mark.parametrize("line", COMMANDS)
def test_a_command_of_the_pages_has_these_options(line: str) -> None:
    words = shlex.split(line)[1:]
    said = CliRunner().invoke(app, [*words[:2], "--help"], env={"COLUMNS": "200"}).output
    for option in [word for word in words if word.startswith("--")]:
        assert option in said, line


def test_the_sentences_for_alexa_are_about_items_that_she_may_use() -> None:
    written = files(Site(shipped(), parse("5"), CAMERAS))
    lines = "\n".join(text for path, text in written.items() if path.endswith(".items"))
    rows = re.findall(r'^\| "[^"]+" \| `(\w+)`', PAGES["alexa.md"], re.M)
    assert len(rows) >= 8
    for name in rows:
        block = re.search(rf"^\S+ {name} .*?^(?=\S|\Z)", lines, re.M | re.S)
        assert block is not None, name
        assert "alexa=" in block[0], name


def test_every_kind_of_file_is_in_the_table() -> None:
    kinds = {path.partition("/")[0] for path in files(Site(shipped(), parse("5"), CAMERAS))}
    kinds |= {path.partition("/")[0] for path in files(Site(shipped(), parse("5"), bus="js"))}
    for kind in kinds:
        assert f"`{kind}/" in PAGES["openhab.md"], kind


def test_the_example_item_of_the_page_is_in_the_home() -> None:
    light = shipped().items["Kitchen_Light"]
    assert next(iter(light.channels)) in PAGES["openhab.md"]
    assert light.alexa is not None
    assert light.alexa.name == "Kitchen"
