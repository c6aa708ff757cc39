"""What a camera can do, found out at first sight without moving it, and kept by serial number and firmware.

A new firmware is a new camera here. How it is asked is in `brands/`; whether what it claims is true, only moving shows.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Literal, get_args

from pydantic import TypeAdapter, ValidationError

from services.camera.device import Away, Errand, Identity, Refused
from services.camera.plan import Plan, attempt, wait
from services.whole_file import write_whole

BUSY_S = 1.0  # between two looks whether the camera has nothing else to do
Pair = tuple[float, float]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Capabilities:
    """None: the camera does not tell. Ranges in degrees as it reads them."""

    channel: int | None = None  # of the motors
    status_form: str | None = None
    presets: int = 0  # the highest number; 0: it has none
    absolute: bool | None = None  # it says that it takes positions
    relative: bool | None = None
    timed: bool | None = None  # motions that end by themselves
    zoom: bool | None = None
    pan_range: Pair | None = None
    tilt_range: Pair | None = None
    audio_in: int = 0
    audio_out: int = 0
    privacy: bool = False
    day_night: str | None = None  # the table that has colour and black-and-white
    events: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """What there is, for the diagnostics."""
        flags = [name for name in ("absolute", "relative", "timed", "zoom", "privacy") if getattr(self, name)]
        counts = [f"{name} {count}" for name, count in (("presets", self.presets), ("microphones", self.audio_in),
                                                        ("loudspeakers", self.audio_out)) if count]  # fmt: skip
        return ", ".join([*counts, *flags])


Part = Literal["status", "motors", "picture", "day_night", "privacy", "audio_in", "audio_out", "events"]
PARTS: tuple[Part, ...] = get_args(Part)


@dataclass(frozen=True)
class GetCapabilities(Errand):
    """What can you do, as to one part; the answer is a Capabilities with only that. Nothing moves for it.

    One part is one question, two at most: a stop that is ordered meanwhile does not wait long.
    """

    part: Part


READER = TypeAdapter(dict[str, Capabilities])


class Abilities:
    """Those of one camera, asked for once for each firmware. Without a file they are forgotten at the end."""

    def __init__(self, file: Path | None, free: Callable[[], bool]) -> None:
        self.file, self.free = file, free
        self.present: Capabilities | None = None
        self._kept = _read(file)
        self._asking = False

    def meet(self, identity: Identity | None, now: float) -> Plan[None]:
        """Asks, a question at a time while the camera has nothing else to do, unless it is known already."""
        key = f"{identity.serial} {identity.version}" if identity is not None and identity.serial else ""
        if key in self._kept:
            self.present = self._kept[key]
        if key in self._kept or self._asking:
            return
        self._asking = True
        try:
            told, whole = Capabilities(), True
            for part in PARTS:
                while not self.free():
                    now = yield from wait(now + BUSY_S)
                reply = yield from attempt(GetCapabilities(part))
                now = reply.received
                if isinstance(reply.error, Away) and reply.error.answered:
                    whole = False
                elif reply.error is not None and not isinstance(reply.error, Refused):
                    return  # it is met again when it is back
                if isinstance(reply.result, Capabilities):
                    told = joined(told, reply.result)
        finally:
            self._asking = False
        self.present = told
        if key and whole:
            self._keep(key, told)

    def _keep(self, key: str, told: Capabilities) -> None:
        self._kept[key] = told
        if self.file is None:
            return
        try:
            write_whole(self.file, READER.dump_json(self._kept, indent=1))
        except OSError as error:
            log.warning("what the camera can do is not kept: %s", error)


def joined(one: Capabilities, other: Capabilities) -> Capabilities:
    """What either of them tells."""
    nothing = Capabilities()
    told = {part.name: getattr(other, part.name) for part in fields(other)}
    return replace(one, **{name: value for name, value in told.items() if value != getattr(nothing, name)})


def _read(file: Path | None) -> dict[str, Capabilities]:
    """What was kept; a file that makes no sense is as good as none."""
    try:
        return READER.validate_json(file.read_bytes()) if file is not None else {}
    except FileNotFoundError:
        return {}
    except (OSError, ValidationError) as error:
        log.warning("%s cannot be used, the camera is asked again: %s", file, error)
        return {}
