"""What a connection to a moving picture gives, whatever it is made of: RTSP (`rtsp.py`) or parts of JPEG."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from services.camera.video.pictures import Image


@dataclass(frozen=True)
class Arrival:
    """One picture as it came: `stream_s` is the stream's own time (None: it has none), `arrived` ours.

    `develop` is None where it was not decoded, because nobody looks or because it could not be (`broken`).
    """

    arrived: float
    size: int
    stream_s: float | None = None
    develop: Callable[[], Image] | None = None
    jpeg: bytes | None = None
    broken: bool = False


class Session(Protocol):
    """An open connection, used by one thread."""

    name: str

    def read(self, *, decode: bool) -> Arrival:
        """Waits for the next picture; Away when none comes in time or the camera has ended the connection."""
        ...

    def close(self) -> None:
        """Ends the connection."""
        ...
