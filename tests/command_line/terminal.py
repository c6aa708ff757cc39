"""`apartment ...` as somebody in a shell starts it, against a private mosquitto."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from services import peers
from services.client import Client, connected
from services.config import BusSettings
from services.peers.mosquitto import Broker

ROOT = Path(__file__).parents[2]
LIMIT_S = 30.0


def config_of(folder: Path, broker: Broker, *, account: str = "", sections: str = "") -> Path:
    """A small configuration; with an account whose password the broker knows."""
    accounts = f"\n  accounts: {{{account}: {broker.passwords[account]}}}" if account else ""
    file = folder / "apartment.yaml"
    text = f"bus:\n  port: {broker.port}{accounts}\nhome: {ROOT}/config/home.yaml\nstate: {folder}/state\n{sections}"
    file.write_text(text, encoding="utf-8")
    return file


class Terminal:
    """A running command and the lines that it prints."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line.rstrip("\n"))

    def line(self) -> str:
        """The next line that it prints."""
        return self.lines.get(timeout=LIMIT_S)

    def ready(self) -> str:
        """The READY line; what it logs before is read over."""
        while not (line := self.line()).startswith("READY "):
            pass
        return line

    def ended(self, number: int | None = None) -> int:
        """Its exit code, after a signal where one is given."""
        if number is not None:
            self.process.send_signal(number)
        return self.process.wait(LIMIT_S)

    def rest(self) -> list[str]:
        """The lines that nobody has read, once it has ended."""
        self._reader.join(LIMIT_S)
        return [self.lines.get() for _ in range(self.lines.qsize())]


def _hears_ctrl_c() -> None:
    """As in a terminal, also where the tests run in the background of a shell, which has it ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def apartment(config: Path, *words: str) -> Iterator[Terminal]:
    """Runs a command until the end of the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", "services", *words, "--config", str(config)], stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True, cwd=ROOT, env=os.environ,
        preexec_fn=_hears_ctrl_c,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        yield (terminal := Terminal(process))
    finally:
        peers.end(process)  # type: ignore[arg-type]
        terminal._reader.join(LIMIT_S)
        process.stdout.close()


def done(config: Path, *words: str) -> tuple[int, str]:
    """Runs a command to its end: exit code and what it printed."""
    ended = subprocess.run(
        [sys.executable, "-m", "services", *words, "--config", str(config)], stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True, cwd=ROOT, timeout=2 * LIMIT_S, check=False,
    )  # fmt: skip
    return ended.returncode, ended.stdout


@contextmanager
def somebody(broker: Broker, *filters: str) -> Iterator[Client]:
    """A client without a name on that broker, who hears by the time the block begins."""
    with connected(BusSettings(port=broker.port)) as client:
        client.subscribe("reply/hears", *filters)

        def hears() -> bool:
            client.say("reply/hears", "yes")
            return any(message.topic == "reply/hears" for message in client.pump(0.2))

        peers.wait_until(hears, "the subscription")
        yield client
