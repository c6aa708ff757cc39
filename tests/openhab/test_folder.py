"""The commands: what they write and leave alone in a folder, what they say, and how they end."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from services.__main__ import app
from services.config import load
from services.errors import ConfigError

SHIPPED = Path(__file__).parents[2] / "config"


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """The shipped configuration, in a folder that may be written to."""
    shutil.copytree(SHIPPED, tmp_path / "config")
    return tmp_path / "config" / "apartment.yaml"


def run(*words: object) -> tuple[int, str]:
    """Exit code and everything said."""
    done = CliRunner().invoke(app, ["openhab", *map(str, words)])
    if isinstance(done.exception, ConfigError):
        raise done.exception
    return done.exit_code, done.output


def generate(config: Path, out: Path, *more: str) -> tuple[int, str]:
    """`apartment openhab generate`."""
    return run("generate", "--config", config, "--out", out, *more)


def test_what_is_generated_is_good_and_comes_back_as_the_same_home(config: Path, tmp_path: Path) -> None:
    out, back = tmp_path / "openhab", tmp_path / "back.yaml"
    assert generate(config, out)[0] == 0
    assert run("check", out)[0] == 0
    assert run("import", out, "--out", back)[0] == 0
    wanted = load(config, ()).home
    shutil.copy(back, config.parent / "home.yaml")
    assert load(config, ()).home == wanted


def test_a_second_time_nothing_is_written(config: Path, tmp_path: Path) -> None:
    generate(config, tmp_path / "openhab")
    assert "wrote" not in generate(config, tmp_path / "openhab")[1]


def test_a_diff_shows_what_would_change_and_changes_nothing(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "openhab"
    code, said = generate(config, out, "--diff")
    assert (code, out.exists()) == (0, False)
    assert "+++ b/items/apartment.items" in said
    assert "+Switch Kitchen_Light" in said
    generate(config, out)
    assert generate(config, out, "--diff") == (0, "")


def test_a_file_of_others_in_our_place_is_left_and_told(config: Path, tmp_path: Path) -> None:
    theirs = tmp_path / "openhab" / "persistence" / "jdbc.persist"
    theirs.parent.mkdir(parents=True)
    theirs.write_text("Strategies {\n}\n")
    code, said = generate(config, tmp_path / "openhab")
    assert (code, theirs.read_text()) == (1, "Strategies {\n}\n")
    assert "not ours, left as it is" in said


def test_an_item_of_others_is_left_out_of_ours_and_told(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "openhab"
    (out / "items").mkdir(parents=True)
    (out / "items" / "mine.items").write_text('Group ROS\nSwitch Kitchen_Light "mine" (ROS)\n')
    code, said = generate(config, out)
    assert code == 0
    assert "Kitchen_Light: stands in" in said
    assert run("check", out)[0] == 0


def test_what_others_have_of_a_camera_or_a_room_is_left_out_and_the_rest_keeps_its_names(
    config: Path, tmp_path: Path
) -> None:
    clean, out = tmp_path / "clean", tmp_path / "openhab"
    generate(config, clean)
    shutil.copytree(clean, out)
    mark, camera = (out / "things/apartment_ip1.things").read_text().split("\n", 1)
    (out / "things/mine.things").write_text(camera)
    (out / "items/mine.items").write_text('String Ip1_Place "mine" (Ip1)\nGroup gRoom_kitchen "mine"\n')
    code, said = generate(config, out)
    assert code == 0
    for name in ("Ip1_Place", "gRoom_kitchen", "mqtt:topic:apartment:camera_ip1"):
        assert f"{name}: stands in {out}" in said
    assert (out / "things/apartment_ip1.things").read_text().strip() == mark
    for path, name in (("items/apartment.items", "gRoom_kitchen"), ("items/apartment_ip1.items", "Ip1_Place")):
        lines = re.split(r"\n(?=\S)", (clean / path).read_text())
        kept = [one for one in lines if not re.match(rf"\S+ {name}\b", one)]
        assert len(kept) == len(lines) - 1
        assert (out / path).read_text() == "\n".join(kept)
    assert (out / "sitemaps/apartment.sitemap").read_text() == (clean / "sitemaps/apartment.sitemap").read_text()
    assert run("check", out)[0] == 0


def test_files_of_a_camera_that_went_are_removed(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "openhab"
    generate(config, out)
    assert (out / "items" / "apartment_ip1.items").exists()
    text = config.read_text().replace("default_camera: ip1\n", "")
    config.write_text(
        text[: text.index("cameras:")] + text[text.index("persistence:\n") :].replace("  rules", "  rules")
    )
    assert generate(config, out)[0] == 0
    assert not (out / "items" / "apartment_ip1.items").exists()


def test_a_check_tells_file_line_and_column_and_ends_with_1(tmp_path: Path) -> None:
    (tmp_path / "a.items").write_text("Switch A\nSwitch B (gNone)\n")
    code, said = run("check", tmp_path / "a.items")
    assert code == 1
    assert "a.items:2:11: error: expected a group that exists, got 'gNone'" in said


def test_a_check_can_be_data(tmp_path: Path) -> None:
    (tmp_path / "a.items").write_text("Switch 1A\n")
    assert '"line": 1, "column": 8' in run("check", tmp_path, "--json")[1]


@pytest.mark.parametrize(
    "words",
    [
        ("check", "nowhere.items"),
        ("check", "README.md"),
        ("import", "docs"),
        ("check", "docs", "--openhab", "6"),
        ("check", "docs", "--openhab", "2.4"),
    ],
)
def test_what_cannot_be_is_told_as_configuration(words: tuple[str, ...]) -> None:
    with pytest.raises(ConfigError, match="expected"):
        run(*words)


def test_an_import_does_not_replace_a_file_unasked(config: Path, tmp_path: Path) -> None:
    generate(config, tmp_path / "openhab")
    with pytest.raises(ConfigError, match="--force"):
        run("import", tmp_path / "openhab", "--out", config.parent / "home.yaml")
