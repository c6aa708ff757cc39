"""Where a camera is, how to log in there and how far it turns: what every brand's `connect` is given."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pydantic import SecretStr


@dataclass(frozen=True)
class Address:
    """`channel` None: the brand finds out which one the firmware takes. The password never shows in a repr.

    `certificate`: what it has to show at an https:// address, a file; None: one of the system's authorities.
    """

    url: str
    user: str
    password: SecretStr
    rtsp_port: int = 554
    channel: int | None = None
    pan_dead_arc: tuple[float, float] = (179.0, 186.0)  # degrees; for brands that tell shares of the travel
    tilt_range: tuple[float, float] = (-10.0, 108.0)
    zoom_range: tuple[float, float] = (0.0, 8.0)
    certificate: Path | None = None
