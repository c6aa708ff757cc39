"""What the probe has found: values that are None where it could not or was not allowed to look. Pure."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from services.camera.probe.likeness import Likeness


@dataclass
class Speed:
    """How fast one axis turns at one level, degrees per second; `doubt` is one standard deviation."""

    axis: str
    level: int
    per_s: float
    doubt: float


@dataclass
class Findings:
    """All of it. The names of `switches` are those of the simulator's profiles."""

    url: str
    brand: str = ""
    model: str = ""
    serial: str = ""
    firmware: str = ""
    built: str = ""
    vendor: str = ""
    name: str = ""
    switches: dict[str, Any] = field(default_factory=dict)  # how the firmware behaves
    capabilities: dict[str, Any] = field(default_factory=dict)  # what it can do
    picture: dict[str, Any] = field(default_factory=dict)  # how the picture is set
    latency_ms: dict[str, float] = field(default_factory=dict)  # of requests: median, spread, p95, worst
    delays_s: dict[str, float] = field(default_factory=dict)  # of motions; `reading`: how old one is when it comes
    speeds: list[Speed] = field(default_factory=list)
    clock_off_s: float | None = None
    like: Likeness | None = None  # which of the known firmwares
    pose: tuple[float, float, float] | None = None
    moved: bool = False
    rtsp_port: int | None = None  # as it says
    streams: dict[str, str] = field(default_factory=dict)  # main and sub: codec and size of those that it delivers
    rights: dict[str, bool | None] = field(default_factory=dict)  # what the account may; None: not tried
    notes: list[str] = field(default_factory=list)  # for the reader
    unknown: dict[str, str] = field(default_factory=dict)  # switch -> why it was not found out

    def data(self) -> dict[str, Any]:
        """The same for JSON."""
        return asdict(self)


def share(values: list[float], part: float) -> float:
    """The value below which that part of them lies."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]
