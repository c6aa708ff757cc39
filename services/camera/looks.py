"""How the camera shows the room: the video modes with the scan's high contrast, and privacy, as plans.

Not here: flip and mirror (`chores.py`), what is sent (`brands/`).
"""

from __future__ import annotations

from typing import cast

from services.camera.commands import HideLens, VideoMode
from services.camera.device import Mode, Picture, Refused, SetPicture
from services.camera.errands import GetContrast, SetContrast, SetPrivacy
from services.camera.plan import Plan, ask, attempt
from services.camera.upkeep import Facts

SCAN_CONTRAST = 80  # of 100: black squares on white paper stand out, and greys are not clipped yet
PLAIN_CONTRAST = 50  # what cameras come with


class Looks:
    """Remembers the contrast from before the scan mode, so that leaving it restores it."""

    def __init__(self, facts: Facts) -> None:
        self.facts = facts
        self._before: tuple[int, ...] | None = None

    def mode(self, order: VideoMode) -> Plan[None]:
        """Sets a mode and reads it back; Refused when the camera says OK and does not do it."""
        scan = order.mode == "scan"
        yield from self._picture("bw" if scan else cast(Mode, order.mode))
        reply = yield from attempt(GetContrast())
        if isinstance(reply.error, Refused) and not scan:
            return
        if reply.error is not None:
            raise reply.error
        now = cast(tuple[int, ...], reply.result)
        high = (SCAN_CONTRAST,) * len(now)
        if scan:
            self._before = self._before if now == high else now
            yield from self._contrast(high)
        elif now == high:
            yield from self._contrast(self._before or (PLAIN_CONTRAST,) * len(now))
        self.facts.values["mode"] = order.mode

    def privacy(self, order: HideLens) -> Plan[None]:
        """Turns the lens away or back; Refused where the camera cannot."""
        reply = yield from ask(SetPrivacy(order.on))
        if reply.result != order.on:
            raise Refused("the camera said OK, but its privacy mode has not changed")
        self.facts.values["privacy"] = "on" if order.on else "off"

    def _picture(self, mode: Mode) -> Plan[None]:
        reply = yield from ask(SetPicture(mode=mode))
        if cast(Picture, reply.result).mode != mode:
            raise Refused("the camera said OK, but its video mode has not changed")

    def _contrast(self, values: tuple[int, ...]) -> Plan[None]:
        reply = yield from ask(SetContrast(values))
        if reply.result != values:
            raise Refused("the camera said OK, but its contrast has not changed")
        self.facts.values["contrast"] = " ".join(map(str, values))
