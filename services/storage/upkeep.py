"""What an administrator does: make databases and accounts, take versions of the schema back, look whether all is well.

Accounts are made on MariaDB and MySQL alone; a SQLite file has none.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from services.errors import ConfigError
from services.storage import Address, Storage, ahead, migrate, open_plain, open_storage, reading, schema_version
from services.storage.migrate import back, versions
from services.storage.sqlite_file import look_at_rights

RIGHTS = "SELECT, INSERT, UPDATE, DELETE, CREATE, ALTER, DROP, INDEX"
READING = {"": "SELECT"}  # by table; "": all of them
KEEPING = {"": "SELECT", "sample": "DELETE", "summary": "INSERT, UPDATE, DELETE"}
ASKS = ("SELECT 1 FROM item LIMIT 0", "SELECT 1 FROM sample LIMIT 0", "SELECT 1 FROM summary LIMIT 0")
KEEPS = (*ASKS, "DELETE FROM sample WHERE 1=0", "DELETE FROM summary WHERE 1=0", "UPDATE summary SET n=n WHERE 1=0")
VIEW_RIGHTS = "SELECT, CREATE VIEW, SHOW VIEW, DROP"
ACCOUNT = re.compile(r"[A-Za-z0-9_-]{1,32}")
HOST = re.compile(r"[A-Za-z0-9_.:%/-]{1,255}")
ZONES = "mariadb-tzinfo-to-sql /usr/share/zoneinfo | sudo mariadb mysql"
SOCKETS = ("/run/mysqld/mysqld.sock", "/var/lib/mysql/mysql.sock")  # Debian, others: the administrator comes by it
LOCAL = ("localhost", "127.0.0.1", "::1")


def administrator(address: Address, user: str, password: str | None) -> Address:
    """The same server, as somebody who may make databases and accounts; without a password by the server's socket."""
    if address.dialect == "sqlite":
        raise ConfigError(["a SQLite file has no accounts: who may read the file may read all of it"])
    socket = address.socket
    if password is None and socket is None and address.host in LOCAL:
        socket = next((path for path in SOCKETS if Path(path).exists()), None)
    return replace(address, user=user, password=password, database="", socket=socket)


def make_databases(address: Address, admin: Address) -> None:
    """Both databases in UTF-8 and the writer's account, with the password of `address`; what else is there stays."""
    with closing(open_plain(admin)) as server:
        account = _account(server, address)
        for name in (address.database, address.view_database):
            server.change(f"CREATE DATABASE IF NOT EXISTS `{name}` CHARACTER SET utf8mb4")
        server.change(
            *_with_password(server, account, address.password),
            f"GRANT {RIGHTS} ON `{address.database}`.* TO {account}",
            f"GRANT {VIEW_RIGHTS} ON `{address.view_database}`.* TO {account}",
        )


def make_account(address: Address, admin: Address, rights: Mapping[str, str]) -> None:
    """An account of a service's own, by what it may do to which table, and nothing else. The tables are there."""
    with closing(open_plain(admin)) as server:
        account = _account(server, address)
        server.change(*_with_password(server, account, address.password))
        for table, what in rights.items():
            server.change(f"GRANT {what} ON `{address.database}`.{f'`{table}`' if table else '*'} TO {account}")


def let_read(address: Address, admin: Address, reader: str, password: str, host: str = "localhost") -> None:
    """An account that may read the views with OpenHAB's layout and nothing else; from elsewhere by TLS alone."""
    with closing(open_plain(admin)) as server:
        account = f"{server.quote(_checked(ACCOUNT, reader))}@{server.quote(_checked(HOST, host))}"
        encrypted = "NONE" if host in LOCAL else "SSL"
        server.change(
            *_with_password(server, account, password),
            f"ALTER USER {account} REQUIRE {encrypted}",
            f"GRANT SELECT ON `{address.view_database}`.* TO {account}",
        )


def _with_password(server: Storage, account: str, password: str | None) -> Iterator[str]:
    """An account, made or there already, that comes by this password from now on; without one it stays as it is."""
    secret = server.quote(password or "")
    yield f"CREATE USER IF NOT EXISTS {account} IDENTIFIED BY {secret}"
    if password is not None:
        yield f"ALTER USER {account} IDENTIFIED BY {secret}"


