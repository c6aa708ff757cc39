"""Storage in one SQLite file: the embedded default. Same tables and views as on MariaDB, in the one file.

One process writes. Not for a network file system, whose locks do not hold.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, fields
from typing import Any

from services.errors import BadMessage, ConfigError, Unavailable
from services.storage import FINAL_STATES, TABLES, Address, Batch, Diagnostic, Item, Sample, SeenTurn, Sighting
from services.storage.migrate import migrate
from services.storage.sqlite_file import make_ready
from services.storage.sqlite_log import Log

BUSY_S = 5.0
SETTINGS = (
    "PRAGMA journal_mode=WAL",
    "PRAGMA synchronous=FULL",  # NORMAL can lose what was acknowledged at a power cut
    "PRAGMA wal_autocheckpoint=0",  # `Log` does it
)
UNUSABLE = {"SQLITE_CANTOPEN", "SQLITE_NOTADB", "SQLITE_READONLY", "SQLITE_CORRUPT", "SQLITE_PERM"}
# Local time as text. The fraction only where there is one: as texts, '08:00:00' comes before '08:00:00.000'.
LOCAL = (
    "datetime({0}/1000000,'unixepoch','localtime') || "
    "CASE WHEN {0}/1000%1000 THEN printf('.%03d',{0}/1000%1000) ELSE '' END"
)
VIEW_VALUES = {  # of a kind; all others show their text
    "Number": "num",
    "Dimmer": "CAST(num AS INTEGER)",
    "Rollershutter": "CAST(num AS INTEGER)",
    "DateTime": LOCAL.format("CAST(num AS INTEGER)"),
}
CONFLICT = {
    "sighting": "DO NOTHING",
    "diagnostic": "DO NOTHING",
    "camera_order": f"DO UPDATE SET error=excluded.error, state=excluded.state WHERE state NOT IN {FINAL_STATES}",
    "scan": "DO UPDATE SET state=excluded.state, found=excluded.found, frames_taken=excluded.frames_taken, "
    "frames_analysed=excluded.frames_analysed, ended=excluded.ended WHERE ended IS NULL",
    "mission": "DO UPDATE SET state=excluded.state, reason=excluded.reason, place=COALESCE(excluded.place, place), "
    "x=excluded.x, y=excluded.y, z=excluded.z, seen_by=excluded.seen_by, story=excluded.story, ended=excluded.ended "
    "WHERE ended IS NULL",
}
SAMPLE = "SELECT i.name, s.time, s.num, s.text FROM item i"
# Without the word CROSS the planner reads every sample: 400 times slower.
LAST_VALUES = (
    f"{SAMPLE} CROSS JOIN sample s ON s.item_id=i.item_id "
    "AND s.time=(SELECT MAX(time) FROM sample m WHERE m.item_id=i.item_id)"
)
# The other columns are those of the row with the maximum: a promise of SQLite alone.
LAST_DIAGNOSTICS = "SELECT component, MAX(time), level, message, details FROM diagnostic GROUP BY component"


@contextmanager
def _translated(*, opening: bool = False) -> Iterator[None]:
    """sqlite3's errors as ours; a misuse of the library is a bug and stays what it is."""
    try:
        yield
    except (sqlite3.IntegrityError, sqlite3.DataError, OverflowError) as error:
        raise BadMessage(f"the database refuses a value: {error}") from error
    except sqlite3.ProgrammingError:
        raise
    except sqlite3.DatabaseError as error:
        if opening and getattr(error, "sqlite_errorname", "") in UNUSABLE:
            raise ConfigError([f"the database cannot be used: {error}"]) from error
        raise Unavailable(f"database: {error}") from error


def open_address(address: Address) -> SqliteStorage:
    """Opens or makes the file and brings the tables up to date; see `Storage` and `open_storage`."""
    make_ready(address.path)
    with _translated(opening=True):
        storage = SqliteStorage(address)
        try:
            storage.prepare()
        except BaseException:
            storage.close()
            raise
    return storage


def open_plain(address: Address) -> SqliteStorage:
    """Opens a file of somebody else: nothing is made, checked or learnt. It must be there."""
    if not address.path.is_file():
        raise ConfigError([f"expected a database file, there is no {address.path}"])
    with _translated(opening=True):
        return SqliteStorage(address)


