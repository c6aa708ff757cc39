"""The SQL of MariaDB and MySQL as text, from values. Not here: who sends it (`mysql.py`).

INSERTs are built by hand: twice as fast as a driver's executemany (one statement for thousands of rows, and no
parsing of it in Python). A row that is there already is handled by ON DUPLICATE KEY, never by INSERT IGNORE, which
would swallow bad values as well.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields
from functools import lru_cache
from operator import attrgetter
from typing import Any

from services.storage import FINAL_STATES, TABLES, TIMES, Batch, Item

Escape = Callable[[str], str]  # the connection's: a text with its quotes
PACKET = 4 * 1024 * 1024  # characters of SQL in one statement; the server takes 16 MiB
VIEW_VALUES = {  # of a kind; all others show their text
    "Number": "num",
    "Dimmer": "CAST(num AS SIGNED)",
    "Rollershutter": "CAST(num AS SIGNED)",
    "DateTime": "FROM_UNIXTIME(num*0.000001)",
}
_FINAL = f"state IN {FINAL_STATES}"
_OPEN_SCAN = ("state", "found", "frames_taken", "frames_analysed")
_OPEN_MISSION = ("state", "reason", "x", "y", "z", "seen_by", "story")
DUPLICATE = {  # MariaDB assigns from left to right, so the column that decides comes last
    "sample": "num=num",
    "sighting": "marker=marker",
    "diagnostic": "level=level",
    "camera_order": f"error=IF({_FINAL},error,VALUES(error)), state=IF({_FINAL},state,VALUES(state))",
    "scan": ", ".join(f"{name}=IF(ended IS NULL,VALUES({name}),{name})" for name in _OPEN_SCAN)
    + ", ended=COALESCE(ended,VALUES(ended))",
    "mission": ", ".join(f"{name}=IF(ended IS NULL,VALUES({name}),{name})" for name in _OPEN_MISSION)
    + ", place=IF(ended IS NULL,COALESCE(VALUES(place),place),place), ended=COALESCE(ended,VALUES(ended))",
}
COLUMNS = {table: tuple(field.name for field in fields(row)) for row, table in TABLES.items()}
SEEN = "client, slot, turn, packets"
MICROSECONDS = "CAST(UNIX_TIMESTAMP({})*1000000 AS SIGNED)"
SAMPLE = f"i.name, {MICROSECONDS.format('s.time')}, s.num, s.text"
# One look into the key per item. The usual join with the grouped maximum is as fast while the server's statistics
# are fresh, and takes seconds while a table is filling up, when they are not.
LAST_VALUES = (
    f"SELECT STRAIGHT_JOIN {SAMPLE} FROM item i JOIN sample s ON s.item_id=i.item_id AND s.time="
    "(SELECT x.time FROM sample x WHERE x.item_id=i.item_id ORDER BY x.time DESC LIMIT 1)"
)
LAST_DIAGNOSTICS = (
    f"SELECT STRAIGHT_JOIN d.component, {MICROSECONDS.format('d.time')}, d.level, d.message, d.details "
    "FROM (SELECT DISTINCT component FROM diagnostic) c JOIN diagnostic d ON d.component=c.component AND d.time="
    "(SELECT x.time FROM diagnostic x WHERE x.component=c.component ORDER BY x.time DESC LIMIT 1)"
)


@lru_cache(maxsize=8)
def _second(seconds: int) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(seconds))


def moment(microseconds: int) -> str:
    """A time in UTC; consecutive rows share the part before the fraction."""
    seconds, fraction = divmod(microseconds, 1_000_000)
    return f"'{_second(seconds)}.{fraction:06d}'"


def literal(value: float | str | None, escape: Escape) -> str:
    """A number, a text or NULL."""
    if value is None:
        return "NULL"
    return escape(value) if isinstance(value, str) else repr(value)


def inserts(batch: Batch, items: Mapping[str, Item], escape: Escape) -> Iterator[str]:
    """The statements that write a batch, samples first."""
    samples = (
        f"({items[item].item_id},{moment(time)},{'NULL' if num is None else repr(num)},{literal(text, escape)})"
        for item, time, num, text in batch.samples
    )
    yield from _insert("sample", ("item_id", "time", "num", "text"), samples)
    for row, table in TABLES.items():
        rows = (other for other in batch.rows if type(other) is row)
        yield from _insert(table, COLUMNS[table], (_values(other, COLUMNS[table], escape) for other in rows))
    if batch.seen is not None:
        seen = batch.seen
        values = f"{escape(seen.client)},{seen.slot},{seen.turn},x'{seen.packets.hex()}'"
        yield (
            f"INSERT INTO mqtt_seen ({SEEN}) VALUES ({values}) "
            "ON DUPLICATE KEY UPDATE turn=VALUES(turn), packets=VALUES(packets)"
        )


def _values(row: Any, columns: tuple[str, ...], escape: Escape) -> str:
    pairs = zip(columns, attrgetter(*columns)(row), strict=True)
    return f"({','.join(moment(v) if k in TIMES and v is not None else literal(v, escape) for k, v in pairs)})"


def _insert(table: str, columns: tuple[str, ...], values: Iterable[str]) -> Iterator[str]:
    """As few statements as the packet size allows."""
    part: list[str] = []
    size = 0
    head, tail = f"INSERT INTO {table} ({', '.join(columns)}) VALUES ", f" ON DUPLICATE KEY UPDATE {DUPLICATE[table]}"
    for value in values:
        if part and size + len(value) > PACKET:
            yield head + ",".join(part) + tail
            part, size = [], 0
        part.append(value)
        size += len(value) + 1
    if part:
        yield head + ",".join(part) + tail


def insert_items(items: Iterable[Item], escape: Escape) -> str:
    """Makes items; of those that are there the kind follows, and the unit stays once it is known."""
    rows = ",".join(
        f"({','.join(literal(value, escape) for value in (item.name, item.kind, item.unit))})" for item in items
    )
    return (
        f"INSERT INTO item (name, kind, unit) VALUES {rows} "
        "ON DUPLICATE KEY UPDATE kind=VALUES(kind), unit=COALESCE(unit, VALUES(unit))"
    )


def samples(item: str, since: int | None, until: int | None, limit: int | None, escape: Escape) -> str:
    """The newest samples of `since <= time < until`, newest first."""
    wanted = [f"i.name={escape(item)}"]
    wanted += [f"s.time>={moment(since)}"] if since is not None else []
    wanted += [f"s.time<{moment(until)}"] if until is not None else []
    most = f" LIMIT {int(limit)}" if limit is not None else ""
    return (
        f"SELECT {SAMPLE} FROM item i JOIN sample s ON s.item_id=i.item_id WHERE {' AND '.join(wanted)} "
        f"ORDER BY s.time DESC{most}"
    )


def sightings(marker: int, limit: int) -> str:
    """Where a marker was seen, newest first."""
    columns = (MICROSECONDS.format(name) if name in TIMES else name for name in COLUMNS["sighting"])
    return (
        f"SELECT {', '.join(columns)} FROM sighting WHERE marker={int(marker)} ORDER BY stamp DESC LIMIT {int(limit)}"
    )


def view_name(item: Item) -> str:
    """OpenHAB's name of the item's table."""
    return f"Item{item.item_id}"


def items_view(database: str, views: str) -> str:
    """OpenHAB's index of items."""
    return (
        f"CREATE OR REPLACE VIEW `{views}`.Items AS SELECT item_id AS ItemId, name AS ItemName FROM `{database}`.item"
    )


def item_view(item: Item, database: str, views: str) -> str:
    """OpenHAB's table of one item; it never stored UNDEF and NULL, so they are left out."""
    value = VIEW_VALUES.get(item.kind, "text")
    shown = "num IS NOT NULL" if item.kind in VIEW_VALUES else "text NOT IN ('UNDEF','NULL')"
    return (
        f"CREATE OR REPLACE VIEW `{views}`.`{view_name(item)}` AS SELECT time AS Time, {value} AS Value "
        f"FROM `{database}`.sample WHERE item_id={item.item_id} AND {shown}"
    )
