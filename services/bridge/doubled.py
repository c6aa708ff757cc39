"""A first word that a publisher of rospy says twice, by no fault of its own.

A latching publisher (`rostopic pub` is one) that speaks just as a subscriber connects sends it the message as one of
its listeners and again as the newest one: rospy lists the connection first and looks for what is kept afterwards,
without a lock around both (`rospy.topics._PublisherImpl.add_connection`). Of 480 `rostopic pub -1`, eight at a time on
two cores, 14 spoke twice, 3 to 38 ms apart: a light would grow brighter by two steps, and a move be made twice.
"""

from __future__ import annotations

import time
from typing import Any

WITHIN_S = 2.0  # a busy machine was seen to take more than half a second
_FIRST = "first word"  # rospy hands every message its connection's own dictionary, which ends with the connection


def doubled(message: Any) -> bool:
    """Whether this is the first message of its latching publisher's connection once more. Takes note of it."""
    header = message._connection_header
    if header.get("latching") != "1":
        return False
    now, first = time.monotonic(), header.get(_FIRST)
    header[_FIRST] = (now, message) if first is None else (first[0], None)
    return first is not None and now - first[0] < WITHIN_S and first[1] == message
