"""What `apartment calibrate` is given and prints; what the service makes of it is tried in virtual time."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from services.camera.calibration.section import settings
from services.command_line import calibrate
from services.errors import ConfigError
from services.vision.frames import Mount

CONFIG = Path(__file__).parents[3] / "config"
FOUND = settings(Mount((1.23456, 2.0, 2.5), "ceiling", 12.3456))


@pytest.mark.parametrize("command", ["ptz", "lens", "mount", "board", "markers"])
def test_every_command_has_help_with_an_example(command: str) -> None:
    shown = CliRunner().invoke(calibrate.app, [command, "--help"])
    assert shown.exit_code == 0
    assert f"Example: apartment calibrate {command}" in shown.output


@pytest.mark.parametrize(
    ("words", "begins"),
    [
        (["board", "--out", "board.pdf", "--squares", "8x5"], b"%PDF-1.4"),
        (["board", "--out", "board.png", "--dpi", "72", "--board", "chessboard"], b"\x89PNG"),
        (["markers", "582", "17", "--out", "markers.pdf"], b"%PDF-1.4"),
    ],
)
def test_what_is_to_be_printed_is_written(
    words: list[str], begins: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(calibrate.app, words).exit_code == 0
    (file,) = tmp_path.iterdir()
    assert file.read_bytes().startswith(begins)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["board", "--out", "board.pdf", "--squares", "9by6"], "--squares: expected columns x rows"),
        (["board", "--out", "board.doc"], "--out: expected a .pdf or .png"),
        (["board", "--out", "board.pdf", "--board", "fridge"], "--board: expected charuco or chessboard"),
        (["board", "--out", "board.pdf", "--marker", "31"], "markers of 30 to 95 % of a square"),
        (["markers", "582", "17", "--out", "markers.png"], "expected a .pdf for several"),
        (["markers", "5820", "--out", "markers.pdf"], "from 0 to 999, got 5820"),
        (["lens", "attic", "--config", str(CONFIG / "simulated.yaml")], "cameras: expected one of ip1, got 'attic'"),
        (["mount", "ip1", "--at", "582=1,2", "--config", str(CONFIG / "simulated.yaml")], "--at: expected ID=X,Y,Z"),
        (["mount", "ip1", "--config", str(CONFIG / "simulated.yaml")], "--yes-move: expected it"),
    ],
)
def test_wrong_usage_is_told(words: list[str], why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shown = CliRunner().invoke(calibrate.app, words)
    assert isinstance(shown.exception, ConfigError)
    assert why in str(shown.exception)


def test_the_mount_is_written_and_the_old_file_kept(tmp_path: Path) -> None:
    file = Path(shutil.copy(CONFIG / "simulated.yaml", tmp_path / "apartment.yaml"))
    old = file.read_bytes()
    calibrate.write_mount(file, "ip1", FOUND)
    assert yaml.safe_load(file.read_text(encoding="utf-8"))["cameras"]["ip1"]["mount"] == FOUND
    (backup,) = tmp_path.glob("apartment.yaml.*.bak")
    assert backup.read_bytes() == old


def test_a_configuration_that_others_may_not_read_stays_so_and_its_copy_too(tmp_path: Path) -> None:
    real = Path(shutil.copy(CONFIG / "simulated.yaml", tmp_path / "real.yaml"))
    real.chmod(0o600)
    link = tmp_path / "apartment.yaml"
    link.symlink_to(real)
    calibrate.write_mount(link, "ip1", FOUND)
    assert link.is_symlink()
    assert yaml.safe_load(real.read_text(encoding="utf-8"))["cameras"]["ip1"]["mount"] == FOUND
    assert {file.stat().st_mode & 0o777 for file in tmp_path.iterdir()} == {0o600}


def test_a_configuration_that_does_not_lend_itself_stays_and_the_mount_is_told(tmp_path: Path) -> None:
    file = tmp_path / "apartment.yaml"
    file.write_text("cameras: {ip1: {url: x}}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="by hand") as told:
        calibrate.write_mount(file, "ip1", FOUND)
    assert "  yaw_deg: 12.346" in told.value.faults
    assert file.read_text(encoding="utf-8") == "cameras: {ip1: {url: x}}\n"
    assert list(tmp_path.iterdir()) == [file]
