"""The order of first contact: what is only read, then, with leave, what moves. Tells each step before and after."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from services.camera.probe import firmware, login, onvif, rights, stream, turning, video
from services.camera.probe.findings import Findings
from services.camera.probe.wire import NoRight, Wire

Ask = Callable[[Wire, Findings], None]
READS: tuple[tuple[str, Ask], ...] = (
    ("Logging in, once", login.first),
    ("Who it is", firmware.identity),
    ("How long a nonce lives", login.nonces),
    ("How it says no", firmware.refusals),
    ("Tables and brackets", firmware.brackets),
    ("Channel and status", firmware.channels),
    ("What it can do", firmware.capabilities),
    ("How long it takes to answer", firmware.latency),
    ("Its clock", firmware.clock),
    ("Snapshots", firmware.pictures),
    ("Events", stream.events),
    (onvif.STEP, firmware.onvif),
    (video.STEP, video.look),
)
MOVING = "Speeds, delays and directions"
MOVES = (
    "mirror_inverts_motors", "move_status", "position_abs", "position_relative", "continuously", "moves",
    "unset_preset", "tilt_share",
)  # fmt: skip


class Teller(Protocol):
    """Who shows how far it is."""

    def begin(self, step: str) -> None:
        """A step begins."""
        ...

    def detail(self, text: str) -> None:
        """What a long step is at."""
        ...

    def end(self, step: str, found: Findings) -> None:
        """It is done; `found` is all so far."""
        ...


def contact(wire: Wire, teller: Teller, may_move: Callable[[Findings], bool]) -> Findings:
    """Everything that can be found out. DeviceError when the camera takes no login or cannot be asked at all."""
    found = Findings(wire.url)
    wire.tell = teller.detail
    try:
        _take(*READS[0], wire, found, teller)
    except login.Foreign:
        firmware.onvif(wire, found)
        if not found.switches["onvif"]:
            raise
        _take(onvif.STEP, onvif.meet, wire, found, teller)
        return found
    for step, ask in READS[1:]:
        _take(step, ask, wire, found, teller)
    if why := _still(wire, found, teller, may_move):
        found.unknown |= {switch: why for switch in MOVES if switch not in found.switches}
    found.rights = rights.told(wire.exchanges)
    if wire.odd:
        found.notes.append(f"it refused a good login {wire.odd} times in {len(wire.exchanges)} requests")
    return found


def _still(wire: Wire, found: Findings, teller: Teller, may_move: Callable[[Findings], bool]) -> str:
    """Lets it move, with leave; why it did not."""
    if not found.switches.get("ptz_channels"):
        return "the account has no right to ask the motors"
    if not may_move(found):
        return "only a moving camera shows it"
    try:
        _take(MOVING, turning.turn, wire, found, teller)
    except NoRight as error:
        found.moved = False
        return str(error)
    return ""


def _take(step: str, ask: Ask, wire: Wire, found: Findings, teller: Teller) -> None:
    teller.begin(step)
    ask(wire, found)
    teller.end(step, found)
