"""OpenHAB's own tables: reads those that an OpenHAB filled, and writes such for one that is to go on with them.

Both layouts: of the old MySQL binding (`Items`, `Item<N>`, local time in whole seconds) and of the JDBC service
(`item0001`, `<name>_0001`, or the item's bare name without an index). The commands: `command_line/stored.py`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, tzinfo
from typing import Any

from services import states
from services.apartment.home import Home
from services.errors import BadMessage, ConfigError
from services.persistence import rows
from services.persistence.rows import State
from services.storage import Batch, Item, Sample, Storage, reading

PIECE = 5000  # rows read and written at a time
US = 1_000_000
SWITCHES = {"ON", "OFF"}
CONTACTS = {"OPEN", "CLOSED"}
PLAYERS = {"PLAY", "PAUSE", "REWIND", "FASTFORWARD"}
WIDEST = {"VARCHAR(20000)": "VARCHAR(16255)"}  # the old binding's texts do not fit into a column of utf8mb4
KINDS = (  # by the type of the column, where neither the home's model nor the values tell
    (r"double.*|real|float.*|decimal.*", "Number"),
    (r"tinyint.*|smallint.*", "Dimmer"),
    (r"datetime.*|timestamp.*", "DateTime"),
    (r"varchar\((30|50)\)", "Location"),
    (r"varchar\(70\)", "Color"),
)


@dataclass(frozen=True)
class Table:
    """One item's table there."""

    item: str
    name: str
    time: str  # the names of its columns
    value: str
    value_type: str
    is_local: bool  # its times have no zone


@dataclass
class Tally:
    """What came of a table."""

    item: str
    table: str
    read: int = 0
    odd: int = 0  # values that are no state of the item's type: kept as text
    future: int = 0  # forecasts, whose time has not come: left out


def find(source: Storage) -> list[Table]:
    """The tables of items that a database has; ConfigError when there are none."""
    names = _tables(source)
    index = next((name for name in names if name.lower() == "items"), None)
    items = _index(source, index) if index else {}
    named = ((_item_of(name, items), name) for name in names if name != index)
    found = [table for item, name in named if item and (table := _table(source, item, name))]
    if not found:
        raise ConfigError(["expected OpenHAB's tables (Items and Item1, item0001 or lab_temp_0001), there are none"])
    return found


def _tables(source: Storage) -> list[str]:
    statement = {
        "mysql": "SELECT table_name FROM information_schema.tables "
        "WHERE table_schema=DATABASE() AND table_type='BASE TABLE'",
        "sqlite": "SELECT name FROM sqlite_master WHERE type='table' AND name NOT LIKE 'sqlite_%'",
    }[source.dialect]
    return [str(name) for (name,) in source.read(statement)]


def _index(source: Storage, name: str) -> dict[int, str]:
    columns = {column.lower(): column for column, _ in _columns(source, name)}
    number, item = columns.get("itemid"), columns.get("itemname")
    if number is None or item is None:
        return {}
    return {int(row[0]): str(row[1]) for row in source.read(f"SELECT {number}, {item} FROM `{name}`")}


def _columns(source: Storage, table: str) -> list[tuple[str, str]]:
    if source.dialect == "sqlite":
        return [(row[1], row[2].lower()) for row in source.read(f"PRAGMA table_info(`{table}`)")]
    return [(row[0], str(row[1]).lower()) for row in source.read(f"SHOW COLUMNS FROM `{table}`")]


def _item_of(table: str, items: dict[int, str]) -> str | None:
    """Whose table it is: by the digits at its end where there is an index, else by its name."""
    if not items:
        return table
    number = re.fullmatch(r"(.*?)_?0*([0-9]+)", table)
    item = items.get(int(number[2])) if number else None
    if item is None or number is None:
        return table if table in items.values() else None
    bare = re.sub(r"[^A-Za-z0-9]", "", item).lower()  # 1.x and 2.x dropped what is neither letter nor digit
    return item if number[1].lower() in ("item", item.lower(), bare) else None


