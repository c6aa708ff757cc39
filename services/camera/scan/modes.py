"""The second picture mode of a scan, black and white with high contrast, and the way back to how it was.

How it was is written down before anything is changed, so that a service that was killed restores it in its next life.
The orders' own modes are in `looks.py`.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

from services.camera.device import Away, GetPicture, Picture, Refused, Reply, SetPicture
from services.camera.errands import GetContrast, SetContrast
from services.camera.looks import SCAN_CONTRAST
from services.camera.plan import Plan, ask, attempt
from services.whole_file import write_whole

PROFILES = 3  # day, night and general

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Before:
    """How the camera's picture was, in each of its profiles; `contrast` empty where it does not tell."""

    modes: tuple[str, ...]
    contrast: tuple[int, ...] = ()


class Modes:
    """One camera's. `file`: where the note is kept; None: nowhere."""

    def __init__(self, file: Path | None) -> None:
        self.file = file
        self.noted: Before | None = None  # how it was, from before this scan's first change
        self.changed = False  # and is to be again
        self.leaving = False
        self._recall()

    def note(self, asked: Reply | None = None) -> Plan[None]:
        """Asks how the picture is, unless that is still to be restored; `asked`: the answer to GetPicture, if any."""
        if self.changed:
            return
        reply = asked if asked is not None and asked.error is None else (yield from ask(GetPicture()))
        picture = cast(Picture, reply.result)
        told = yield from attempt(GetContrast())
        self.noted = Before(_modes(picture), cast(tuple[int, ...], told.result) if told.error is None else ())

    def forget(self) -> None:
        """A new scan asks anew."""
        if not self.changed:
            self.noted = None

    def enter(self) -> Plan[float]:
        """Black and white with high contrast from now on; returns about when. Refused where the camera cannot."""
        if self.noted is None:
            yield from self.note()
        assert self.noted is not None
        noted = self.noted
        modes = tuple(mode and "bw" for mode in noted.modes)  # what is not told cannot be restored
        high = Before(modes, (SCAN_CONTRAST,) * len(noted.contrast))
        if noted == high:
            raise Refused("the picture is black and white with high contrast already")
        self._write()
        return (yield from _changed(high, lambda now: now == high.modes or now != noted.modes))

    def leave(self) -> Plan[None]:
        """As it was. DeviceError: it is still to be restored."""
        if not self.changed or self.noted is None or self.leaving:
            return
        self.leaving = True
        try:
            yield from self._restore(self.noted)
        finally:
            self.leaving = False

    def give_over(self) -> None:
        """Somebody else decides how the picture is, from now on."""
        self.changed, self.noted = False, None
        if self.file is not None:
            self.file.unlink(missing_ok=True)

    def _restore(self, before: Before) -> Plan[None]:
        yield from _changed(before, lambda now: _same(now, before.modes))
        if self.noted is before:
            self.give_over()

    def _write(self) -> None:
        self.changed = True
        if self.file is not None and self.noted is not None:
            try:
                write_whole(self.file, json.dumps(asdict(self.noted)))
            except OSError as error:
                log.warning("how the picture was is not kept: %s", error)

    def _recall(self) -> None:
        if self.file is None or not self.file.exists():
            return
        try:
            self.noted, self.changed = _read(json.loads(self.file.read_text(encoding="utf-8"))), True
        except (OSError, ValueError, KeyError, TypeError) as error:
            log.warning("%s cannot be read: %s", self.file, error)


def _read(kept: Any) -> Before:
    """A note; an older one has one mode, and which profile had it is not known."""
    modes = tuple(kept["modes"]) if "modes" in kept else (kept["mode"],) * PROFILES
    if not "".join(modes).isalnum():
        raise ValueError(f"expected the mode of each profile, got {str(modes)[:80]}")
    return Before(modes, tuple(int(one) for one in kept["contrast"]))


def _modes(picture: Picture) -> tuple[str, ...]:
    return picture.modes or (picture.mode,)


def _same(now: tuple[str, ...], noted: tuple[str, ...]) -> bool:
    """Whether all are as noted; an older note has modes of profiles, too, that the camera may not have."""
    return all(mode in ("", before) for mode, before in zip(now, noted, strict=False) if before)


def _changed(to: Before, so: Callable[[tuple[str, ...]], bool]) -> Plan[float]:
    """Changes modes and contrast in one request, after which the camera exposes anew once; returns about when that was.

    Refused where the modes then are not `so`; a contrast that stays as it is is left.
    """
    reply = yield from attempt(SetPicture(modes=to.modes, contrast=to.contrast))
    if isinstance(reply.error, Refused) and to.contrast:
        reply = yield from attempt(SetPicture(modes=to.modes))
    if reply.error is not None:
        raise reply.error
    if not so(_modes(cast(Picture, reply.result))):
        raise Refused("the camera said OK, but its video mode has not changed")
    if to.contrast and (yield from attempt(GetContrast())).result != to.contrast:
        again = yield from attempt(SetContrast(to.contrast))
        if isinstance(again.error, Away):
            raise again.error
        reply = again
    return (reply.sent + reply.received) / 2
