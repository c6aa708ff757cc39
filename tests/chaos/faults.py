"""What each kind of fault does to the apartment, and how it ends."""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import suppress

import httpx

from tests.chaos.plan import Stroke
from tests.chaos.whole import Whole
from tests.network import Network

Act = Callable[[Whole, Stroke], None]


def able(whole: Whole) -> list[str]:
    """The kinds that this machine can show."""
    kinds = ["kill", "broker", "database", "master", "camera", "cut"]
    return [*kinds, *(["disk"] if whole.disk else []), *(["clock"] if whole.clocks else [])]


def _line(whole: Whole, stroke: Stroke) -> Network:
    return {**whole.broker, "database": whole.database, "camera": whole.camera}[stroke.whom]


def _tell(whole: Whole, stroke: Stroke, *, on: bool) -> None:
    """A simulated camera that was killed meanwhile has no faults, and none to end."""
    with suppress(httpx.HTTPError):
        whole.door.tell("fault", name=stroke.whom, on=on, **stroke.settings)
        if on and stroke.whom in ("drop", "password"):
            whole.door.tell("drop")  # the endless answers too


def _start_master(whole: Whole, stroke: Stroke) -> None:
    assert whole.parts.ros is not None
    whole.parts.ros.start()


def _kill_master(whole: Whole, stroke: Stroke) -> None:
    assert whole.parts.ros is not None
    whole.parts.ros.kill()


def _set_clock(whole: Whole, stroke: Stroke) -> None:
    whole.set_clock(stroke.whom, float(str(stroke.settings["seconds"])))


BEGINS: dict[str, Act] = {
    "kill": lambda whole, stroke: whole.kill(stroke.whom),
    "broker": lambda whole, stroke: whole.stop_broker(),
    "database": lambda whole, stroke: whole.stop_database(signal.Signals[stroke.whom]),
    "master": _kill_master,
    "disk": lambda whole, stroke: whole.fill_disk(),
    "camera": lambda whole, stroke: _tell(whole, stroke, on=True),
    "cut": lambda whole, stroke: _line(whole, stroke).cut(),
    "clock": _set_clock,
}
ENDS: dict[str, Act] = {
    "kill": lambda whole, stroke: None,
    "broker": lambda whole, stroke: whole.start_broker(),
    "database": lambda whole, stroke: whole.start_database(),
    "master": _start_master,
    "disk": lambda whole, stroke: whole.free_disk(),
    "camera": lambda whole, stroke: _tell(whole, stroke, on=False),
    "cut": lambda whole, stroke: _line(whole, stroke).mend(),
    "clock": lambda whole, stroke: whole.set_clock(stroke.whom, 0),
}
