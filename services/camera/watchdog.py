"""A small process beside each camera service, and the probe, that stops the camera when those die in a motion.

The service tells it through a pipe what turns. When the pipe closes, by an orderly end or by kill -9, and something
still turned, it sends the stop. It ignores the signals that end the service: it has to outlive it by a second. As long
as it lives it holds a lock, and the next service of that camera waits for that: the first motion of an order would be
taken for one that the stop did not end.
"""

from __future__ import annotations

import fcntl
import importlib
import itertools
import json
import logging
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import IO, Any, Literal, Protocol, cast

from pydantic import SecretStr

from services.camera.address import Address
from services.camera.device import Camera, Direction, Status
from services.camera.lanes import DRIVE, stand_still
from services.camera.web.gate import Gate
from services.errors import DeviceError

STILL = "-"
END_S = 0.5  # the service waits so long for the end of its watchdog, which may still have something to stop
AGAIN_S = 0.5  # from its end to the beginning of another one
OTHER_S, LOOK_S = 5.0, 0.05  # the next service waits so long for it, and looks so often whether it has ended
STOP_S = 60.0  # the watchdog tries to stop a camera for so long
COMMAND = "from services.camera.watchdog import main; main()"

log = logging.getLogger(__name__)


class Watchdog:
    """The service's end of the pipe. A watchdog that dies is followed by another one, which is told what turns.

    `lock`: a file that the camera's watchdogs lock; one of another service is waited for. None: there is no other.
    """

    def __init__(self, brand: str, address: Address, lock: Path | None = None) -> None:
        self._lock = None if lock is None else _after_others(lock)
        self._address = json.dumps({"brand": brand, "address": _encode(address)})
        self._turns: str | None = None  # the last word; None: none was said yet
        self._changing = threading.Lock()
        self._closing = threading.Event()
        self.process = self._begin()

    def tell(self, direction: Direction | Literal["drive"] | None) -> None:
        """What turns from now on; None: nothing."""
        with self._changing:
            self._turns = direction.name if isinstance(direction, Direction) else direction or STILL
            self._write(self.process, self._turns)

    def close(self) -> None:
        """Lets it see the end of the pipe."""
        with self._changing:
            self._closing.set()
            assert self.process.stdin is not None
            try:
                self.process.stdin.close()
            except OSError as error:
                log.warning("the watchdog has not heard of the end: %s", error)
        try:
            self.process.wait(END_S)
        except subprocess.TimeoutExpired as error:
            log.warning("the watchdog is still at work: %s", error)
        if self._lock is not None:
            self._lock.close()

    def _begin(self) -> subprocess.Popen[str]:
        shared = [] if self._lock is None else [self._lock.fileno()]
        process = subprocess.Popen(
            [sys.executable, "-c", COMMAND], stdin=subprocess.PIPE, text=True, start_new_session=True, pass_fds=shared
        )
        threading.Thread(target=self._follow, args=(process,), name="watchdog's end", daemon=True).start()
        self._write(process, self._address)
        if self._turns is not None:
            self._write(process, self._turns)
        return process

    def _follow(self, process: subprocess.Popen[str]) -> None:
        """A thread's body: until that process ends, which leaves no zombie."""
        status = process.wait()
        if self._closing.is_set():
            return
        log.error("the watchdog has ended with %d; another one begins", status)
        self._closing.wait(AGAIN_S)
        with self._changing:
            if not self._closing.is_set():
                self.process = self._begin()

    def _write(self, process: subprocess.Popen[str], line: str) -> None:
        assert process.stdin is not None
        try:
            process.stdin.write(f"{line}\n")
            process.stdin.flush()
        except OSError as error:
            log.error("the watchdog is gone, a crash would leave the camera turning: %s", error)


def _after_others(file: Path) -> IO[bytes] | None:
    """The file, locked until it is closed here and in every process that shares it; None where there cannot be one."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        held = file.open("ab")
    except OSError as error:
        log.warning("who else stops this camera is not known: %s", error)
        return None
    end = time.monotonic() + OTHER_S
    while time.monotonic() < end:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(LOOK_S)
        else:
            return held
    log.warning("the watchdog of another service of this camera is still at work")
    return held


class Connect(Protocol):
    """What every brand's module offers under this name."""

    def __call__(self, address: Address, gate: Gate, *, urgent: bool = False) -> Camera:
        """A client; nothing is sent yet."""
        ...


def brand(name: str) -> ModuleType:
    """The module of that brand."""
    return importlib.import_module(f"services.camera.brands.{name}")


def connector(name: str, address: Address, gate: Gate) -> Callable[[], Camera]:
    """Makes connections to a camera of that brand; the first one is for control."""
    connect = cast(Connect, brand(name).connect)
    number = itertools.count()
    return lambda: connect(address, gate, urgent=next(number) == 0)


def watch(lines: Iterable[str], connect: Callable[[], Camera]) -> bool:
    """Follows what turns until the lines end, then stops that; whether there was something to stop.

    At the first line, which tells that the camera can be reached, it logs in: a stop then needs one request only, and
    nothing of its own is on the way when a network fails in a motion.
    """
    camera: Camera | None = None
    turning: Direction | Literal["drive"] | None = None
    for line in lines:
        turning = _told(line.strip())
        if camera is None:
            camera = connect()
            _greet(camera)
    if camera is None:
        return False
    if turning is not None:
        stand_still(camera, limit_s=STOP_S, direction=turning)
    camera.close()
    return turning is not None


def _told(word: str) -> Direction | Literal["drive"] | None:
    if word == STILL:
        return None
    return DRIVE if word == DRIVE else Direction[word]


def _greet(camera: Camera) -> None:
    try:
        camera.send(Status())
    except DeviceError as error:
        log.warning("the watchdog does not reach the camera: %s", error)


def _encode(address: Address) -> dict[str, Any]:
    file = None if address.certificate is None else str(address.certificate)
    return {**vars(address), "password": address.password.get_secret_value(), "certificate": file}


def _read(told: dict[str, Any]) -> Address:
    file = None if told["certificate"] is None else Path(told["certificate"])
    return Address(**{**told, "password": SecretStr(told["password"]), "certificate": file})


def main() -> None:
    """The process."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    first = sys.stdin.readline()
    if not first:
        return
    told = json.loads(first)
    watch(sys.stdin, connector(told["brand"], _read(told["address"]), Gate()))
