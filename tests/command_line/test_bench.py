"""`apartment bench`: the benchmarks from the command line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from services import peers


def bench(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "services", "bench", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)


def test_a_part_that_there_is_not_is_wrong_usage_and_the_parts_are_listed(tmp_path: Path) -> None:
    done = bench("--part", "nothing", folder=tmp_path)
    assert done.returncode == 2
    assert "dashboard" in done.stderr
    assert not (tmp_path / "bench.json").exists()


@pytest.mark.mosquitto
def test_a_part_is_measured_told_as_data_and_kept(tmp_path: Path) -> None:
    try:
        peers.program("mosquitto", "mosquitto")
    except peers.Missing as missing:
        pytest.skip(str(missing))
    done = bench("--part", "bus", "--runs", "1", "--json", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    assert {"name", "unit", "value", "floor", "ratio"} <= rows[0].keys()
    assert rows[0]["ratio"] == pytest.approx(rows[0]["value"] / rows[0]["floor"])
    assert json.loads((tmp_path / "bench.json").read_text()) == rows
