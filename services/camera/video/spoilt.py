"""Whether the camera's snapshots are pictures: told once when they are not, and once when they are again. Pure.

Not here: the frames of a scan, which tells itself what it could not read, and the stream's own troubles (`channel.py`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TypeVar, cast

from services.camera.device import Reply
from services.camera.upkeep import Facts
from services.errors import DeviceError

QUIET_S = 60.0  # between two warnings, where good and bad ones take turns
CONCERN = "snapshot"
T = TypeVar("T")

log = logging.getLogger(__name__)


class Spoilt:
    """One camera's. `why` there is no picture; empty when the newest one was good. `count`: so many were none."""

    def __init__(self, camera: str, facts: Facts) -> None:
        self.camera = camera
        self.facts = facts
        self.why = ""
        self.count = 0
        self._told_at = -QUIET_S
        self._told = False

    def judged(self, reply: Reply, use: Callable[[bytes], T]) -> T:
        """What was made of a reply's picture; DeviceError when it is none. Either is told."""
        try:
            if reply.error is not None:
                raise reply.error
            made = use(cast(bytes, reply.result))
        except DeviceError as error:
            self._bad(str(error), reply.received)
            raise
        self._good()
        return made

    def _bad(self, why: str, now: float) -> None:
        self.why = why
        self.count += 1
        self.facts.complain(CONCERN, f"no snapshot: {why}")
        if not self._told and now - self._told_at >= QUIET_S:
            log.warning("%s: no snapshot: %s", self.camera, why)
            self._told, self._told_at = True, now

    def _good(self) -> None:
        if self._told:
            log.info("%s: its snapshots are good again", self.camera)
        self.why, self._told = "", False
        self.facts.complain(CONCERN, "")
