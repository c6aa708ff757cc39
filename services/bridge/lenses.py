"""`set_camera_info`: ROS's own calibrator hands a calibration over, and the camera's service writes its `ost.yaml`."""

from __future__ import annotations

import uuid
from collections.abc import Iterable
from math import inf

from pydantic import ValidationError

from services import topics
from services.bridge.hatch import BASE
from services.bridge.node import Call, Node, Ports, Server
from services.bridge.part import Part
from services.bridge.rules import Heard
from services.bus import Message
from services.errors import BadMessage
from services.payloads import Order, OrderResult

SERVICE = "/set_camera_info"
KEY = "SetCameraInfo"
TOLD = ("width", "height", "distortion_model", "D", "K", "R", "P")
ANSWER_S = 20.0


class Lenses(Part):
    """A service per camera, under two names: beside the pictures, where the calibrator looks, and the plain one."""

    rows = (topics.CAMERA_ORDER_RESULT,)

    def __init__(self, cameras: tuple[str, ...]) -> None:
        prefixes = {cam: "" if cam == cameras[0] else f"/{cam}" for cam in cameras}
        self._cameras = {f"{prefix}{base}{SERVICE}": cam for cam, prefix in prefixes.items() for base in ("", BASE)}
        self.ports = Ports(servers=tuple(Server(name, "sensor_msgs/SetCameraInfo") for name in self._cameras))
        self._waiting: dict[str, tuple[float, Call]] = {}

    def called(self, name: str, call: Call, now: float) -> Iterable[Message]:
        """See `Part`."""
        info, named = call.fields["camera_info"], f"lens-{uuid.uuid4().hex[:12]}"
        value = {key: list(info[key]) if isinstance(info[key], list | tuple) else info[key] for key in TOLD}
        try:
            order = Order(value=value, id=named)
        except ValidationError as error:
            why = "expected finite numbers in camera_info"
            call.answer({"success": False, "status_message": why})
            raise BadMessage(f"{name}: {why}") from error
        self._waiting[named] = (now + ANSWER_S, call)
        self.due = min(self.due, now + ANSWER_S)
        return [topics.CAMERA_ORDER.message(order, cam=self._cameras[name], key=KEY)]

    def hear(self, heard: Heard, now: float) -> None:
        """See `Part`."""
        said = heard.model
        if isinstance(said, OrderResult) and said.state not in ("accepted", "running") and said.id in self._waiting:
            _, call = self._waiting.pop(said.id)
            text = "the camera has it" if said.state == "done" else f"{said.state}: {said.error or ''}"
            call.answer({"success": said.state == "done", "status_message": text})

    def tick(self, node: Node, now: float) -> Iterable[Message]:
        """See `Part`."""
        if now >= self.due:
            for order, (until, call) in list(self._waiting.items()):
                if now >= until:
                    del self._waiting[order]
                    call.answer({"success": False, "status_message": "the camera's service does not answer"})
            self.due = min((until for until, _ in self._waiting.values()), default=inf)
        return ()
