"""What the bridge and its process for pictures hand each other through their pipe; the process is in `darkroom.py`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

BASE = "/ip_camera_rtsp"  # of the topics of a camera's pictures, after the camera's own prefix


@dataclass(frozen=True)
class Wanted:
    """What the process is to do; `cameras`: prefix of the topics and file of the lens, by name."""

    node: str
    master_uri: str | None
    cameras: dict[str, tuple[str, Path | None]] = field(default_factory=dict)
    map: Path | None = None


@dataclass(frozen=True)
class Told:
    """News of one camera for the process: where its stream is (empty: nowhere), and how far it is zoomed in."""

    cam: str
    url: str
    zoom: float


@dataclass(frozen=True)
class Done:
    """What the process says of itself: pictures shown and decoded so far, and how it stands with the master."""

    shown: int
    decoded: int
    link: str
    up: bool
