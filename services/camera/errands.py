"""Requests about the device itself: its clock, alarms, privacy mode, contrast, presets, storage, sound. Values only.

They have the rank of settings, sound that of pictures. What they are in a brand's words is in `brands/`; a brand may
refuse any of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from services.camera.device import Errand, Rank


@dataclass(frozen=True)
class GetMotion(Errand):
    """Whether motion is going on; the answer is a bool."""

    code: str = "VideoMotion"


@dataclass(frozen=True)
class GetMotionHold(Errand):
    """How long the camera holds a motion that is over, seconds (its anti-dither); the answer is a float."""

    code: str = "VideoMotion"


@dataclass(frozen=True)
class GetClock(Errand):
    """What the camera's clock shows: a datetime without a zone, in the camera's own, to the second."""


@dataclass(frozen=True)
class SetClock(Errand):
    """Sets the clock to show this; the answer is what it shows then."""

    shown: datetime


@dataclass(frozen=True)
class GetPrivacy(Errand):
    """Whether the lens is turned away or covered; the answer is a bool, Refused where the camera has no such thing."""


@dataclass(frozen=True)
class SetPrivacy(Errand):
    """Turns the lens away or back; the answer is the bool read back."""

    on: bool


@dataclass(frozen=True)
class GetContrast(Errand):
    """The contrast of each profile (day, night, general), 0 to 100; the answer is a tuple of int."""


@dataclass(frozen=True)
class SetContrast(Errand):
    """Sets the contrast of each profile; the answer is the tuple read back."""

    values: tuple[int, ...]


@dataclass(frozen=True)
class GetPresets(Errand):
    """Which presets the camera keeps, whoever made them; the answer is a frozenset of their numbers."""


@dataclass(frozen=True)
class GetStorage(Errand):
    """The camera's memory card; the answer is a Storage."""


@dataclass(frozen=True)
class Storage:
    """A memory card: `state` as the camera says ("none" without one), sizes in bytes."""

    state: str
    total: float = 0.0
    used: float = 0.0


@dataclass(frozen=True)
class Record(Errand):
    """Records from the microphone into that file; the answer is a Recorded. It takes its own time (`sound/desk.py`)."""

    seconds: float
    file: Path
    rank = Rank.PICTURE  # how it ends, and when, tells nothing about the camera


@dataclass(frozen=True)
class EndRecording(Errand):
    """Ends the recording that runs; what there is of it is kept."""

    rank = Rank.PICTURE


@dataclass(frozen=True)
class Play(Errand):
    """Plays that WAV file on the loudspeaker; answered when it has been played."""

    file: Path
    rank = Rank.PICTURE


@dataclass(frozen=True)
class Recorded:
    """A recording: its length, and the size of its file."""

    seconds: float
    bytes: int
