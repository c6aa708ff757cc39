"""Private copies of the programs that our services meet: broker, database, ROS master.

For the demo, the tests and the benchmarks: each on a free port of loopback, in a folder of its own, ended by its
own pid. In an installation these programs belong to the system and nothing here is used.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from services.errors import ApartmentError

POLL_S = 0.02
NO_CLIENTS = range(12000, 32768)  # Linux gives outgoing connections ports from 32768 on


class Missing(ApartmentError):
    """A program that is not on this machine; the message says how to get it."""


def program(name: str, package: str) -> str:
    """The path of a program; Missing with the Debian package that has it."""
    path = shutil.which(name) or shutil.which(name, path="/usr/sbin:/usr/bin:/sbin:/usr/local/sbin")
    if path is None:
        raise Missing(f"{name} is not installed: apt-get install {package}")
    return path


def free_port() -> int:
    """A TCP port of loopback that nobody uses now, and that no client is given until a server has taken it."""
    while True:
        port = random.SystemRandom().choice(NO_CLIENTS)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def answers(port: int, host: str = "127.0.0.1") -> bool:
    """Whether somebody accepts connections there."""
    try:
        socket.create_connection((host, port), timeout=0.5).close()
    except OSError:
        return False
    return True


def wait_until(ready: Callable[[], bool], what: str, timeout_s: float = 30.0) -> None:
    """Polls until `ready`; TimeoutError names what was waited for."""
    end = time.monotonic() + timeout_s
    while not ready():
        if time.monotonic() > end:
            raise TimeoutError(f"{what}: not within {timeout_s:.0f} s")
        time.sleep(POLL_S)


@contextmanager
def running(
    command: Sequence[str],
    log: Path,
    ready: Callable[[], bool],
    env: Mapping[str, str] | None = None,
    stop_signal: signal.Signals = signal.SIGTERM,
) -> Iterator[subprocess.Popen[bytes]]:
    """Starts a program with its output in `log`, waits until it is ready, and ends it by its pid.

    It runs in a session of its own, so a Ctrl-C meant for us does not reach it before we are done with it.
    """
    with log.open("ab") as output:
        process = subprocess.Popen(
            command, stdout=output, stderr=output, stdin=subprocess.DEVNULL, start_new_session=True,
            env={**os.environ, **(env or {})},
        )  # fmt: skip
    try:
        wait_until(lambda: _ended(process, log) or ready(), command[0])
        yield process
    finally:
        end(process, stop_signal)


def _ended(process: subprocess.Popen[bytes], log: Path) -> bool:
    if process.poll() is not None:
        raise RuntimeError(
            f"{process.args!r} ended with {process.returncode}:\n{log.read_text(errors='replace')[-2000:]}"
        )
    return False


def end(process: subprocess.Popen[bytes], stop_signal: signal.Signals = signal.SIGTERM, grace_s: float = 10.0) -> None:
    """Asks a process to end, and kills it when it does not."""
    if process.poll() is None:
        process.send_signal(stop_signal)
        try:
            process.wait(grace_s)
        except subprocess.TimeoutExpired:
            process.kill()
    process.wait()
