"""The keys of a configuration that say where the database is: the same for whoever writes it and whoever reads it."""

from __future__ import annotations

from pathlib import Path

from pydantic import SecretStr, field_validator

from services.errors import ConfigError
from services.section import Section
from services.storage.address import Address, read_address


class DatabaseSection(Section):
    """A section with a database; `folder` is what a relative file name starts from."""

    url: str  # sqlite:///FILE, mysql://USER@HOST:PORT/DATABASE or mysql://USER@localhost/DATABASE?socket=PATH
    password: SecretStr | None = None  # of the database's user
    view_database: str = "OpenHAB"  # where the views with OpenHAB's layout go (MariaDB, MySQL)
    folder: Path = Path()

    @field_validator("url")
    @classmethod
    def is_an_address(cls, url: str) -> str:
        try:
            read_address(url)
        except ConfigError as error:
            raise ValueError("; ".join(fault.removeprefix("url: ") for fault in error.faults)) from error
        return url

    @property
    def address(self) -> Address:
        """Where the database is."""
        password = self.password.get_secret_value() if self.password else None
        return read_address(self.url, password=password, view_database=self.view_database, folder=self.folder)
