"""The cameras' moving pictures and the map, as a part of the bridge: starts the process for them and keeps it running.

What that process does is in `darkroom.py`. While RTSP is off, or nobody on ROS looks, it does next to nothing.
"""

from __future__ import annotations

import logging
import multiprocessing
from collections.abc import Iterable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from services import topics
from services.bridge.hatch import Done, Told, Wanted
from services.bridge.node import Node
from services.bridge.part import Part, status
from services.bridge.rules import Fields, Heard
from services.bus import Message
from services.payloads import Position, Stream

EVERY_S = 1.0  # between two looks whether it runs, and between two words of it
AGAIN_S = 5.0  # after it ended, until it is started again
GRACE_S = 3.0
OK, WARN, ERROR = 0, 1, 2

log = logging.getLogger(__name__)


class Pictures(Part):
    """`wanted` is told to the process when it starts; the streams as the bus tells of them."""

    rows = (topics.CAMERA_STREAM, topics.CAMERA_POSITION)

    def __init__(self, wanted: Wanted) -> None:
        self._wanted = wanted
        self._told = {cam: Told(cam, "", 0.0) for cam in wanted.cameras}
        self._process: BaseProcess | None = None
        self._connection: Connection | None = None
        self._done: Done | None = None
        self._start_at = 0.0
        self.due = 0.0
        self.starts = 0

    def hear(self, heard: Heard, now: float) -> None:
        """See `Part`."""
        cam, said = heard.levels["cam"], heard.model
        if cam not in self._told:
            return
        before = self._told[cam]
        if isinstance(said, Stream):
            self._told[cam] = Told(cam, said.url if said.rtsp else "", before.zoom)
        elif isinstance(said, Position):
            self._told[cam] = Told(cam, before.url, said.zoom)
        if self._told[cam] != before:
            self._send(self._told[cam])

    def tick(self, node: Node, now: float) -> Iterable[Message]:
        """See `Part`."""
        if now < self.due:
            return ()
        self.due = now + EVERY_S
        self._listen()
        if self._process is not None and not self._process.is_alive():
            log.error("the process for pictures ended with %s; again in %.0f s", self._process.exitcode, AGAIN_S)
            self._forget()
            self._start_at = now + AGAIN_S
        if self._process is None and now >= self._start_at:
            self._start()
        return ()

    def statuses(self, now: float) -> list[Fields]:
        """See `Part`."""
        done, name = self._done, f"{self._wanted.node}: pictures"
        if self._process is None or done is None:
            return [status(WARN, name, "starting", self._wanted.node, starts=str(self.starts))]
        level, text = (OK, "ready") if done.up else (ERROR, f"no ROS master: {done.link}")
        counted = {"shown": str(done.shown), "decoded": str(done.decoded), "starts": str(self.starts)}
        return [status(level, name, text, self._wanted.node, **counted)]

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
        self._process = context.Process(
            target=_develop, args=(self._wanted, theirs, EVERY_S), name="pictures", daemon=True
        )
        self._process.start()
        theirs.close()
        self._connection = ours
        self.starts += 1
        for told in self._told.values():
            self._send(told)

    def _send(self, told: Told) -> None:
        if self._connection is not None:
            try:
                self._connection.send(told)
            except OSError:  # it has just ended, which the next look finds
                return

    def _listen(self) -> None:
        try:
            while self._connection is not None and self._connection.poll():
                said = self._connection.recv()
                self._done = said if isinstance(said, Done) else self._done
        except (EOFError, OSError):  # it has just ended
            return

    def _forget(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._process = self._connection = self._done = None


def _develop(wanted: Wanted, connection: Connection, every_s: float) -> None:
    """In the process: OpenCV is loaded there, not in the bridge."""
    from services.bridge import darkroom

    darkroom.run(wanted, connection, every_s)
