"""A process of the bridge's own, started and kept running: a second ROS node, so that pixels never delay a message.

It is told values through a pipe, and says others. It ends when its end of the pipe closes, with us or because we were
killed. What it does is its target's: `darkroom.py` for the cameras of the house, `robots/senses.py` for a robot.
"""

from __future__ import annotations

import logging
import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

AGAIN_S = 5.0  # at least, from one start to the next
GRACE_S = 3.0

log = logging.getLogger(__name__)


class Child:
    """`target` is called in the process with `wanted`, its end of the pipe, and `every_s`, between two words of it."""

    def __init__(
        self, name: str, target: Callable[[Any, Connection, float], None], wanted: Any, every_s: float
    ) -> None:
        self._name, self._target, self._wanted, self._every_s = name, target, wanted, every_s
        self._process: BaseProcess | None = None
        self._connection: Connection | None = None
        self._start_at = 0.0
        self.starts = 0

    @property
    def runs(self) -> bool:
        """Whether there is one."""
        return self._process is not None

    def tend(self, now: float) -> bool:
        """Starts it where it does not run, at once if it ran for a while; True when it has just been started."""
        if self._process is not None and not self._process.is_alive():
            self._start_at = min(self._start_at, now + AGAIN_S)  # however the clock was set since
            wait = max(0.0, self._start_at - now)
            log.error("the process for %s ended with %s; again in %.0f s", self._name, self._process.exitcode, wait)
            self._forget()
        if self._process is not None or now < self._start_at:
            return False
        self._start_at = now + AGAIN_S
        self._start()
        return True

    def tell(self, value: Any) -> None:
        """Says something to it; lost where it does not run."""
        if self._connection is not None:
            try:
                self._connection.send(value)
            except OSError:  # it has just ended, which the next look finds
                return

    def said(self) -> list[Any]:
        """What it said since."""
        values = []
        try:
            while self._connection is not None and self._connection.poll():
                values.append(self._connection.recv())
        except (EOFError, OSError):  # it has just ended
            return values
        return values

    def close(self) -> None:
        """Ends the process."""
        process = self._process
        if self._connection is not None:
            self._connection.close()
        if process is not None:
            process.join(GRACE_S)
            if process.is_alive():
                process.kill()
                process.join()
        self._process = self._connection = None

    def _start(self) -> None:
        """Fresh ("spawn"): rospy's node exists once per process, and forking with threads hangs."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        arguments = (self._wanted, theirs, self._every_s)
        self._process = context.Process(target=self._target, args=arguments, name=self._name, daemon=True)
        self._process.start()
        theirs.close()
        self._connection = ours
        self.starts += 1

    def _forget(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._process = self._connection = None
