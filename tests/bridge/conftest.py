"""A private ROS master, and the bridge as a program beside it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from services import peers
from services.peers import ros

ROOT = Path(__file__).parents[2]
PATIENCE_S = 30.0  # for things that take a second on a quiet machine


class BridgeProcess:
    """The bridge under test with an item for each of `states`; what it says to the bus is in `said`."""

    def __init__(self, env: dict[str, str], items: dict[str, Any], log: str = "bridge.log", **config: Any) -> None:
        config = {"home": {"items": items}, "cameras": ["ip1"], "folder": str(ROOT / "config"), **config}
        self.said: list[tuple[float, str, str]] = []
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.bridge.bridge_process", json.dumps(config)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, **env, "BRIDGE_LOG": log}, cwd=ROOT,
        )  # fmt: skip
        self._heard = threading.Condition()
        threading.Thread(target=self._listen, daemon=True).start()

    def hears(self, topic: str, payload: str) -> None:
        """A message on the bus."""
        assert self.process.stdin
        self.process.stdin.write(json.dumps({"topic": topic, "payload": payload}).encode() + b"\n")
        self.process.stdin.flush()

    def says(self, topic: str, holds: Callable[[str], bool], since: int = 0) -> float:
        """Waits until it says such a payload; returns when that was. `since`: how much of `said` to skip."""

        def when() -> float | None:
            return next((at for at, name, text in self.said[since:] if name == topic and holds(text)), None)

        with self._heard:
            assert self._heard.wait_for(lambda: when() is not None, PATIENCE_S), (topic, self.said[-5:])
        found = when()
        assert found is not None
        return found

    def registers(self, times: int) -> float:
        """Waits until everything was registered that often."""
        return self.says("diagnostics/bridge", lambda text: json.loads(text)["values"]["registrations"] == str(times))

    def end(self) -> float:
        """Lets it end; returns the seconds that took."""
        started = time.monotonic()
        assert self.process.stdin
        self.process.stdin.close()
        self.process.wait(PATIENCE_S)
        return time.monotonic() - started

    def _listen(self) -> None:
        assert self.process.stdout
        for line in self.process.stdout:
            if not line.startswith(b"{"):
                continue  # rospy prints, too
            message = json.loads(line)
            with self._heard:
                self.said.append((time.monotonic(), message["topic"], message["payload"]))
                self._heard.notify_all()


@pytest.fixture
def master(tmp_path: Path) -> Iterator[ros.Master]:
    """A ROS master of this test's own."""
    try:
        with ros.private(tmp_path / "ros") as running:
            yield running
    except peers.Missing as missing:
        pytest.skip(str(missing))


@contextmanager
def bridges() -> Iterator[Callable[..., BridgeProcess]]:
    """Starts bridges, and ends them with the block."""
    started: list[BridgeProcess] = []

    def run(env: dict[str, str], items: dict[str, Any], **config: Any) -> BridgeProcess:
        started.append(BridgeProcess(env, items, **config))
        return started[-1]

    try:
        yield run
    finally:
        for bridge in started:
            peers.end(bridge.process)
            for pipe in (bridge.process.stdin, bridge.process.stdout):
                assert pipe
                pipe.close()


@pytest.fixture
def run_bridge() -> Iterator[Callable[..., BridgeProcess]]:
    """Starts bridges, and ends them with the test."""
    with bridges() as run:
        yield run
