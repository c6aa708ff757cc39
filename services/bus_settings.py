"""The section `bus` of the configuration: where the broker is, who we are there, and the certificates of both.

Not here: the connection (`bus/connection.py`).
"""

from __future__ import annotations

import ssl
from pathlib import Path

from pydantic import Field, PrivateAttr, SecretStr

from services import document
from services.errors import ConfigError
from services.section import Section
from services.tls import client_context


class Tls(Section):
    """Certificates: `ca` checks the broker; `cert` and `key` show who we are, where the broker asks for it."""

    ca: Path
    cert: Path | None = None
    key: Path | None = None
    _file: Path | None = PrivateAttr(default=None)  # of the configuration

    def named_in(self, file: Path) -> Tls:
        """As that configuration means them: relative paths start from its folder, faults are told with its lines."""
        made = self.model_copy(update={name: file.parent / path for name, path in self if path is not None})
        made._file = file
        return made

    def context(self) -> ssl.SSLContext:
        """What a connection is made with; ConfigError when a file cannot be used."""
        try:
            return client_context(("bus", "tls"), self.ca, self.cert, self.key)
        except ConfigError as error:
            if self._file is None:
                raise
            raise ConfigError(document.read(self._file).placed(error.faults)) from error


class BusSettings(Section):
    """Where the broker is, and the account of each service there (none: anonymous)."""

    host: str = "127.0.0.1"
    port: int = Field(default=1883, ge=1, le=65535)
    tls: Tls | None = None
    accounts: dict[str, SecretStr] = {}
    keepalive_s: int = Field(default=15, ge=5, le=600)

    def named_in(self, file: Path) -> BusSettings:
        """With the certificates as that configuration means them."""
        return self if self.tls is None else self.model_copy(update={"tls": self.tls.named_in(file)})

    def faults(self) -> tuple[str, ...]:
        """Those of the files that it names."""
        try:
            if self.tls is not None:
                self.tls.context()
        except ConfigError as error:
            return error.faults
        return ()
