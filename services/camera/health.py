"""Whether the camera can be used, judged by its replies, and how long to leave it in peace. Pure.

A lost camera is told once, and its return once; that it has restarted meanwhile, too.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from typing import Literal

from services.camera.absence import Absence
from services.camera.device import Away, BadLogin, Identify, Locked, Rank, Reply, Request, Status
from services.payloads import CameraStatus

FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 10.0  # between attempts to reach a camera that is away
MARGIN_S = 0.1  # so that the gate (`web/gate.py`) is open when it is asked again
IDLE_S, REST_S = 1.0, 2.0  # between two readings of a camera that may turn; that has stood still, or just arrived
STIRRED_S = 10.0  # so long ago

State = Literal["online", "offline", "bad_login", "locked", "rebooting", "degraded"]
log = logging.getLogger(__name__)


@dataclass
class Health:
    """The state of one camera; `next_poll` is when it may be asked again."""

    name: str
    state: State = "offline"
    reason: str = "not asked yet"
    next_poll: float = 0.0
    latency: float = 0.0
    failures: int = 0
    rebooting: bool = False
    stream: str = ""  # why no moving picture comes although it was ordered
    moving: bool = False  # a motion is to be stopped: losing the camera now is worse than offline
    met: bool = False  # it was asked who it is since it was away
    absence: Absence = field(default_factory=Absence)

    @property
    def online(self) -> bool:
        """Whether orders make sense."""
        return self.state == "online"

    @property
    def status(self) -> CameraStatus:
        """What is published."""
        if self.online and self.stream:
            return CameraStatus(state="degraded", reason=self.stream)
        return CameraStatus(state=self.state, reason=self.reason)

    def look_at(self, still_s: float) -> float:
        """When it may be asked where it looks, after so long without a motion that was not ordered.

        Less often where it stands still: an order that comes meanwhile waits for the answer.
        """
        return self.next_poll + (REST_S - IDLE_S if self.online and still_s > STIRRED_S else 0.0)

    def take(self, reply: Reply) -> None:
        """Judges one reply. A refusal is an answer too, and so is a fault in a side question: the camera is there."""
        error = reply.error
        if isinstance(error, BadLogin):
            self._away(reply, "locked" if isinstance(error, Locked) else "bad_login", str(error))
            self.next_poll = reply.received + error.again_s + MARGIN_S
        elif isinstance(error, Away) and not (error.answered and _aside(reply.request)):
            state: State = "rebooting" if self.rebooting else "degraded" if self.moving else "offline"
            self._away(reply, state, str(error))
            self.absence.take(reply)
            self.next_poll = reply.received + min(LONGEST_PAUSE_S, FIRST_PAUSE_S * 2 ** min(self.failures - 1, 10))
        elif not self.rebooting:
            self._there(reply)

    def reboot(self) -> None:
        """The camera was told to start again."""
        self.rebooting = self.absence.ordered = True
        self.state, self.reason, self.met = "rebooting", "as ordered", False

    def rebooted(self, *, why_not: str = "") -> None:
        """It is up again, or nobody waits for it any longer."""
        self.rebooting, self.absence.ordered = False, not why_not
        self.state, self.reason = ("offline", why_not) if why_not else ("online", "")

    def meet(self, who: Reply) -> bool:
        """It was asked who it is: whether it has restarted since it was asked that the last time."""
        self.met = self.online
        if not self.met:
            return False
        signs, self.absence = self.absence.signs(who.result), Absence(known=True)
        if signs:
            level = logging.INFO if "as ordered" in signs else logging.WARNING
            log.log(level, "%s: it has restarted, as it seems: %s", self.name, ", ".join(signs))
        return bool(signs)

    def _away(self, reply: Reply, state: State, reason: str) -> None:
        self.failures, self.met = self.failures + 1, False
        if self.state == "online":
            log.warning("%s: lost: %s", self.name, reason)
        elif self.failures == 1:
            log.warning("%s: not reached: %s", self.name, reason)
        self.state, self.reason = state, reason

    def _there(self, reply: Reply) -> None:
        """It is online when it was asked where it looks (a camera without motors says no); nothing else counts."""
        self.latency += 0.2 * (reply.received - reply.sent - self.latency)
        if isinstance(reply.request, Status):
            if self.state != "online":
                log.info("%s: online", self.name)
            self.state, self.reason, self.failures = "online", "", 0
            self.next_poll = reply.received + IDLE_S


def _aside(request: Request) -> bool:
    """Whether it is neither about where the camera looks nor its motors nor who it is: it can be used without that."""
    return request.rank is Rank.CONFIG and not isinstance(request, Identify)
