"""Starts one process per service and starts the fallen again, with backoff. It holds no state that matters.

Not here: what a service does (`process.py`, `runner.py`). Several light services may share a process (`group`).
"""

from __future__ import annotations

import json
import logging
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from services.config import Apartment
from services.process import SIGNAL_S, SUPERVISED

log = logging.getLogger(__name__)

SETTLED_S = 3.0  # a service that was ready and lived so long starts again at once; one that never gets so far waits
BACKOFF_S = (0.2, 30.0)  # after a short life: first, longest; doubled each time
KILLED_S = 1.0  # the longest for one that somebody killed: it is back within 3 s however often that happens
READY_S = 60.0  # a small machine imports OpenCV for some seconds
GRACE_S = 5.0  # between SIGTERM and SIGKILL


@dataclass
class Child:
    """One process and how it fares."""

    name: str
    command: Sequence[str]
    process: subprocess.Popen[str] | None = None
    started: float = 0.0
    failures: int = 0
    start_at: float | None = 0.0
    ready: dict[str, Any] | None = None
    restarts: int = field(default=-1)


def processes(apartment: Apartment, names: Sequence[str]) -> list[tuple[str, ...]]:
    """Which services share a process: each has its own, but where the configuration says `grouped`."""
    shared: dict[str, tuple[str, ...]] = {}
    for name in names:
        group = apartment.instances[name].row.group if apartment.grouped else ""
        shared[group or f"/{name}"] = (*shared.get(group or f"/{name}", ()), name)
    return list(shared.values())


def commands(groups: Sequence[tuple[str, ...]], config: Path) -> dict[str, list[str]]:
    """How each process is started."""
    python = [sys.executable, "-m", "services", "serve"]
    return {_called(group): [*python, *group, "--config", str(config)] for group in groups}


def simulated(apartment: Apartment, groups: Sequence[tuple[str, ...]]) -> set[str]:
    """The processes that hold nothing but simulators."""
    rows = apartment.instances
    return {_called(group) for group in groups if all(rows[one].row.section[0] == "simulators" for one in group)}


def _called(group: tuple[str, ...]) -> str:
    return "+".join(group)


class Supervisor:
    """Watches its children from one thread; two threads per child only read what it prints and wait for its end.

    `last`: the children that end after all others, who need them to the end: a camera service stops its camera.
    """

    def __init__(
        self,
        commands: Mapping[str, Sequence[str]],
        environment: Mapping[str, str] | None = None,
        log_file: Path | None = None,
        last: Collection[str] = (),
    ) -> None:
        self.log_file = log_file  # for what the children log; None: our own standard error
        self._last = last
        self.children = {name: Child(name, line) for name, line in commands.items()}
        self._environment = {**os.environ, **(environment or {}), SUPERVISED: str(os.getpid())}
        self._news: queue.SimpleQueue[tuple[str, subprocess.Popen[str] | None, str]] = queue.SimpleQueue()
        self._stopping = False

    def stop(self) -> None:
        """Asks `run` to end; from any thread or signal handler."""
        self._stopping = True
        self._news.put(("stop", None, ""))

    def run(self, all_ready: Callable[[dict[str, Any]], None]) -> None:
        """Until `stop`. `all_ready` gets every child's READY once, when the last is ready."""
        told = False
        try:
            while not self._stopping:
                self._start_what_is_due(time.monotonic())
                self._listen(self._until_next_start())
                if not told and all(child.ready is not None for child in self.children.values()):
                    told = True
                    all_ready({child.name: child.ready for child in self.children.values()})
        finally:
            self._end_all()

    def _start_what_is_due(self, now: float) -> None:
        for child in self.children.values():
            if child.start_at is not None and child.start_at <= now:
                self._start(child, now)

    def _start(self, child: Child, now: float) -> None:
        with self.log_file.open("ab") if self.log_file else nullcontext() as errors:
            child.process = subprocess.Popen(
                child.command, stdout=subprocess.PIPE, stderr=errors, stdin=subprocess.DEVNULL, env=self._environment,
                text=True, start_new_session=True,
            )  # fmt: skip
        child.started, child.start_at, child.ready = now, None, None
        child.restarts += 1
        for body in (self._read, self._await):
            threading.Thread(target=body, args=(child.process,), daemon=True, name=child.name).start()

    def _read(self, process: subprocess.Popen[str]) -> None:
        """A thread's body: passes on what the child prints."""
        assert process.stdout is not None
        with process.stdout as lines:
            for line in lines:
                self._news.put(("line", process, line))

    def _await(self, process: subprocess.Popen[str]) -> None:
        """A thread's body: tells that the child ended, though a process of its own may still hold its output open."""
        self._news.put(("ended", process, str(process.wait())))

    def _until_next_start(self) -> float:
        waits = [child.start_at - time.monotonic() for child in self.children.values() if child.start_at is not None]
        return max(0.0, min([*waits, SIGNAL_S]))

    def _listen(self, timeout: float) -> None:
        try:
            kind, process, text = self._news.get(timeout=timeout)
        except queue.Empty:
            return
        child = next((one for one in self.children.values() if process is not None and one.process is process), None)
        if child is not None and kind == "line" and text.startswith("READY "):
            child.ready = json.loads(text.removeprefix("READY "))
        elif child is not None and kind == "ended" and not self._stopping:
            self._plan_restart(child, int(text))

    def _plan_restart(self, child: Child, code: int) -> None:
        now = time.monotonic()
        settled = child.ready is not None and now - child.started > SETTLED_S
        child.failures = 0 if settled else child.failures + 1
        longest = KILLED_S if code < 0 else BACKOFF_S[1]
        pause = 0.0 if child.failures == 0 else min(BACKOFF_S[0] * 2 ** (child.failures - 1), longest)
        child.start_at, child.process = now + pause, None
        log.error("%s ended with %s; again in %.1f s", child.name, _outcome(code), pause)

    def _end_all(self) -> None:
        for last in (False, True):
            children = [child for child in self.children.values() if (child.name in self._last) is last]
            _end([child.process for child in children if child.process is not None])


def _end(processes: Sequence[subprocess.Popen[str]]) -> None:
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
    end = time.monotonic() + GRACE_S
    for process in processes:
        try:
            process.wait(max(0.0, end - time.monotonic()))
        except subprocess.TimeoutExpired:
            log.error("pid %d did not end within %.0f s, killed", process.pid, GRACE_S)
            process.kill()
            process.wait()


def _outcome(code: int) -> str:
    return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit {code}"


@contextmanager
def in_background(supervisor: Supervisor) -> Iterator[dict[str, Any]]:
    """Runs a supervisor in a thread; yields what the children said once all are ready. TimeoutError after 60 s."""
    ready: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    thread = threading.Thread(target=supervisor.run, args=(ready.put,), name="supervisor", daemon=True)
    thread.start()
    try:
        yield _all_of(supervisor, ready)
    finally:
        supervisor.stop()
        thread.join(GRACE_S + 5.0)


def _all_of(supervisor: Supervisor, ready: queue.SimpleQueue[dict[str, Any]]) -> dict[str, Any]:
    try:
        return ready.get(timeout=READY_S)
    except queue.Empty:
        late = ", ".join(name for name, child in supervisor.children.items() if child.ready is None)
        raise TimeoutError(f"not ready within {READY_S:.0f} s: {late}") from None