def _account(server: Storage, address: Address) -> str:
    """The user of an address, as the server names him."""
    host = "localhost" if address.socket or address.host in LOCAL else "%"
    return f"{server.quote(_checked(ACCOUNT, address.user))}@{server.quote(host)}"


def _checked(form: re.Pattern[str], text: str) -> str:
    if not form.fullmatch(text):
        raise ConfigError([f"expected a name of letters, digits, _ and -, got {text!r}"])
    return text


def take_back(address: Address, to: int) -> int:
    """From the newest version of the schema to an older one; the version before. The next to open it brings it up."""
    newest = max(versions(address.dialect))
    if not 1 <= to <= newest:
        raise ConfigError([f"expected a version from 1 to {newest}, got {to}"])
    with closing(open_storage(address)) as storage:
        before = schema_version(storage)
        for number, script in list(back(address.dialect, before, to)):
            storage.change(*script, f"DELETE FROM schema_version WHERE version={number}")
    return before


def look(address: Address) -> Iterator[tuple[bool, str]]:
    """Whether each thing is well, and what it is. What cannot be used at all comes out as ConfigError.

    Nothing is made, and nothing brought up to date: that is the writer's.
    """
    if address.dialect == "sqlite" and not address.path.exists():
        yield True, f"no file {address.path} yet: the first who writes makes it"
        return
    with closing(open_plain(address)) as storage:
        found, newest = schema_version(storage), max(versions(address.dialect))
        if found > newest:
            raise migrate.too_new(found, newest)
        yield True, f"schema version {found}, {'the newest' if found == newest else f'the writer makes it {newest}'}"
        if found:
            yield True, f"{len(reading.items(storage))} items"
            yield _look_at_times(storage, time.time())
        yield from _look_at_server(storage) if storage.dialect == "mysql" else _look_at_file(storage)


def tried(address: Address, statements: Iterable[str]) -> None:
    """Does what changes nothing, of ASKS or KEEPS; ConfigError or Unavailable when this user may not."""
    with closing(open_plain(address)) as storage:
        for statement in statements:
            if statement.startswith("SELECT"):
                storage.read(statement)
            else:
                storage.change(statement)


def _look_at_times(storage: Storage, now: float) -> tuple[bool, str]:
    _, odd = ahead.last_values(storage, now)
    told = ", ".join(f"{one.item} ({datetime.fromtimestamp(one.time / 1e6, UTC):%Y-%m-%dT%H:%M:%SZ})" for one in odd)
    return not odd, f"rows whose time has not come, which nobody goes by: {told or 'none'}"


def _look_at_file(storage: Storage) -> Iterator[tuple[bool, str]]:
    yield look_at_rights(Path(storage.read("PRAGMA database_list")[0][2]))
    ((told,),) = storage.read("PRAGMA quick_check(1)")
    yield told == "ok", f"the file: {told}"
    ((mode,),) = storage.read("PRAGMA journal_mode")
    yield mode == "wal", f"journal mode {mode}"


def _look_at_server(storage: Storage) -> Iterator[tuple[bool, str]]:
    ((server, flush, binlog, sync, mode, packet, zone, charset, explicit),) = storage.read(
        "SELECT @@version, @@innodb_flush_log_at_trx_commit, @@log_bin, @@sync_binlog, @@sql_mode, "
        "@@max_allowed_packet, CONVERT_TZ('2026-01-31 07:00:00', 'UTC', 'Europe/Madrid'), @@character_set_database, "
        "@@explicit_defaults_for_timestamp"
    )
    yield True, f"server {server}"
    yield charset == "utf8mb4", f"character set {charset} (utf8mb4)"
    yield bool(int(explicit)), f"explicit_defaults_for_timestamp={explicit} (1: old rows keep their times)"
    yield int(flush) == 1, f"innodb_flush_log_at_trx_commit={flush} (1: a commit is on the disk before it is answered)"
    yield not int(binlog) or int(sync) == 1, f"binary log {'on' if int(binlog) else 'off'}, sync_binlog={sync}"
    yield "STRICT_TRANS_TABLES" in str(mode), f"sql_mode {mode}"
    yield int(packet) >= 16 * 1024 * 1024, f"max_allowed_packet={packet} (16 MiB or more)"
    yield (
        zone is not None,
        f"named time zones are {'there' if zone else f'missing: {ZONES}'}",
    )
