"""What is looked at seldom: the camera's clock, which is set when it drifts, its memory card, its settings.

Anew after the camera was away: it may have been another firmware's turn, or somebody else's. Not here: its status and
position (`service.py`), how a clock is read and set (`brands/`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from datetime import datetime, timedelta
from zoneinfo import ZoneInfo

from services.camera.device import Errand, GetPicture, Picture, Refused, Reply
from services.camera.errands import GetClock, GetContrast, GetPrivacy, GetStorage, SetClock, Storage
from services.camera.plan import Plan, attempt, wait
from services.camera.settings import ClockSettings

LOOK_S = 2.0  # between two looks whether something is due: it waits while the camera moves
STORAGE_EVERY_S = 900.0
SETTINGS_EVERY_S = 300.0  # somebody may change them on the camera's own page
JUMP_S = 60.0  # woken later by more than that: this computer has learnt the time, and had told the camera a wrong one
NEVER_S = 86400.0  # what a camera does not have is asked for again a day later: firmware gets updates
NONE = "none"  # the camera has no such thing
HALF_S = 0.5  # the clock shows whole seconds: on average it is half a second later

log = logging.getLogger(__name__)


class Facts:
    """What is known beside status and position, for the diagnostics; a complaint raises their level to a warning."""

    def __init__(self) -> None:
        self.values: dict[str, str] = {}
        self.complaints: dict[str, str] = {}

    def complain(self, concern: str, text: str) -> None:
        """Something is not as it should be; an empty text: it is again."""
        if text:
            self.complaints[concern] = text
        else:
            self.complaints.pop(concern, None)


def local(at: float, zone: str | None) -> datetime:
    """The time that a clock on the wall of that zone shows, without the zone; None: this computer's zone."""
    return datetime.fromtimestamp(at, ZoneInfo(zone) if zone else None).replace(tzinfo=None)


def drift(shown: datetime, sent: float, received: float, zone: str | None) -> float:
    """How many seconds a clock that showed this between two moments is fast; exact to half a second and the latency."""
    return (shown - local((sent + received) / 2, zone)).total_seconds() + HALF_S


class Upkeep:
    """A plan that runs as long as the service does; `free` tells when the camera has time for it."""

    def __init__(self, camera: str, clock: ClockSettings, facts: Facts, free: Callable[[], bool]) -> None:
        self.camera, self.clock, self.facts, self.free = camera, clock, facts, free
        self._due: dict[Callable[[], Plan[float]], float] = {
            self._look_at_clock: 0.0,
            self._look_at_storage: 0.0,
            self._look_at_picture: 0.0,
            self._look_at_privacy: 0.0,
            self._look_at_contrast: 0.0,
        }

    def met(self) -> None:
        """The camera is there (again): everything is looked at anew."""
        self._due = dict.fromkeys(self._due, 0.0)
        self.facts.values = {name: value for name, value in self.facts.values.items() if value != NONE}

    def plan(self, now: float) -> Plan[None]:
        """One request at a time, whenever one is due."""
        while True:
            wanted = now + LOOK_S
            now = yield from wait(wanted)
            if now - wanted > JUMP_S:
                self._due[self._look_at_clock] = 0.0
            look = min(self._due, key=lambda one: self._due[one])
            if self.free() and self._due[look] <= now:
                self._due[look] = now + LOOK_S
                self._due[look] = now + (yield from look())

    def _look_at_clock(self) -> Plan[float]:
        reply = yield from attempt(GetClock())
        fast = self._drift(reply)
        if fast is None:
            return self._again(reply, self.clock.every_s)
        if abs(fast) > self.clock.drift_s and self.clock.set:
            log.info("%s: its clock is %+.0f s off and is set", self.camera, fast)
            took = reply.received - reply.sent
            reply = yield from attempt(SetClock(rounded(local(reply.received + took / 2, self.clock.timezone))))
            fast = self._drift(reply, after_setting=True) if reply.error is None else fast
        fast = fast or 0.0
        self.facts.values["time_drift_s"] = f"{fast:+.1f}"
        off = abs(fast) > self.clock.drift_s
        self.facts.complain("clock", f"its clock is {fast:+.0f} s off" if off else "")
        return self.clock.every_s

    def _drift(self, reply: Reply, *, after_setting: bool = False) -> float | None:
        if not isinstance(reply.result, datetime):
            return None
        sent = reply.received - (reply.received - reply.sent) / (4 if after_setting else 1)
        return drift(reply.result, sent, reply.received, self.clock.timezone)

    def _look_at_storage(self) -> Plan[float]:
        reply = yield from attempt(GetStorage())
        if not isinstance(reply.result, Storage):
            self.facts.values["storage"] = NONE
            return self._again(reply, STORAGE_EVERY_S)
        card = reply.result
        self.facts.values["storage"] = card.state
        if card.total > 0:
            self.facts.values["storage_used_percent"] = f"{100 * card.used / card.total:.0f}"
        self.facts.complain("storage", f"its memory card: {card.state}" if "rror" in card.state else "")
        return STORAGE_EVERY_S

    def _look_at_picture(self) -> Plan[float]:
        reply = yield from attempt(GetPicture())
        if isinstance(reply.result, Picture):
            picture = reply.result
            self.facts.values |= {"flip": _flag(picture.flip), "mirror": _flag(picture.mirror), "mode": picture.mode}
        return SETTINGS_EVERY_S

    def _look_at_privacy(self) -> Plan[float]:
        yield from self._note("privacy", GetPrivacy())
        return SETTINGS_EVERY_S

    def _look_at_contrast(self) -> Plan[float]:
        yield from self._note("contrast", GetContrast())
        return SETTINGS_EVERY_S

    def _note(self, name: str, errand: Errand) -> Plan[None]:
        if self.facts.values.get(name) != NONE:
            reply = yield from attempt(errand)
            if isinstance(reply.result, bool):
                self.facts.values[name] = _flag(reply.result)
            elif isinstance(reply.result, tuple):
                self.facts.values[name] = " ".join(map(str, reply.result))
            elif isinstance(reply.error, Refused):
                self.facts.values[name] = NONE

    def _again(self, reply: Reply, every_s: float) -> float:
        return NEVER_S if isinstance(reply.error, Refused) else min(every_s, 60.0)


def rounded(time: datetime) -> datetime:
    """To the whole second."""
    return (time + timedelta(seconds=HALF_S)).replace(microsecond=0)


def _flag(on: bool) -> str:
    return "on" if on else "off"
