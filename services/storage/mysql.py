"""Storage on MariaDB and MySQL. The only file that knows pymysql; its errors become ours in `_translated`.

The base tables are in one database, views with OpenHAB's layout in a second one, so that a reader needs rights on
that one only. Each connection speaks UTC; readers see their own time zone. The SQL is in `mysql_text.py`.
"""

from __future__ import annotations

import logging
import random
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import pymysql
from pymysql import err

from services.errors import BadMessage, ConfigError, Unavailable
from services.storage import Address, Batch, Diagnostic, Item, Sample, SeenTurn, Sighting
from services.storage import mysql_text as sql
from services.storage.migrate import migrate

log = logging.getLogger(__name__)

CONNECT_TIMEOUT_S = 5
ANSWER_TIMEOUT_S = 30  # without one a pulled cable would hang for ever
SESSION = "SET time_zone='+00:00', innodb_lock_wait_timeout=5"
# A lock that waited too long; a transaction chosen to give way (at COMMIT with Galera); the same of TiDB.
DEADLOCK = {1205, 1213, 8022, 9007}
DEADLOCK_PAUSE_S = (0.01, 0.1)
DEADLOCK_TRIES = 5
NO_ACCESS = {1044, 1045, 1049, 1142, 1227, 1698}  # no rights, wrong password, no such database
BAD_VALUE = {1048, 1264, 1265, 1292, 1366, 1367, 1406, 1441}  # NULL, out of range, bad time, bad text, too long


@contextmanager
def _translated(*, opening: bool = False) -> Iterator[None]:
    """pymysql's errors as ours; what is neither away nor a bad value is a bug and stays what it is."""
    try:
        yield
    except (err.OperationalError, err.InterfaceError, err.InternalError, err.DataError, err.IntegrityError) as error:
        code = error.args[0] if error.args else 0
        text = " ".join(str(part) for part in error.args)[:300]
        if code in BAD_VALUE or isinstance(error, err.DataError | err.IntegrityError):
            raise BadMessage(f"the database refuses a value: {text}") from error
        if opening and code in NO_ACCESS:
            raise ConfigError([f"the database cannot be used: {text}"]) from error
        raise Unavailable(f"database: {text}") from error


def open_address(address: Address) -> MysqlStorage:
    """Connects and brings the tables up to date; see `Storage` and `open_storage`."""
    with _translated(opening=True):
        storage = MysqlStorage(address, _connect(address))
        try:
            storage.prepare()
        except BaseException:
            storage.close()
            raise
    return storage


def open_plain(address: Address) -> MysqlStorage:
    """Connects to a database of somebody else, or as its administrator: nothing is made, checked or learnt."""
    with _translated(opening=True):
        return MysqlStorage(address, _connect(address))


def _connect(address: Address) -> pymysql.Connection[Any]:
    tls: dict[str, Any] = {}
    if address.ssl_ca:
        tls = {"ssl_ca": address.ssl_ca, "ssl_verify_cert": True, "ssl_verify_identity": True}
    return pymysql.connect(
        host=address.host, port=address.port, unix_socket=address.socket, user=address.user,
        password=address.password or "", database=address.database or None, charset="utf8mb4", init_command=SESSION,
        autocommit=False, local_infile=False, connect_timeout=CONNECT_TIMEOUT_S, read_timeout=ANSWER_TIMEOUT_S,
        write_timeout=ANSWER_TIMEOUT_S, **tls,
    )  # fmt: skip


