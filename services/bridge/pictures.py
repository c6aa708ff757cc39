"""The cameras' moving pictures and the map, as a part of the bridge: keeps the process for them running.

What that process does is in `darkroom.py`. While RTSP is off, or nobody on ROS looks, it does next to nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from multiprocessing.connection import Connection

from services import topics
from services.bridge.child import Child
from services.bridge.hatch import Done, Told, Wanted
from services.bridge.node import Node
from services.bridge.part import Part, status
from services.bridge.rules import Fields, Heard
from services.bus import Message
from services.payloads import RTSP_PICTURE, Position, Stream

EVERY_S = 1.0  # between two looks whether it runs, and between two words of it
OK, WARN, ERROR = 0, 1, 2


class Pictures(Part):
    """`wanted` is told to the process when it starts; the streams as the bus tells of them."""

    rows = (topics.CAMERA_STREAM, topics.CAMERA_POSITION)

    def __init__(self, wanted: Wanted) -> None:
        self._wanted = wanted
        self._told = {cam: Told(cam, "", 0.0) for cam in wanted.cameras}
        self._child = Child("pictures", _develop, wanted, EVERY_S)
        self._done: Done | None = None
        self.due = 0.0

    def hear(self, heard: Heard, now: float) -> None:
        """See `Part`."""
        cam, said = heard.levels["cam"], heard.model
        if cam not in self._told:
            return
        before = self._told[cam]
        if isinstance(said, Stream):
            self._told[cam] = Told(cam, said.beside(RTSP_PICTURE) if said.rtsp else "", before.zoom)
        elif isinstance(said, Position):
            self._told[cam] = Told(cam, before.url, said.zoom)
        if self._told[cam] != before:
            self._child.tell(self._told[cam])

    def tick(self, node: Node, now: float) -> Iterable[Message]:
        """See `Part`."""
        if now < self.due:
            return ()
        self.due = now + EVERY_S
        for said in self._child.said():
            self._done = said if isinstance(said, Done) else self._done
        if self._child.tend(now):
            self._done = None
            for told in self._told.values():
                self._child.tell(told)
        return ()

    def statuses(self, now: float) -> list[Fields]:
        """See `Part`."""
        done, name, starts = self._done, f"{self._wanted.node}: pictures", str(self._child.starts)
        if not self._child.runs or done is None:
            return [status(WARN, name, "starting", self._wanted.node, starts=starts)]
        level, text = (OK, "ready") if done.up else (ERROR, f"no ROS master: {done.link}")
        counted = {"shown": str(done.shown), "decoded": str(done.decoded), "starts": starts}
        return [status(level, name, text, self._wanted.node, **counted)]

    def close(self) -> None:
        """Ends the process."""
        self._child.close()


def _develop(wanted: Wanted, connection: Connection, every_s: float) -> None:
    """In the process: OpenCV is loaded there, not in the bridge."""
    from services.bridge import darkroom

    darkroom.run(wanted, connection, every_s)
