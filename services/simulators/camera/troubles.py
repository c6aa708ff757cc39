"""What can be made to go wrong with a running camera, by name; `POST /fault` at the side door switches it on and off.

drop           every connection is closed without an answer
500            every request is answered 500
hang           connections are accepted, requests are never answered, streams stop
slow           every request takes `seconds` (3) longer
silent_events  event streams stay open and say nothing
frozen_stream  video streams stay open without a new picture
corrupt_jpeg   pictures lose their second half
nonce          a `share` (0.3) of the good logins is refused, with a new nonce
password       the account has another `password` ("changed")
locked         the account is locked, right passwords too
lost_stop      the next `n` (1) stops of what turns are answered well, and stop nothing
rights         the account may look but neither turn the camera nor write settings
cut            the network is gone: nothing arrives and nothing gets out; with `refuses`, connecting is refused at once
reboot         the camera restarts, once
clock          the camera's clock is `seconds` (3600) ahead
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from services.simulators.camera.http import CameraServer

Settings = Mapping[str, Any]
Switch = Callable[[CameraServer, bool, Settings], None]


def _always(how: str) -> Switch:
    def switch(camera: CameraServer, on: bool, settings: Settings) -> None:
        camera.faults.always = how if on else None

    return switch


def _flag(name: str) -> Switch:
    def switch(camera: CameraServer, on: bool, settings: Settings) -> None:
        setattr(camera.faults, name, on)

    return switch


def _hang(camera: CameraServer, on: bool, settings: Settings) -> None:
    (camera.running.clear if on else camera.running.set)()


def _slow(camera: CameraServer, on: bool, settings: Settings) -> None:
    camera.device.latency.slow_s = float(settings.get("seconds", 3.0)) if on else 0.0


def _nonce(camera: CameraServer, on: bool, settings: Settings) -> None:
    camera.door.refuses = float(settings.get("share", 0.3)) if on else camera.door.profile.spurious_401


def _password(camera: CameraServer, on: bool, settings: Settings) -> None:
    user, first = camera.door.first_account
    camera.set_account(user, str(settings.get("password", "changed")) if on else first)


def _locked(camera: CameraServer, on: bool, settings: Settings) -> None:
    camera.door.locked = on
    camera.door.unlock()


def _lost_stop(camera: CameraServer, on: bool, settings: Settings) -> None:
    camera.device.ptz.loses_stops = int(settings.get("n", 1)) if on else 0


def _rights(camera: CameraServer, on: bool, settings: Settings) -> None:
    camera.device.rights = not on


def _cut(camera: CameraServer, on: bool, settings: Settings) -> None:
    camera.network.refuses = on and bool(settings.get("refuses", False))
    (camera.network.up.clear if on else camera.network.up.set)()


def _reboot(camera: CameraServer, on: bool, settings: Settings) -> None:
    if on:
        camera.restart()


def _clock(camera: CameraServer, on: bool, settings: Settings) -> None:
    camera.device.clock.set_off(camera.clock(), float(settings.get("seconds", 3600.0)) if on else 0.0, 0.0)


TROUBLES: dict[str, Switch] = {
    "drop": _always("close"),
    "500": _always("500"),
    "hang": _hang,
    "slow": _slow,
    "silent_events": _flag("silent_events"),
    "frozen_stream": _flag("frozen_stream"),
    "corrupt_jpeg": _flag("corrupt_jpeg"),
    "nonce": _nonce,
    "password": _password,
    "locked": _locked,
    "lost_stop": _lost_stop,
    "rights": _rights,
    "cut": _cut,
    "reboot": _reboot,
    "clock": _clock,
}


def switch(camera: CameraServer, order: Settings) -> None:
    """Does as `{"name": "slow", "on": true, "seconds": 2}` says; KeyError, TypeError or ValueError for nonsense."""
    TROUBLES[order["name"]](camera, order.get("on", True) is True, order)


def clear(camera: CameraServer) -> None:
    """Switches everything off."""
    for trouble in TROUBLES.values():
        trouble(camera, False, {})
