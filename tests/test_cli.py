"""The command line as a process: READY, SIGTERM, Ctrl-C, and what is left when it is killed."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from services import peers
from services.client import connected
from services.config import BusSettings
from services.simulated import CONFIG, parts_of

ROOT = Path(__file__).parents[1]


@contextmanager
def command(
    words: list[str], environment: dict[str, str], log: Path | None = None
) -> Iterator[tuple[subprocess.Popen[str], dict[str, Any]]]:
    """A running `apartment ...`, and what its READY line says."""
    said = log.open("wb") if log else subprocess.DEVNULL
    process = subprocess.Popen(
        [sys.executable, "-m", "services", *words], env={**os.environ, **environment}, cwd=ROOT,
        stdout=subprocess.PIPE, stderr=said, text=True,
    )  # fmt: skip
    if not isinstance(said, int):
        said.close()
    assert process.stdout is not None
    with process.stdout as lines:
        try:
            line = next((line for line in lines if line.startswith("READY ")), None)
            assert line is not None, f"ended with {process.wait()} before it was ready"
            yield process, json.loads(line.removeprefix("READY "))
        finally:
            peers.end(process)  # type: ignore[arg-type]


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False


@pytest.fixture
def apart(tmp_path: Path) -> Iterator[tuple[Path, dict[str, str]]]:
    """A configuration of one's own whose light services share a process, and its peers."""
    config = Path(shutil.copytree(CONFIG, tmp_path / "config")) / "simulated.yaml"
    config.write_text("grouped: true\n" + config.read_text(encoding="utf-8"), encoding="utf-8")
    with parts_of(tmp_path / "parts", real=False) as parts:
        yield config, parts.environment


def test_run_is_ready_when_everything_answers_and_ends_cleanly(apart: tuple[Path, dict[str, str]]) -> None:
    config, environment = apart
    with command(["run", "--config", str(config)], environment) as (process, ready):
        assert set(ready["services"]) == {
            "simulated-camera",
            "simulated-home+simulated-robot+persistence+history+bridge+mission",
            "camera-ip1",
            "dashboard",
        }
        with connected(BusSettings(port=ready["broker"]["port"]), ["service/+/status"]) as bus:
            for name in ("simulated-home", "persistence", "bridge", "camera-ip1"):
                assert bus.payload(f"service/{name}/status") == "online"
            pids = [one["pid"] for one in ready["services"].values()]
            process.send_signal(signal.SIGTERM)
            asked = time.monotonic()
            assert process.wait(10) == 0
            assert time.monotonic() - asked < 5.0
            for name in ("simulated-home", "persistence", "bridge", "camera-ip1"):
                bus.payload(f"service/{name}/status", lambda text: text == "offline")
        assert not [pid for pid in pids if alive(pid)]


def test_nothing_goes_on_when_run_itself_is_killed(apart: tuple[Path, dict[str, str]]) -> None:
    config, environment = apart
    with command(["run", "--config", str(config)], environment) as (process, ready):
        pids = [one["pid"] for one in ready["services"].values()]
        process.kill()
        peers.wait_until(lambda: not [pid for pid in pids if alive(pid)], "the services to end", 6.0)


def test_a_service_that_hangs_can_be_asked_where_and_goes_on(
    apart: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    config, environment = apart
    log = tmp_path / "log"
    with command(["serve", "simulated-home", "--config", str(config)], environment, log) as (process, _):
        process.send_signal(signal.SIGUSR1)
        try:
            peers.wait_until(
                lambda: "in serve" in log.read_text().partition("most recent call first")[2],
                "the stacks, which are written line by line",
            )
        except TimeoutError as error:
            raise AssertionError(f"it ended with {process.poll()} and said: {log.read_text()}") from error
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0


def test_a_simulator_runs_alone(apart: tuple[Path, dict[str, str]]) -> None:
    config, environment = apart
    with command(["simulate", "camera", "--config", str(config)], environment) as (process, ready):
        assert peers.answers(ready["port"])
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 130


def test_a_demo_that_is_asked_to_end_leaves_nothing_behind() -> None:
    with command(["demo"], {}) as (process, ready):
        pids = [one["pid"] for one in ready["services"].values()]
        port = ready["broker"]["port"]
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
    assert not [pid for pid in pids if alive(pid)]
    assert not peers.answers(port)