def _table(source: Storage, item: str, name: str) -> Table | None:
    columns = {column.lower(): (column, kind) for column, kind in _columns(source, name)}
    if "time" not in columns or "value" not in columns:
        return None
    (time, time_type), (value, value_type) = columns["time"], columns["value"]
    is_local = source.dialect == "sqlite" or not time_type.startswith("timestamp")
    return Table(item, name, time, value, value_type, is_local)


def copy(
    source: Storage,
    table: Table,
    storage: Storage,
    home: Home,
    zone: tzinfo,
    now: float,
    tell: Callable[[int], None] = lambda n: None,
) -> Tally:
    """A table's rows up to `now`, in pieces; a row that is there already (from an import before) stays as it is."""
    tally = Tally(table.item, table.name)
    item = _item(source, table, home)
    storage.add_items([item])
    for piece in _pieces(source, table):
        samples = [_sample(storage.items[item.name], when, value, table, zone, tally) for when, value in piece]
        past = [sample for sample in samples if sample.time <= now * US]
        storage.write(Batch(past))
        tally.read += len(piece)
        tally.future += len(samples) - len(past)
        tell(tally.read)
    return tally


def _item(source: Storage, table: Table, home: Home) -> Item:
    """Type and unit by the home's model, else by what the table holds."""
    model = home.items.get(table.item)
    if model is not None:
        return Item(table.item, states.base_type(model.type), model.unit)
    kind = next((kind for form, kind in KINDS if re.fullmatch(form, table.value_type)), None)
    return Item(table.item, kind or _kind_of_texts(source, table))


def _kind_of_texts(source: Storage, table: Table) -> str:
    query = f"SELECT DISTINCT {table.value} FROM `{table.name}` WHERE {table.value} IS NOT NULL LIMIT 20"
    values = {str(value) for (value,) in source.read(query)}
    for kind, words in (("Switch", SWITCHES), ("Contact", CONTACTS), ("Player", PLAYERS)):
        if values and values <= words:
            return kind
    return "String"


def _pieces(source: Storage, table: Table) -> Iterator[list[tuple[Any, Any]]]:
    """In the order of their times, by the key: a page never gets slower with its number."""
    after, name = "", f"`{table.name}`"
    while True:
        where = f"WHERE {table.time}>{after}" if after else ""
        piece = source.read(
            f"SELECT {table.time}, {table.value} FROM {name} {where} ORDER BY {table.time} LIMIT {PIECE}"
        )
        if not piece:
            return
        yield [(row[0], row[1]) for row in piece]
        after = source.quote(str(piece[-1][0]))


def _sample(item: Item, when: Any, value: Any, table: Table, zone: tzinfo, tally: Tally) -> Sample:
    moment = when if isinstance(when, datetime) else datetime.fromisoformat(str(when))
    moment = moment.replace(tzinfo=zone if table.is_local else UTC)
    time = round(moment.timestamp() * US)
    if isinstance(value, datetime) and table.value_type.startswith("timestamp"):
        value = value.replace(tzinfo=UTC).astimezone(zone)
    text = _text(value, zone)
    try:
        num = states.number(item.kind, text)
    except BadMessage:
        tally.odd += 1
        return Sample(item.name, time, None, text)
    return rows.sample(State(item.name, item.kind, time, text, num, "", retained=False), item.unit)


def _text(value: Any, zone: tzinfo) -> str:
    """The state as OpenHAB writes it."""
    if value is None:
        return "NULL"
    if isinstance(value, datetime):
        return states.moment_text(value if value.tzinfo else value.replace(tzinfo=zone))
    if isinstance(value, (int, float)):
        return states.plain(float(value))
    return str(value)


