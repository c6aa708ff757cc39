"""To which order, and to which mission, a told state belongs: people use the same id again. Pure.

A row is found by its camera or robot, its id and its first time, so every state gets that time before it is written.
An order's first state is `accepted`, or the only one that it has. A mission tells when it began, but not exactly.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import replace

from services.storage import FINAL_STATES, CameraOrder, Mission

SAME_US = 200_000  # states of one mission tell its begin to 0.1 s and are stamped to 1 ms; no two begin so close
MISSIONS = 100  # remembered: more than go on at once, and a robot's last one comes again at each connection


class Again:
    """What was told lately."""

    def __init__(self) -> None:
        self._orders: dict[tuple[str, str], int] = {}  # that have not ended: camera and id to their first time
        self._missions: deque[tuple[str, str, int]] = deque(maxlen=MISSIONS)

    def learn(self, orders: Iterable[tuple[str, str, int]], missions: Iterable[Mission]) -> None:
        """What the database remembers: orders that have not ended, and the newest missions."""
        self._orders = {(camera, order): at for camera, order, at in orders}
        self._missions.extend((one.robot, one.mission, one.started) for one in missions)

    def order(self, told: CameraOrder) -> CameraOrder:
        """The same with the time of its first state."""
        who = (told.camera, told.order_id)
        if told.state == "accepted" or who not in self._orders:
            self._orders[who] = told.at
        at = self._orders.pop(who) if told.state in FINAL_STATES else self._orders[who]
        return replace(told, at=at)

    def mission(self, told: Mission) -> Mission:
        """The same with the begin that its first state told."""
        for robot, mission, started in self._missions:
            if (robot, mission) == (told.robot, told.mission) and abs(started - told.started) <= SAME_US:
                return replace(told, started=started)
        self._missions.append((told.robot, told.mission, told.started))
        return told
