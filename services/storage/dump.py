"""All that is stored as lines of JSON, and back: the same for MariaDB and SQLite, so that one moves to the other.

Not here: where the lines go, `services/backup.py`. What keeps redelivered messages apart is left out: those of the past
do not come again.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from services.storage import Storage
from services.storage.reading import DIALECTS

PIECE = 1000  # rows read, and written in a transaction, at once
LONG = 4_000_000  # characters of such a transaction; a server takes 16 MiB at once


@dataclass(frozen=True)
class Table:
    """A table: its columns, which of them are times, and by which it is gone through."""

    name: str
    columns: tuple[str, ...]
    key: tuple[str, ...]
    times: tuple[str, ...] = ()


TABLES = (
    Table("item", ("item_id", "name", "kind", "unit"), ("item_id",)),
    Table("sample", ("item_id", "time", "num", "text"), ("item_id", "time"), ("time",)),
    Table("summary", ("item_id", "width", "start", "n", "lo", "mean", "hi", "last"), ("item_id", "width", "start")),
    Table(
        "sighting",
        ("sighting_id", "scan", "camera", "marker", "dictionary", "place", "stamp", "first_seen", "x", "y", "z",
         "qx", "qy", "qz", "qw", "sx", "sy", "sz", "distance", "zoom", "frames", "mode", "why"),
        ("sighting_id",),
        ("stamp", "first_seen"),
    ),
    Table(
        "scan",
        ("scan", "camera", "state", "targets", "found", "started", "ended", "frames_taken", "frames_analysed"),
        ("scan",),
        ("started", "ended"),
    ),
    Table(
        "mission",
        ("mission", "robot", "marker", "state", "reason", "place", "x", "y", "z", "seen_by", "started", "ended",
         "story"),
        ("robot", "mission", "started"),
        ("started", "ended"),
    ),
    Table(
        "camera_order",
        ("order_id", "camera", "name", "value", "state", "error", "at"),
        ("camera", "order_id", "at"),
        ("at",),
    ),
    Table("diagnostic", ("component", "time", "level", "message", "details"), ("component", "time"), ("time",)),
)  # fmt: skip
NAMES = {"mysql": "SHOW TABLES", "sqlite": "SELECT name FROM sqlite_master"}  # of the tables that there are
BY_NAME = {table.name: table for table in TABLES}


def lines(storage: Storage) -> Iterator[str]:
    """Every row as `["table", value, ...]`; times are microseconds since 1970, UTC."""
    for table in TABLES:
        for row in _rows(storage, table):
            yield json.dumps([table.name, *row], ensure_ascii=False)


def _rows(storage: Storage, table: Table) -> Iterator[tuple[Any, ...]]:
    """In pieces, each after the last key of the one before: a year's samples do not fit into the memory."""
    micro = DIALECTS[storage.dialect].micro
    read = ", ".join(micro.format(name) if name in table.times else f"`{name}`" for name in table.columns)
    order, where = ", ".join(f"`{name}`" for name in table.key), ""
    while rows := storage.read(f"SELECT {read} FROM {table.name} {where} ORDER BY {order} LIMIT {PIECE}"):
        yield from rows
        last = dict(zip(table.columns, rows[-1], strict=True))
        where = f"WHERE {_after([(f'`{name}`', _literal(storage, table, name, last[name])) for name in table.key])}"


def _after(keys: list[tuple[str, str]]) -> str:
    """The rows behind a key, in words that both databases follow along the index."""
    (name, value), *more = keys
    return f"({name}>={value} AND ({name}>{value} OR {_after(more)}))" if more else f"{name}>{value}"


def occupied(storage: Storage) -> str | None:
    """A table that has rows; None where there are none, or no tables yet. For who opened it by `open_plain`, too."""
    there = {str(row[0]) for row in storage.read(NAMES[storage.dialect])}
    named = (table.name for table in TABLES if table.name in there)
    return next((name for name in named if storage.read(f"SELECT 1 FROM {name} LIMIT 1")), None)


def put_back(storage: Storage, source: Iterable[str]) -> dict[str, int]:
    """Writes the rows of such lines into a database that has none; how many of each table."""
    counted: dict[str, int] = {}
    waiting: list[str] = []
    now, length = TABLES[0], 0
    for line in source:
        name, *values = json.loads(line)
        table = BY_NAME[name]
        if waiting and (table is not now or len(waiting) == PIECE or length > LONG):
            _insert(storage, now, waiting)
            waiting, length = [], 0
        now, length = table, length + len(line)
        row = zip(table.columns, values, strict=True)
        waiting.append("(" + ", ".join(_literal(storage, table, column, value) for column, value in row) + ")")
        counted[name] = counted.get(name, 0) + 1
    if waiting:
        _insert(storage, now, waiting)
    return counted


def _insert(storage: Storage, table: Table, rows: list[str]) -> None:
    columns = ", ".join(f"`{name}`" for name in table.columns)
    storage.change(f"INSERT INTO {table.name} ({columns}) VALUES {', '.join(rows)}")


def _literal(storage: Storage, table: Table, column: str, value: Any) -> str:
    if value is None:
        return "NULL"
    if column in table.times:
        return DIALECTS[storage.dialect].at(int(value))
    if isinstance(value, str):
        return storage.quote(value)
    return repr(value)
