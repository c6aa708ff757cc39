"""The settings of a simulated camera. Light to import: every program reads every service's settings."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import Field, SecretStr, ValidationInfo, field_validator

from services.section import Section
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.profiles import Profile


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
    # The whole firmware: what the file changes, on top of the profile with that name.
    switches: Profile = Field(default_factory=dict, validate_default=True)
    latency_s: float | None = Field(default=None, ge=0)  # of each request; None: the profile's
    seed: int = 1  # of textures, noise and nonces

    @field_validator("profile")
    @classmethod
    def is_known(cls, name: str) -> str:
        if name not in PROFILES:
            raise ValueError(f"expected one of {', '.join(PROFILES)}, got {name!r}")
        return name

    @field_validator("switches", mode="before")
    @classmethod
    def change_the_profile(cls, given: Any, info: ValidationInfo) -> Any:
        whole = PROFILES.get(info.data.get("profile", ""), Profile())
        return {**asdict(whole), **given} if isinstance(given, dict) else given
