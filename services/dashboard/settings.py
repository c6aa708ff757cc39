"""The section `dashboard` of the configuration: where the page is, who may open it, what its plan shows."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, SecretStr, field_validator

from services.apartment.cameras import CameraSections
from services.apartment.home import Home
from services.dashboard import passwords
from services.section import Section
from services.tls import server_context

Role = Literal["viewer", "operator"]


class User(Section):
    """Somebody who may log in. `apartment dashboard user NAME` makes the line; a viewer changes nothing."""

    password: SecretStr  # hashed
    role: Role = "viewer"

    @field_validator("password")
    @classmethod
    def is_hashed(cls, text: SecretStr) -> SecretStr:
        if not passwords.is_hash(text.get_secret_value()):
            raise ValueError("expected a hash as `apartment dashboard user NAME` makes it")
        return text


class Tls(Section):
    """The certificate that the page is served with."""

    cert: Path
    key: Path


class RobotSettings(Section):
    """One robot on the plan: the file of its points and its map."""

    places: Path


class Config(Section):
    """`name`, `home`, `cameras`, `camera_sections`, `folder` and `state` are given by the program."""

    host: str = "127.0.0.1"  # 0.0.0.0 or :: for phones and other machines
    port: int = Field(default=8088, ge=0, le=65535)  # 0: any that is free
    tls: Tls | None = None
    users: dict[str, User] = {}  # none: this machine alone may open it, without a login
    names: tuple[str, ...] = ()  # by which the page is opened, besides addresses and this machine's own name
    idle_h: float = Field(default=12.0, gt=0, le=720)  # a session that nobody used for so long has ended
    plan: Path | None = None  # rooms and where things stand in them, for the plan
    robots: dict[str, RobotSettings] = {}
    name: str = "dashboard"
    home: Home
    cameras: tuple[str, ...] = ()
    camera_sections: CameraSections = {}
    folder: Path = Path()
    state: Path | None = None

    def certificate(self) -> tuple[Path, Path] | None:
        """The files of the page's certificate and its key, if it has one; ConfigError when they cannot be used."""
        if self.tls is None:
            return None
        cert, key = self.folder / self.tls.cert, self.folder / self.tls.key
        server_context(("dashboard", "tls"), cert, key)
        return cert, key