@dataclass(frozen=True)
class Layout:
    """How OpenHAB's tables are made."""

    table: Callable[[int], str]
    columns: tuple[str, str]
    time_type: str
    decimals: int
    value_types: str  # the column of our table `kind`


LAYOUTS = {
    # Without the explicit default an old server would move old rows to now at each update.
    "jdbc": Layout(lambda n: f"item{n:04d}", ("time", "value"),
                   "TIMESTAMP(3) NOT NULL DEFAULT CURRENT_TIMESTAMP(3)", 3, "jdbc_type"),
    "mysql": Layout(lambda n: f"Item{n}", ("Time", "Value"), "DATETIME NOT NULL", 0, "mysql1_type"),
}  # fmt: skip


def write(storage: Storage, target: Storage, layout: Layout, zone: tzinfo) -> Iterator[Tally]:
    """Makes OpenHAB's real tables of all items in another database (MariaDB, MySQL), for an OpenHAB to go on with.

    Of two values in one step of its clock the later one stays, as OpenHAB itself does.
    """
    if target.dialect != "mysql":
        raise ConfigError(["expected a MariaDB or MySQL database for OpenHAB's tables"])
    types = {
        kind: WIDEST.get(name, name) for kind, name in storage.read(f"SELECT kind, {layout.value_types} FROM kind")
    }
    target.change(
        "CREATE TABLE IF NOT EXISTS Items (ItemId INT NOT NULL AUTO_INCREMENT, ItemName VARCHAR(500) NOT NULL, "
        "PRIMARY KEY (ItemId))"
    )
    there = {int(number): str(name) for number, name in target.read("SELECT ItemId, ItemName FROM Items")}
    if foreign := [item.name for item in storage.items.values() if there.get(item.item_id, item.name) != item.name]:
        raise ConfigError(
            [f"Items there has the number of {name} for another item: use an empty database" for name in foreign]
        )
    for item in sorted(storage.items.values(), key=lambda one: one.item_id):
        yield _write_one(storage, target, layout, item, types[item.kind], zone)


def _write_one(storage: Storage, target: Storage, layout: Layout, item: Item, kind: str, zone: tzinfo) -> Tally:
    name, (time, value) = layout.table(item.item_id), layout.columns
    target.change(f"INSERT IGNORE INTO Items VALUES ({item.item_id}, {target.quote(item.name)})")
    target.change(
        f"CREATE TABLE IF NOT EXISTS `{name}` ({time} {layout.time_type}, {value} {kind}, PRIMARY KEY ({time}))"
    )
    tally, since = Tally(item.name, name), 0
    while piece := reading.oldest(storage, item, since, PIECE):
        since = piece[-1].time + 1
        tally.read += len(piece)
        values = [f"({_moment(one.time, layout, zone)},{_value(one, item, target, UTC if layout.decimals else zone)})"
                  for one in piece if one.text not in states.SPECIAL]  # fmt: skip
        if values:
            target.change(
                f"INSERT INTO `{name}` ({time}, {value}) VALUES {','.join(values)} "
                f"ON DUPLICATE KEY UPDATE {value}=VALUES({value})"
            )
    return tally


def _moment(time: int, layout: Layout, zone: tzinfo) -> str:
    """TIMESTAMP in UTC, the session's zone; DATETIME on the home's clock."""
    step = 10 ** (6 - layout.decimals)
    when = datetime.fromtimestamp(time // step * step / US, UTC if layout.decimals else zone)
    return f"'{when:%Y-%m-%d %H:%M:%S.%f}'"


def _value(one: Sample, item: Item, target: Storage, zone: tzinfo) -> str:
    if item.kind == "DateTime" and one.num is not None:
        return f"'{datetime.fromtimestamp(one.num / US, zone):%Y-%m-%d %H:%M:%S.%f}'"
    if one.text is not None and item.kind not in rows.AS_NUMBER:
        return target.quote(one.text)
    return "NULL" if one.num is None else repr(one.num)
