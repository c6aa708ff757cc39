"""Commands about the camera itself, its picture's mode, its privacy and its sound, and how their values are read. Pure.

Those about motors, places and scans, and who wins, are in `orders.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Self

from services.camera.device import Mode

MODES: dict[str, Mode | Literal["scan"]] = {"color": "color", "bw": "bw", "auto": "auto", "scan": "scan"}
LONGEST_RECORDING_S = 600.0


@dataclass(frozen=True)
class VideoMode:
    """Colour, black and white, as the light is, or as a scan likes it: black and white with high contrast."""

    mode: Mode | Literal["scan"]

    @classmethod
    def read(cls, text: str) -> Self:
        """The order's value; ValueError when it is none."""
        if text.lower() not in MODES:
            raise ValueError(f"expected {', '.join(MODES)}, got {text[:80]!r}")
        return cls(MODES[text.lower()])


@dataclass(frozen=True)
class HideLens:
    """Turn the lens away so that it sees nothing, or back."""

    on: bool


@dataclass(frozen=True)
class RecordSound:
    """Record from the camera's microphone for so long; 0: end the recording that runs, and keep it."""

    seconds: float

    @classmethod
    def read(cls, text: str) -> Self:
        """The order's value; ValueError when it is none."""
        try:
            seconds = float(text)
        except ValueError:
            seconds = float("nan")
        if not 0 <= seconds <= LONGEST_RECORDING_S:
            raise ValueError(f"expected seconds from 0 to {LONGEST_RECORDING_S:g}, got {text[:80]!r}")
        return cls(seconds)


LONGEST_NAME = 255  # bytes of a file's name on Linux (limits.h)


@dataclass(frozen=True)
class PlaySound:
    """Play a file of the audio folder on the camera's loudspeaker."""

    file: str

    @classmethod
    def read(cls, text: str) -> Self:
        """The order's value: a plain name, nothing that leads out of the folder. ValueError when it is none."""
        plain = text and not set(text) & set("/\\\0") and not text.startswith(".")
        if not plain or len(text.encode(errors="surrogatepass")) > LONGEST_NAME:
            raise ValueError(f"expected the name of a file in the audio folder, got {text[:80]!r}")
        return cls(text)