class MysqlStorage:
    """See `Storage` for what each method promises."""

    dialect = "mysql"

    def __init__(self, address: Address, connection: pymysql.Connection[Any]) -> None:
        self._address = address
        self._connection = connection
        self._items: dict[str, Item] = {}
        self.deadlocks = 0

    @property
    def items(self) -> dict[str, Item]:
        """See `Storage`."""
        return self._items

    def add_items(self, items: Iterable[Item]) -> None:
        """See `Storage`. DDL commits what is open, so this is never part of a batch's transaction."""
        changed = [item for item in items if _differs(item, self._items.get(item.name))]
        if not changed:
            return
        with _translated():
            self._connection.query(sql.insert_items(changed, self._connection.escape))
            self._connection.commit()
            self._load_items()
            for item in changed:
                self._make_view(self._items[item.name])

    def write(self, batch: Batch) -> None:
        """See `Storage`. A deadlock repeats the whole transaction."""
        self.change(*sql.inserts(batch, self._items, self._connection.escape))

    def change(self, *statements: str) -> int:
        """See `Storage`. A deadlock, or a lock that waited too long, repeats the whole transaction."""
        for attempt in range(1, DEADLOCK_TRIES + 1):
            try:
                with _translated():
                    return self._transaction(statements)
            except Unavailable as error:
                if attempt == DEADLOCK_TRIES or not _is_deadlock(error):
                    raise
                self.deadlocks += 1
                time.sleep(random.uniform(*DEADLOCK_PAUSE_S))
        raise AssertionError("the last attempt raises or returns")

    def read(self, statement: str) -> list[tuple[Any, ...]]:
        """See `Storage`."""
        with _translated():
            return self._rows(statement)

    def seen(self, client: str) -> list[SeenTurn]:
        """See `Storage`."""
        escaped = self._connection.escape(client)
        return [SeenTurn(*row) for row in self.read(f"SELECT {sql.SEEN} FROM mqtt_seen WHERE client={escaped}")]

    def note(self, client: str, name: str, value: int) -> None:
        """See `Storage`."""
        names = f"{self.quote(client)},{self.quote(name)}"
        self.change(f"INSERT INTO mqtt_noted VALUES ({names},{int(value)}) ON DUPLICATE KEY UPDATE value=VALUES(value)")

    def noted(self, client: str, name: str) -> int | None:
        """See `Storage`."""
        where = f"client={self.quote(client)} AND name={self.quote(name)}"
        found = self.read(f"SELECT value FROM mqtt_noted WHERE {where}")
        return int(found[0][0]) if found else None

    def quote(self, text: str) -> str:
        """See `Storage`."""
        return self._connection.escape(text)

    def remake_views(self) -> None:
        """See `Storage`."""
        with _translated():
            self._connection.query(sql.items_view(self._address.database, self._address.view_database))
            for item in self._items.values():
                self._make_view(item)

    def last(self, item: str) -> Sample | None:
        """See `Storage`."""
        found = self.samples(item, limit=1)
        return found[0] if found else None

    def last_values(self) -> dict[str, Sample]:
        """See `Storage`."""
        return {row[0]: Sample(*row) for row in self.read(sql.LAST_VALUES)}

    def last_diagnostics(self) -> dict[str, Diagnostic]:
        """See `Storage`."""
        return {row[0]: Diagnostic(*row) for row in self.read(sql.LAST_DIAGNOSTICS)}

    def samples(
        self, item: str, *, since: int | None = None, until: int | None = None, limit: int | None = None
    ) -> list[Sample]:
        """See `Storage`."""
        rows = self.read(sql.samples(item, since, until, limit, self._connection.escape))
        return [Sample(*row) for row in reversed(rows)]

    def sightings(self, marker: int, limit: int) -> list[Sighting]:
        """See `Storage`."""
        return [Sighting(*row) for row in self.read(sql.sightings(marker, limit))]

    def close(self) -> None:
        """See `Storage`."""
        if self._connection.open:
            self._connection.close()

    # -- the connection

    def _transaction(self, statements: Iterable[str]) -> int:
        """All or nothing: a lock that waited too long leaves the transaction open, with half a batch in it."""
        try:
            changed = 0
            for statement in statements:
                changed = self._connection.query(statement)
            self._connection.commit()
            return changed
        except (err.DataError, err.IntegrityError, err.OperationalError):
            if self._connection.open:
                self._connection.rollback()
            raise

    def _rows(self, statement: str) -> list[tuple[Any, ...]]:
        """What a query gives; the snapshot that it opened is ended again."""
        with self._connection.cursor() as cursor:
            cursor.execute(statement)
            rows = list(cursor.fetchall())
        self._connection.rollback()
        return rows

    # -- at the start

    def prepare(self) -> None:
        """Checks the server, applies newer versions of the schema, learns the items and makes missing views."""
        self._check()
        known = self._rows("SHOW TABLES LIKE 'schema_version'")
        current = self._rows("SELECT COALESCE(MAX(version), 0) FROM schema_version")[0][0] if known else 0
        migrate("mysql", current, self._apply)
        self._load_items()
        self._make_missing_views()

    def _check(self) -> None:
        ((charset, explicit, flush),) = self._rows(
            "SELECT default_character_set_name, @@explicit_defaults_for_timestamp, @@innodb_flush_log_at_trx_commit "
            "FROM information_schema.schemata WHERE schema_name=DATABASE()"
        )
        faults = []
        if charset != "utf8mb4":
            faults.append(f"database {self._address.database}: expected character set utf8mb4, got {charset}")
        if not int(explicit):
            faults.append("database: expected explicit_defaults_for_timestamp=ON, got OFF, which moves old rows to now")
        if faults:
            raise ConfigError(faults)
        if int(flush) != 1:
            log.warning("innodb_flush_log_at_trx_commit is %s: a power cut can lose what was acknowledged", flush)

    def _apply(self, version: int, script: list[str]) -> None:
        for statement in script:
            self._connection.query(statement)
        self._connection.query(
            f"INSERT INTO schema_version VALUES ({version}, NOW(6), '') ON DUPLICATE KEY UPDATE note=note"
        )
        self._connection.commit()

    def _load_items(self) -> None:
        rows = self._rows("SELECT name, kind, unit, item_id FROM item")
        self._items = {row[0]: Item(*row) for row in rows}

    def _make_missing_views(self) -> None:
        views = self._address.view_database
        there = dict(self._rows(f"SHOW FULL TABLES IN `{views}`"))
        wanted = ["Items", *map(sql.view_name, self._items.values())]
        if taken := [name for name in wanted if there.get(name) == "BASE TABLE"]:
            raise ConfigError([f"view_database: {views}.{name} is a table of somebody else" for name in taken])
        if "Items" not in there:
            self._connection.query(sql.items_view(self._address.database, views))
        for item in self._items.values():
            if sql.view_name(item) not in there:
                self._make_view(item)

    def _make_view(self, item: Item) -> None:
        self._connection.query(sql.item_view(item, self._address.database, self._address.view_database))


def _differs(wanted: Item, known: Item | None) -> bool:
    """Whether the database has to be told: the item is new, of another kind, or has got its unit."""
    if known is None:
        return True
    return wanted.kind != known.kind or (known.unit is None and wanted.unit is not None)


def _is_deadlock(error: Unavailable) -> bool:
    cause = error.__cause__
    return isinstance(cause, err.MySQLError) and bool(cause.args) and cause.args[0] in DEADLOCK
