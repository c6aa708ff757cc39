"""Words that a latching publisher said before we were there: ROS sends the last one to everybody who comes.

`rostopic pub` without `-1` is such a publisher for as long as it runs: a bridge that begins anew hears its word once
more, and nothing tells how old it is. A publisher that the master knew before us may have said it long ago; only the
name of an anonymous one, as `rostopic`'s, tells when it began, and what it says is not older than that.
"""

from __future__ import annotations

import re
from math import inf
from typing import Any

from services.ros.master import Master
from services.topic import STALE_AFTER_S

MOMENTS_S = 5.0  # after we are registered; what comes first by then was kept
BEGAN = re.compile(r"_[0-9]+_([0-9]{13})$")  # pid and milliseconds since 1970, which end rospy's anonymous names
_HEARD = "heard"  # rospy hands every message its connection's own dictionary


class Latched:
    """Who published before us. `look` and `registered` are the registrar's, `is_old` is called on rospy's threads."""

    def __init__(self) -> None:
        self._before: dict[str, list[str]] = {}
        self._until = inf

    def look(self, master: Master) -> None:
        """Who is there, before we are; Unavailable when the master is away."""
        publishers, *_ = master.call("getSystemState")
        self._before = dict(publishers)

    def registered(self, now: float) -> None:
        """They know of us since `now`, of the monotonic clock."""
        self._until = min(self._until, now + MOMENTS_S)

    def is_old(self, topic: str, header: dict[str, Any], now: float, wall: float) -> bool:
        """Whether what comes by a connection with that header may have been said long before us. Takes note of it.

        `now` of the monotonic clock, `wall` seconds since 1970.
        """
        heard, header[_HEARD] = header.get(_HEARD, False), True
        publisher = str(header.get("callerid"))
        kept = header.get("latching") == "1" and not heard and now < self._until
        return kept and publisher in self._before.get(topic, ()) and not _is_young(publisher, wall)


def _is_young(publisher: str, wall: float) -> bool:
    began = BEGAN.search(publisher)
    return began is not None and abs(wall - int(began[1]) / 1000) <= STALE_AFTER_S