class SqliteStorage:
    """See `Storage` for what each method promises."""

    dialect = "sqlite"
    deadlocks = 0  # there is one writer at a time

    def __init__(self, address: Address) -> None:
        self._connection = sqlite3.connect(address.path, timeout=BUSY_S, isolation_level=None)
        self._log = Log(address.path)
        self._items: dict[str, Item] = {}

    @property
    def items(self) -> dict[str, Item]:
        """See `Storage`."""
        return self._items

    def prepare(self) -> None:
        """Sets up the connection, applies newer versions of the schema and learns the items."""
        for setting in SETTINGS:
            self._connection.execute(setting)
        with self._transaction():
            known = self._rows("SELECT 1 FROM sqlite_master WHERE name='schema_version'")
            current = self._rows("SELECT COALESCE(MAX(version), 0) FROM schema_version")[0][0] if known else 0
            migrate("sqlite", current, self._apply)
        self._load_items()

    def add_items(self, items: Iterable[Item]) -> None:
        """See `Storage`."""
        with _translated():
            with self._transaction():
                for item in items:
                    self._add_item(item)
            self._load_items()

    def write(self, batch: Batch) -> None:
        """See `Storage`."""
        items = self._items
        with _translated(), self._transaction():
            self._connection.executemany(
                "INSERT INTO sample VALUES (?, ?, ?, ?) ON CONFLICT DO NOTHING",
                ((items[sample.item].item_id, sample.time, sample.num, sample.text) for sample in batch.samples),
            )
            for row in batch.rows:
                self._connection.execute(INSERT[TABLES[type(row)]], astuple(row))
            if batch.seen is not None:
                self._connection.execute("REPLACE INTO mqtt_seen VALUES (?, ?, ?, ?)", astuple(batch.seen))
        self._log.grown(len(batch.samples) + len(batch.rows))

    def read(self, statement: str) -> list[tuple[Any, ...]]:
        """See `Storage`."""
        with _translated():
            return self._rows(statement)

    def change(self, *statements: str) -> int:
        """See `Storage`."""
        changed = 0
        with _translated(), self._transaction():
            for statement in statements:
                changed = self._connection.execute(statement).rowcount
        self._log.grown(changed)
        return changed

    def seen(self, client: str) -> list[SeenTurn]:
        """See `Storage`."""
        with _translated():
            return [SeenTurn(*row) for row in self._rows("SELECT * FROM mqtt_seen WHERE client=?", client)]

    def note(self, client: str, name: str, value: int) -> None:
        """See `Storage`."""
        names = f"{self.quote(client)},{self.quote(name)}"
        self.change(f"REPLACE INTO mqtt_noted VALUES ({names},{int(value)})")

    def noted(self, client: str, name: str) -> int | None:
        """See `Storage`."""
        where = f"client={self.quote(client)} AND name={self.quote(name)}"
        found = self.read(f"SELECT value FROM mqtt_noted WHERE {where}")
        return int(found[0][0]) if found else None

    def quote(self, text: str) -> str:
        """See `Storage`."""
        return "'" + text.replace("'", "''").replace("\0", "'||char(0)||'") + "'"

    def remake_views(self) -> None:
        """See `Storage`."""
        with _translated(), self._transaction():
            for item in self._items.values():
                self._make_view(item, item.item_id)

    def last(self, item: str) -> Sample | None:
        """See `Storage`."""
        found = self.samples(item, limit=1)
        return found[0] if found else None

    def last_values(self) -> dict[str, Sample]:
        """See `Storage`."""
        with _translated():
            return {row[0]: Sample(*row) for row in self._rows(LAST_VALUES)}

    def last_diagnostics(self) -> dict[str, Diagnostic]:
        """See `Storage`."""
        with _translated():
            return {row[0]: Diagnostic(*row) for row in self._rows(LAST_DIAGNOSTICS)}

    def samples(
        self, item: str, *, since: int | None = None, until: int | None = None, limit: int | None = None
    ) -> list[Sample]:
        """See `Storage`."""
        wanted: dict[str, int | None] = {"s.time>=?": since, "s.time<?": until}
        bounds = {condition: bound for condition, bound in wanted.items() if bound is not None}
        where = " AND ".join(["i.name=?", *bounds])
        with _translated():
            rows = self._rows(
                f"{SAMPLE} CROSS JOIN sample s ON s.item_id=i.item_id WHERE {where} ORDER BY s.time DESC LIMIT ?",
                item, *bounds.values(), -1 if limit is None else limit,
            )  # fmt: skip
        return [Sample(*row) for row in reversed(rows)]

    def sightings(self, marker: int, limit: int) -> list[Sighting]:
        """See `Storage`."""
        columns = ", ".join(field.name for field in fields(Sighting))
        with _translated():
            rows = self._rows(
                f"SELECT {columns} FROM sighting WHERE marker=? ORDER BY stamp DESC LIMIT ?", marker, limit
            )
        return [Sighting(*row) for row in rows]

    def close(self) -> None:
        """See `Storage`."""
        self._log.close()
        self._connection.close()

    # -- inside

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        finally:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")

    def _rows(self, statement: str, *values: Any) -> list[tuple[Any, ...]]:
        return self._connection.execute(statement, values).fetchall()

    def _apply(self, version: int, script: list[str]) -> None:
        for statement in script:
            self._connection.execute(statement)
        self._connection.execute("INSERT INTO schema_version VALUES (?, ?, '')", (version, time.time_ns() // 1000))

    def _load_items(self) -> None:
        rows = self._rows("SELECT name, kind, unit, item_id FROM item")
        self._items = {row[0]: Item(*row) for row in rows}

    def _add_item(self, item: Item) -> None:
        """The kind follows, and the unit stays once it is known; the view is made anew."""
        ((item_id,),) = self._rows(
            "INSERT INTO item (name, kind, unit) VALUES (?, ?, ?) ON CONFLICT DO UPDATE SET kind=excluded.kind, "
            "unit=COALESCE(unit, excluded.unit) RETURNING item_id",
            item.name, item.kind, item.unit,
        )  # fmt: skip
        self._make_view(item, item_id)

    def _make_view(self, item: Item, item_id: int) -> None:
        value = VIEW_VALUES.get(item.kind, "text")
        shown = "num IS NOT NULL" if item.kind in VIEW_VALUES else "text NOT IN ('UNDEF','NULL')"
        self._connection.execute(f'DROP VIEW IF EXISTS "Item{item_id}"')
        self._connection.execute(
            f'CREATE VIEW "Item{item_id}" AS SELECT {LOCAL.format("time")} AS Time, {value} AS Value '
            f"FROM sample WHERE item_id={item_id} AND {shown}"
        )


def _insert(row: type[Any], table: str) -> str:
    columns = [field.name for field in fields(row)]
    marks = ", ".join("?" * len(columns))
    return f"INSERT INTO {table} ({', '.join(columns)}) VALUES ({marks}) ON CONFLICT {CONFLICT[table]}"


INSERT = {table: _insert(row, table) for row, table in TABLES.items()}
