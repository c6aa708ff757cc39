"""What the camera's events mean: 1 for a while after motion, -1 when the alarm is in trouble. Pure.

    attached ──> the camera is asked whether motion is going on; like every question, but for the very first, not while
                 the camera itself turns or has just turned
    Start    ──> 1, unless the camera itself turns or has just turned: then everything in its picture moves
    such a Start without a Stop ──> the camera is asked when it cannot be its turn any more: while it holds a motion
                 (anti-dither) it tells no new one, and somebody may have come in meanwhile
    Stop     ──> still 1 for `hold_s`, then 0
    no Stop within `hold_s` ──> the camera is asked: it may have been lost, or somebody is still there
    lost     ──> -1 after `GRACE_S`; at once when it had fallen silent, and then until there is a sign of life
    mute (firmware without heartbeat, or a slow one: silence proves nothing) ──> asked every `ASK_S`, too

Not here: the connection (`listener.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, cast

from services.camera.alarm.listener import Heard
from services.camera.device import Event, Refused, Reply
from services.camera.errands import GetMotion, GetMotionHold
from services.camera.plan import Plan, attempt
from services.camera.upkeep import Facts
from services.payloads import Motion, stamp

GRACE_S = 3.0  # a stream that is back so soon was in no trouble
UNKNOWN_S = 10.0  # until the first attachment
MASK_S = 2.0  # after the camera's own motion the picture settles
ASK_S = 5.0  # between two questions where nothing else tells
LEAST_HOLD_S, MOST_HOLD_S = 5.0, 600.0  # what the anti-dither can be: so long a camera holds a motion that is over
SLACK_S = 2.0  # by which its timers and the network are late
NEVER = float("-inf")

Value = Literal[0, 1, -1]
Start = Callable[[Plan[None], float], object]


class MotionWatch:
    """The state of one camera's alarm; `begin` starts a plan that asks the camera."""

    def __init__(self, begin: Start, codes: tuple[str, ...], hold_s: float, *, on: bool) -> None:
        self.begin = begin
        self.codes = codes
        self.hold_s = hold_s
        self.on = on
        self.masked = 0  # events that were the camera's own doing
        self.reconnects = 0
        self._attached = False
        self._silent = False
        self._mute = False  # a silence has shown that this firmware has no heartbeat
        self._beats = False  # a heartbeat has come: from now on silence proves something
        self._trouble_at: float | None = None  # when to say so; None: there is none
        self._why = "not attached yet"
        self._active = False  # the camera has told no end of it
        self._unsure: set[str] = set()  # codes that go on, and may be the camera's own turn
        self._held_s = LEAST_HOLD_S  # how long the camera holds a motion, as far as it was asked since it turned
        self._moved_at = self._turned_at = NEVER
        self._asked_at = NEVER
        self._asking = False
        self._said: Motion | None = None

    @property
    def fact(self) -> str:
        """How it fares, for the diagnostics."""
        if not self.on:
            return "off"
        if self._mute and self._trouble_at is None:
            return "asked every few seconds: this firmware has no heartbeat, or a slow one"
        if self._mute or not self._attached:
            return f"lost: {self._why}"
        return "attached" if self._beats else "attached, no heartbeat yet"

    @property
    def trouble(self) -> bool:
        """Whether it was said to be in trouble."""
        return self.on and self._said is not None and self._said.value == -1

    def tell(self, facts: Facts) -> None:
        """Puts how it fares into the diagnostics."""
        facts.values["alarm"] = self.fact
        facts.complain("alarm", f"motion alarm {self.fact}" if self.trouble else "")

    def take(self, heard: Heard) -> None:
        """What the listener posts."""
        if heard.events:
            self._silent = False
            self._beats |= any(not event.code for event in heard.events)
            self._mute &= not self._beats
        if heard.attached:
            self._attached, self._asked_at = True, NEVER
        if self._attached and not self._silent:
            self._trouble_at = None
        for event in heard.events:
            self._event(event, heard.at)
        if heard.lost is not None:
            self._lose(heard)

    def tick(self, now: float, *, turning: bool, online: bool = True) -> Motion | None:
        """What is to be published; asks the camera where that is wanted. None: nothing is known yet.

        `turning`: the camera itself changes its picture. `online`: whether it answers, for what is known of it by
        asking only.
        """
        if turning:
            self._turned_at, self._held_s = now, LEAST_HOLD_S
        if not self.on:
            self._said = self._said or Motion(value=-1, since=stamp(now))
            return self._said
        if self._trouble_at is None and not self._attached and not self._mute:
            self._trouble_at = now + UNKNOWN_S
        if not self._asking and self._wants_to_ask(now):
            self._asking, self._asked_at = True, now
            self.begin(self._ask(), now)
        value = self._value(now) if online or not self._mute else -1
        if value is not None and (self._said is None or self._said.value != value):
            self._said = Motion(value=value, since=stamp(now), seen=value == 1)
        return self._said

    def _event(self, event: Event, at: float) -> None:
        if event.code not in self.codes:
            return
        if event.action == "Stop":
            self._unsure.discard(event.code)
            if self._active:
                self._active, self._moved_at = False, at
        elif event.action in ("Start", "Pulse"):
            lasting = event.action == "Start"
            if self._settled(at):
                self._moves(at, lasting=lasting)
                return
            self.masked += 1
            if lasting:
                self._unsure.add(event.code)

    def _moves(self, at: float, *, lasting: bool) -> None:
        self._active, self._moved_at = lasting, at

    def _settled(self, at: float) -> bool:
        return at - self._turned_at >= MASK_S

    def _its_own(self, at: float, held_s: float) -> bool:
        """Whether what goes on may be the camera's own last turn, if it holds a motion so long."""
        return at - self._turned_at <= MASK_S + held_s + SLACK_S

    def _lose(self, heard: Heard) -> None:
        was, self._attached = self._attached, False
        self.reconnects += was
        self._mute |= heard.silent and not self._beats
        self._silent, self._why = heard.silent and self._beats, heard.lost or ""
        if self._mute and heard.silent:
            self._trouble_at = None
        elif self._trouble_at is None:
            self._trouble_at = heard.at + (GRACE_S if was and not heard.silent else 0.0)

    def _wants_to_ask(self, now: float) -> bool:
        if self._said is not None and not self._settled(now):  # an answer would hardly count, the motors come first
            return False
        if self._mute:
            return now - self._asked_at >= ASK_S
        if not self._attached:
            return False
        if self._asked_at == NEVER:
            return True
        if self._unsure and not self._its_own(now, self._held_s):
            return now - self._asked_at >= ASK_S
        return self._active and now - max(self._moved_at, self._asked_at) >= self.hold_s

    def _ask(self) -> Plan[None]:
        for code in self.codes:
            reply = yield from attempt(GetMotion(code))
            if reply.error is not None or reply.result:
                break
        if reply.result and not self._active and self._its_own(reply.received, MOST_HOLD_S):
            self._unsure.add(code)
            if self._settled(reply.received):  # else an order came meanwhile: it is asked again when the camera stands
                held = yield from self._learn_hold(code)
                reply = reply if held is None else held
        self._told(reply)

    def _learn_hold(self, code: str) -> Plan[Reply | None]:
        """How long the camera holds a motion; what went wrong where it gave no answer."""
        held = yield from attempt(GetMotionHold(code))
        if held.error is None:
            self._held_s = cast(float, held.result)
        elif isinstance(held.error, Refused):
            self._held_s = MOST_HOLD_S
        else:
            return held
        return None

    def _told(self, reply: Reply) -> None:
        self._asking = False
        if reply.error is not None:
            self._active = False
            if self._mute:
                self._why, self._trouble_at = str(reply.error), reply.received
            return
        if self._mute:
            self._trouble_at = None
        if not reply.result:
            self._active = False
            self._unsure.clear()
        elif not self._its_own(reply.received, self._held_s):
            self._unsure.clear()
            self._moves(reply.received, lasting=True)

    def _value(self, now: float) -> Value | None:
        if self._trouble_at is not None and now >= self._trouble_at:
            return -1
        if self._said is None and (self._asked_at == NEVER or self._asking):
            return None
        return 1 if self._active or now - self._moved_at < self.hold_s else 0
