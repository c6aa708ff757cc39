"""A private ROS 1 master, which tests may kill and start again on the same port."""

from __future__ import annotations

import xmlrpc.client
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from services.peers import end, free_port, program, running

PACKAGES = "python3-rosmaster python3-rospy python3-rostopic python3-diagnostic-msgs python3-geometry-msgs"


@dataclass
class Master:
    """A master on loopback. `env` is what a ROS program needs in its environment to meet it, and nobody else's."""

    port: int
    folder: Path
    pid: int = 0
    _running: ExitStack = field(default_factory=ExitStack, repr=False)

    @property
    def uri(self) -> str:
        """Its ROS_MASTER_URI."""
        return f"http://127.0.0.1:{self.port}"

    @property
    def env(self) -> dict[str, str]:
        """The environment of everyone in this private graph; ROS_HOSTNAME too, since it goes before ROS_IP."""
        return {
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": "127.0.0.1",
            "ROS_HOSTNAME": "127.0.0.1",
            "ROS_HOME": str(self.folder),
            "ROS_LOG_DIR": str(self.folder / "log"),
        }

    def start(self) -> None:
        """Starts it and waits until it answers; Missing where rosmaster is not installed."""
        command = [program("rosmaster", PACKAGES), "--core", "-p", str(self.port)]
        self.folder.mkdir(parents=True, exist_ok=True)
        log = self.folder / "rosmaster.log"
        process = self._running.enter_context(running(command, log, lambda: self.asked_pid() is not None, self.env))
        self._running.callback(end, process)
        self.pid = process.pid
        self._process = process

    def asked_pid(self) -> int | None:
        """The pid that it answers with; None when it does not."""
        try:
            with xmlrpc.client.ServerProxy(self.uri) as proxy:
                answer: Any = proxy.getPid("/peers")
                return int(answer[2])
        except (OSError, xmlrpc.client.Error):
            return None

    def kill(self) -> None:
        """As `kill -9`: no goodbye to anyone."""
        self._process.kill()
        self._process.wait()

    def stop(self) -> None:
        """Ends it, however it is."""
        self._running.close()


@contextmanager
def private(folder: Path, port: int = 0) -> Iterator[Master]:
    """Runs a master on a free port until the end of the block; its logs are in `folder`."""
    master = Master(port or free_port(), folder)
    try:
        master.start()
        yield master
    finally:
        master.stop()
