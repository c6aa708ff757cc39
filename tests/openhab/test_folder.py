"""The commands: what they write and leave alone in a folder, what they say, and how they end."""

from __future__ import annotations

import re
import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest
from typer.testing import CliRunner

from services.__main__ import app
from services.config import load
from services.credentials import certificates
from services.credentials.folder import Folder, fill
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


def spoil(config: Path, old: str, new: str) -> None:
    """Changes one thing of home.yaml."""
    home = config.parent / "home.yaml"
    text = home.read_text(encoding="utf-8")
    assert old in text
    home.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("Number:Power", "Number:Powr", r"home\.yaml:\d+: items\.Kitchen_Plug_Power\.type: expected a dimension"),
        ("alexa: {name: Kitchen}", "alexa: {device: Lihgt}",
         r"^items/apartment\.items:\d+: Switch Kitchen_Light: expected a device type.*did you mean 'Light'"),
    ],
)  # fmt: skip
def test_what_openhab_would_not_take_is_told_and_nothing_is_written(
    config: Path, tmp_path: Path, old: str, new: str, told: str
) -> None:
    out = tmp_path / "openhab"
    generate(config, out)
    before = {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}
    spoil(config, old, new)
    with pytest.raises(ConfigError, match=told):
        generate(config, out)
    assert {file: file.read_bytes() for file in out.rglob("*") if file.is_file()} == before


def test_a_link_to_a_thing_of_openhabs_own_pages_is_written(config: Path, tmp_path: Path) -> None:
    spoil(config, "zwave:device:controller:node2:switch_binary", "mqtt:topic:apartment:mine:lamp")
    assert generate(config, tmp_path / "openhab")[0] == 0


def test_nothing_is_written_outside_of_the_folder(config: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--persistence: expected the name of a service"):
        generate(config, tmp_path / "in" / "openhab", "--persistence", "../../escaped")
    assert not list(tmp_path.rglob("escaped*"))


@pytest.mark.parametrize(
    ("words", "host", "port"),
    [
        (("--broker", "apartment.lan", "--tls"), "apartment.lan", 8883),
        (("--broker", "apartment.lan:18883", "--tls"), "apartment.lan", 18883),
        (("--tls",), "127.0.0.1", 8883),
    ],
)
def test_an_openhab_on_another_machine_comes_by_tls_and_knows_the_brokers_key(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], host: str, port: int
) -> None:
    folder = Folder(tmp_path / "secrets")
    list(fill(folder, config, ["apartment.lan"], datetime.now(UTC)))
    pair = folder.pair("broker")
    assert pair is not None
    monkeypatch.setenv("APARTMENT_SECRETS", str(folder.path / "secrets.yaml"))
    assert generate(config, tmp_path / "openhab", *words)[0] == 0
    text = (tmp_path / "openhab/things/apartment.things").read_text(encoding="utf-8")
    for line in (f'host="{host}"', f"port={port}", "secure=true", "publickeypin=true", "certificatepin=false",
                 f'publickey="{certificates.pin(pair.certificate)}"'):  # fmt: skip
        assert f"    {line},\n" in text, line


def test_where_the_brokers_certificate_is_not_there_that_is_told(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("APARTMENT_SECRETS", str(tmp_path / "secrets.yaml"))
    (tmp_path / "secrets.yaml").write_text("")
    code, said = generate(config, tmp_path / "openhab", "--tls")
    assert code == 0
    assert "no certificate, so OpenHAB will trust the first one that it sees" in said


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
