"""What can be set about a camera's moving picture and its snapshots: the sections `stream` and `snapshot`."""

from __future__ import annotations

from ipaddress import IPv4Network, IPv6Network
from typing import Literal

from pydantic import Field, field_validator

from services.section import Section

Network = IPv4Network | IPv6Network
LATENCIES_S = {"sub": (0.3, 0.2), "main": (0.8, 0.4)}  # 0.20 to 0.35 s and about 0.8 s were measured over Ethernet


class StreamSettings(Section):
    """The stream that is handed on: where from, where to, and to whom; loopback is always allowed."""

    rtsp: bool = False  # on from the start, as after the order
    mjpeg: bool = False
    source: Literal["sub", "main"] = "sub"  # the large picture costs a small machine most of a core
    host: str = "127.0.0.1"  # 0.0.0.0 or :: for other machines too
    port: int = Field(default=0, ge=0, le=65535)  # 0: any that is free
    allow: tuple[Network, ...] = ()  # addresses and networks besides loopback
    url: str | None = None  # what is published instead of our own address, without the path
    viewers: int = Field(default=8, ge=1, le=100)
    fps: float = Field(default=10.0, gt=0, le=60)  # the most that one viewer is sent
    latency_s: float | None = Field(default=None, ge=0, le=10)  # from light to packet, the constant part; None: usual
    camera_mjpeg: bool = False  # fall back on the camera's own MJPEG: fetching it can reconfigure its encoder
    snapshot_every_s: float = Field(default=2.0, ge=0.2, le=60)  # where the camera has no stream, while somebody looks

    @field_validator("url")
    @classmethod
    def is_an_address(cls, text: str | None) -> str | None:
        if text is not None and (not text.startswith(("http://", "https://")) or "@" in text):
            raise ValueError(f"expected http://host:port or https://host without a password in it, got {text[:80]!r}")
        return text

    @property
    def latency(self) -> tuple[float, float]:
        """From light to packet and how sure that is, seconds."""
        usual, unsure = LATENCIES_S[self.source]
        return (usual, unsure) if self.latency_s is None else (self.latency_s, 0.1)


class SnapshotSettings(Section):
    """When a snapshot is published that nobody asked for."""

    every_s: float | None = Field(default=None, ge=1, le=86400)
    at_motion: bool = False
