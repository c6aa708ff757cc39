"""`/snapshots_ip_camera`: a picture on request, as a file of the bridge's and on `/ip_camera_snapshot/compressed`.

The camera's service takes it and says it on the bus; the topic on ROS is a rule's. Here is who waits for one.
"""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Iterable
from math import inf
from pathlib import Path

from services import payloads, topics
from services.bridge.node import Call, Node, Ports, Server
from services.bridge.part import Part
from services.bridge.rules import Heard
from services.bus import Message
from services.payloads import CameraStatus

NAME = "/snapshots_ip_camera"
ANSWER_S = 25.0  # a camera may take 20 s
KEPT = 500  # files of a camera; the oldest go
USABLE = ("online", "degraded")

log = logging.getLogger(__name__)


class Snapshots(Part):
    """The first camera's service has the plain name. `folder` None: the pictures are not kept."""

    rows = (topics.CAMERA_SNAPSHOT, topics.CAMERA_STATUS)

    def __init__(self, cameras: tuple[str, ...], folder: Path | None) -> None:
        self._cameras = {NAME if cam == cameras[0] else f"/{cam}{NAME}": cam for cam in cameras}
        self._folder = folder
        self.ports = Ports(servers=tuple(Server(name, "std_srvs/Trigger") for name in self._cameras))
        self._waiting: dict[str, list[tuple[float, Call]]] = defaultdict(list)
        self._status: dict[str, CameraStatus] = {}

    def called(self, name: str, call: Call, now: float) -> Iterable[Message]:
        """See `Part`."""
        cam = self._cameras[name]
        known = self._status.get(cam)
        if known is not None and known.state not in USABLE:
            call.answer({"success": False, "message": f"{cam} is {known.state}: {known.reason}"})
            return ()
        self._waiting[cam].append((now + ANSWER_S, call))
        self.due = min(self.due, now + ANSWER_S)
        return [topics.CAMERA_SNAPSHOT_GET.message("", cam=cam)]

    def hear(self, heard: Heard, now: float) -> None:
        """See `Part`."""
        cam = heard.levels["cam"]
        if isinstance(heard.model, CameraStatus):
            self._status[cam] = heard.model
        elif isinstance(heard.payload, bytes) and (waiting := self._waiting.pop(cam, [])):
            success, text = self._keep(cam, heard.payload, now)
            for _, call in waiting:
                call.answer({"success": success, "message": text})

    def tick(self, node: Node, now: float) -> Iterable[Message]:
        """See `Part`."""
        if now >= self.due:
            for cam, waiting in self._waiting.items():
                for until, call in waiting:
                    if now >= until:
                        call.answer({"success": False, "message": f"{cam} gave no picture within {ANSWER_S:.0f} s"})
                self._waiting[cam] = [one for one in waiting if now < one[0]]
            self.due = min((until for waiting in self._waiting.values() for until, _ in waiting), default=inf)
        return ()

    def _keep(self, cam: str, jpeg: bytes, now: float) -> tuple[bool, str]:
        """Writes the file; whether that went well, and its path."""
        if self._folder is None:
            return True, "not kept: the configuration has no folder for what is kept (state)"
        name = payloads.stamp(now).replace(":", "-")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            file = self._folder / f"{cam}-{name}.jpg"
            file.write_bytes(jpeg)
            for old in sorted(self._folder.glob(f"{cam}-*.jpg"))[:-KEPT]:
                old.unlink(missing_ok=True)
        except OSError as error:
            log.warning("a snapshot of %s is not kept: %s", cam, error)
            return False, f"the picture is not kept: {error}"
        return True, str(file)
