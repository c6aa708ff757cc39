"""ROS's own time under `use_sim_time`: how far `/clock` is from the clock on the wall, and moving stamps by that.

Everything here runs on wall time; only what is stamped for ROS is moved, as it leaves. As long as nobody says what
time it is, nothing is moved and nothing waits (rospy's own clock would stand still at 0).
"""

from __future__ import annotations

import importlib
import time
from typing import Any

from services.errors import Unavailable
from services.ros.master import Master

PARAMETER = "/use_sim_time"
TOPIC = "/clock"


class SimulatedTime:
    """`follow` is the registrar's, `move` the main thread's, the clock's messages come on a thread of rospy."""

    def __init__(self, rospy: Any) -> None:
        self._rospy = rospy
        self._subscriber: Any = None
        self._ahead_s: float | None = None  # ROS's time less the wall's

    def follow(self, master: Master) -> None:
        """Listens to the clock when the master says that there is one."""
        try:
            simulated = bool(master.call("getParam", PARAMETER))
        except Unavailable:  # it is not set, or the master is away, which its next call tells
            simulated = False
        if simulated and self._subscriber is None:
            clock = importlib.import_module("rosgraph_msgs.msg").Clock
            self._subscriber = self._rospy.Subscriber(TOPIC, clock, self._told, queue_size=1, tcp_nodelay=True)
        elif not simulated:
            self._ahead_s = None

    def move(self, message: Any) -> None:
        """Moves a message's stamps; those of transforms too."""
        ahead_s = self._ahead_s
        if ahead_s is None:
            return
        for stamped in (message, *getattr(message, "transforms", ())):
            header = getattr(stamped, "header", None)
            if header is not None and not header.stamp.is_zero():
                header.stamp = type(header.stamp).from_sec(max(0.0, header.stamp.to_sec() + ahead_s))

    def _told(self, message: Any) -> None:
        self._ahead_s = message.clock.to_sec() - time.time()
