"""What the account may do, by the answers to what was asked anyway: a missing right has its own words. Pure.

What only an order shows is not tried: to write settings, speak, cover the lens, set the clock, restart.
"""

from __future__ import annotations

from collections.abc import Iterable

from services.camera.probe.wire import Exchange

ASKS: dict[str, tuple[str, ...]] = {  # what it may -> beginnings of requests that need the right to it
    "take snapshots": ("/cgi-bin/snapshot.cgi",),
    "read where it looks": ("/cgi-bin/ptz.cgi?action=getStatus",),
    "turn it": ("/cgi-bin/ptz.cgi?action=start", "/cgi-bin/ptz.cgi?action=move"),
    "read settings": ("/cgi-bin/configManager.cgi?action=getConfig",),
    "hear events": ("/cgi-bin/eventManager.cgi",),
}
NO_EVENTS = "Error: No Events"  # all is well, and nothing happens
UNTRIED = "write settings, use sound, cover the lens, set the clock, restart"


def told(exchanges: Iterable[Exchange]) -> dict[str, bool | None]:
    """Whether it may do each; None: that was not tried, or not answered clearly."""
    asked = list(exchanges)
    return {right: _may([one for one in asked if one.target.startswith(begins)]) for right, begins in ASKS.items()}


def _may(asked: list[Exchange]) -> bool | None:
    if any(one.good or one.text.startswith(NO_EVENTS) for one in asked):
        return True
    return False if any(one.denied for one in asked) else None


def words(rights: dict[str, bool | None]) -> str:
    """For people: what it may, what it may not, and what nobody tried."""
    kinds = {"may": True, "may NOT": False, "not tried": None}
    each = {kind: ", ".join(right for right, may in rights.items() if may is value) for kind, value in kinds.items()}
    each["not tried"] = ", ".join(part for part in (each["not tried"], UNTRIED) if part)
    return "\n".join(f"{kind}: {rights}" for kind, rights in each.items() if rights)
