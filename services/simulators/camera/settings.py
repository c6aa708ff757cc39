"""The settings of a simulated camera. Light to import: every program reads every service's settings."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field, SecretStr, field_validator

from services.section import Section
from services.simulators.camera.profiles import PROFILES


class Config(Section):
    """A simulated camera; ports may be 0 for any free one."""

    folder: Path = Path()  # given by the configuration: what `world` is relative to
    world: Path = Path("world.yaml")
    camera: str = "ip1"  # which one of the world's cameras
    host: str = "127.0.0.1"
    port: int = Field(default=0, ge=0, le=65535)
    side_door_port: int = Field(default=0, ge=0, le=65535)
    rtsp_port: int | None = Field(default=0, ge=0, le=65535)  # None: no RTSP
    user: str = "ros"
    password: SecretStr = SecretStr("")
    profile: str = "ip3m-941w-2019"
    latency_s: float | None = Field(default=None, ge=0)  # of each request; None: the profile's
    seed: int = 1  # of textures, noise and nonces

    @field_validator("profile")
    @classmethod
    def is_known(cls, name: str) -> str:
        if name not in PROFILES:
            raise ValueError(f"expected one of {', '.join(PROFILES)}, got {name!r}")
        return name
