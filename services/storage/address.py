"""Where a database is, from one URL: `sqlite:///home.db`, `mysql://user@host:3306/bus`, `mysql://user@localhost/bus?socket=...`."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from services.errors import ConfigError

DATABASE_NAME = re.compile(r"[A-Za-z0-9_]{1,64}")  # it goes into SQL, so no quoting games
OPTIONS = ("socket", "ssl_ca")
FORMS = "sqlite:///FILE, mysql://USER@HOST[:PORT]/DATABASE or mysql://USER@localhost/DATABASE?socket=PATH"


@dataclass(frozen=True)
class Address:
    """A database; `path` for SQLite, the rest for MariaDB and MySQL. `ssl_ca`: TLS, with the server's name checked."""

    dialect: Literal["sqlite", "mysql"]
    path: Path = Path()
    host: str = "localhost"
    port: int = 3306
    user: str = ""
    password: str | None = field(default=None, repr=False)
    database: str = ""
    socket: str | None = None
    ssl_ca: str | None = None
    view_database: str = "OpenHAB"

    def __str__(self) -> str:
        if self.dialect == "sqlite":
            return str(self.path)
        return f"{self.database} at {self.socket or f'{self.host}:{self.port}'}"


def read_address(
    url: str, *, password: str | None = None, view_database: str = "OpenHAB", folder: Path = Path()
) -> Address:
    """The address of a URL; ConfigError says what is wrong with it.

    Three slashes and a name are a file relative to `folder`, four an absolute one, as elsewhere.
    """
    parts = urlsplit(url)
    if parts.scheme == "sqlite":
        return _sqlite(parts, folder)
    if parts.scheme == "mysql":
        return _mysql(parts, password, view_database)
    raise ConfigError([f"url: expected {FORMS}, got {_shown(url)!r}"])


def _shown(url: str) -> str:
    return re.sub(r":[^/@]*@", ":...@", url)[:200]


def _sqlite(parts: SplitResult, folder: Path) -> Address:
    name = unquote(parts.path[1:])
    if parts.netloc or not name or parts.query:
        raise ConfigError([f"url: expected sqlite:///FILE, got {_shown(parts.geturl())!r}"])
    return Address("sqlite", path=folder / name)


def _mysql(parts: SplitResult, password: str | None, view_database: str) -> Address:
    options = dict(parse_qsl(parts.query))
    database = parts.path[1:]
    faults = [
        *(f"url: expected one of {', '.join(OPTIONS)}, got {key!r}" for key in options if key not in OPTIONS),
        *(
            f"{key}: expected a name of letters, digits and _, got {name!r}"
            for key, name in (("url", database), ("view_database", view_database))
            if not DATABASE_NAME.fullmatch(name)
        ),
    ]
    if not parts.username:
        faults.append(f"url: expected {FORMS}, got no user in {_shown(parts.geturl())!r}")
    if parts.password is not None:
        faults.append("url: expected no password there; give it as `password`")
    if database == view_database:
        faults.append(
            f"view_database: expected another database than {database!r}, so that a reader needs that one only"
        )
    if faults:
        raise ConfigError(faults)
    return Address(
        "mysql", host=parts.hostname or "localhost", port=_port(parts), user=unquote(parts.username or ""),
        password=password, database=database, view_database=view_database,
        socket=options.get("socket"), ssl_ca=options.get("ssl_ca"),
    )  # fmt: skip


def _port(parts: SplitResult) -> int:
    try:
        return parts.port or 3306
    except ValueError as error:
        raise ConfigError([f"url: expected a port from 1 to 65535, got {parts.netloc.rpartition(':')[2]!r}"]) from error
