"""The two databases that storage runs on, as one fixture sees them: fresh and empty, with a look inside by plain SQL."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from typing import Any, Protocol

import pymysql

from services.peers import mariadb
from services.storage import Address, read_address


class Database(Protocol):
    """What a test needs of either."""

    kind: str
    address: Address

    def rows(self, statement: str, *, reader: bool = False) -> list[tuple[Any, ...]]:
        """What plain SQL gives a user whose clock is one hour ahead of UTC; `reader`: with the reader's account."""
        ...


@dataclass(frozen=True)
class Sqlite:
    """A file; its views show the local time of the process that reads, see the fixture `madrid`."""

    address: Address
    kind: str = "sqlite"

    def rows(self, statement: str, *, reader: bool = False) -> list[tuple[Any, ...]]:
        """See `Database`. There is but one kind of user."""
        with closing(sqlite3.connect(self.address.path)) as connection:
            return connection.execute(statement).fetchall()


@dataclass(frozen=True)
class MariaDb:
    """The private server, with its two databases made anew."""

    server: mariadb.Server
    address: Address
    kind: str = "mariadb"

    def rows(self, statement: str, *, reader: bool = False) -> list[tuple[Any, ...]]:
        """See `Database`."""
        server = self.server
        user, password, database = (
            (server.reader, server.reader_password, server.view_database)
            if reader
            else (server.user, server.password, server.database)
        )
        with connected(server, user, password, database) as connection, connection.cursor() as cursor:
            cursor.execute("SET time_zone='+01:00'")
            cursor.execute(statement)
            return list(cursor.fetchall())


def connected(server: mariadb.Server, user: str, password: str, database: str | None) -> Any:
    """A connection of a public client that closes at the end of its block."""
    return closing(
        pymysql.connect(
            unix_socket=str(server.socket), user=user, password=password, database=database, charset="utf8mb4"
        )
    )


def fresh_mariadb(server: mariadb.Server) -> MariaDb:
    """Both databases empty; the accounts' rights belong to the names and stay."""
    with connected(server, server.admin, "", None) as connection, connection.cursor() as cursor:
        for name in (server.database, server.view_database):
            cursor.execute(f"DROP DATABASE IF EXISTS `{name}`")
            cursor.execute(f"CREATE DATABASE `{name}` CHARACTER SET utf8mb4")
    return MariaDb(server, read_address(server.url, password=server.password))


def fresh_sqlite(folder: Path) -> Sqlite:
    """A file that does not exist yet."""
    return Sqlite(read_address("sqlite:///apartment/bus.db", folder=folder))


def shown(row: tuple[Any, ...]) -> str:
    """A row as the tables of expected answers write it: times without the day, numbers to six digits."""
    return ", ".join(_shown(value) for value in row)


def _shown(value: object) -> str:
    if isinstance(value, datetime):
        text = value.strftime("%H:%M:%S.%f").removesuffix("000").removesuffix(".000")
        return text
    if isinstance(value, float | Decimal):
        return f"{float(value):.6g}" if abs(value) < 1e6 else f"{float(value):.0f}"
    return str(value).removeprefix("2026-01-31 ")
