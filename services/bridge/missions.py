"""Missions as a robot of ROS orders and follows them: `/iot_mission`, its state, and a service that cancels."""

from __future__ import annotations

import re
from collections.abc import Iterable

from services import topics
from services.bridge.limits import Allowance
from services.bridge.node import Call, Inlet, Node, Outlet, Ports, Server
from services.bridge.part import Part
from services.bridge.rules import Fields, Heard
from services.bus import Message
from services.errors import BadMessage
from services.payloads.robot import MissionOrder, MissionState

ORDER, STATE, CANCEL = "/iot_mission", "/iot_mission/state", "/iot_mission/cancel"
KEY_VALUE = "diagnostic_msgs/KeyValue"
MOST = 2.0  # orders a second; to cancel is never one too many
FIND = "find"  # the one key of an order; its value is the marker
MARKER = re.compile("[0-9]{1,4}")


class Missions(Part):
    """For one robot, by its name on the bus."""

    rows = (topics.MISSION_STATE,)
    ports = Ports(
        (Outlet(STATE, KEY_VALUE, latch=True),), (Inlet(ORDER, KEY_VALUE),), (Server(CANCEL, "std_srvs/Trigger"),)
    )

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._state: MissionState | None = None
        self._is_new = False
        self._allowance = Allowance()

    def hear(self, heard: Heard, now: float) -> None:
        """See `Part`."""
        if isinstance(heard.model, MissionState) and heard.levels["robot"] == self._robot:
            self._state, self._is_new, self.due = heard.model, True, now

    def heard_ros(self, topic: str, fields: Fields, now: float) -> Iterable[Message]:
        """See `Part`."""
        key, value = str(fields["key"]), str(fields["value"]).strip()
        if key.lower() != FIND or not MARKER.fullmatch(value):
            raise BadMessage(f"expected key {FIND} and a marker's number as value")
        self._allowance.take(ORDER, MOST, now)
        return [self._order(MissionOrder(find=int(value)))]

    def called(self, name: str, call: Call, now: float) -> Iterable[Message]:
        """See `Part`; it is answered at once, how the mission ends is its state."""
        call.answer({"success": True, "message": f"asked {self._robot}'s mission to end; see {STATE}"})
        return [self._order(MissionOrder(cancel=True))]

    def tick(self, node: Node, now: float) -> Iterable[Message]:
        """See `Part`."""
        if self._is_new and self._state is not None:
            self._is_new, self.due = False, Part.due
            text = ", ".join(one for one in (self._state.place, self._state.reason) if one)
            node.publish(STATE, {"key": self._state.state, "value": text})
        return ()

    def _order(self, order: MissionOrder) -> Message:
        return topics.MISSION_ORDER.message(order, robot=self._robot)
