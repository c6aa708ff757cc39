"""Questions about what was: last value before a time, means per bucket, changes, how long in which state.

The SQL for both databases, from whole numbers only. All times are microseconds since 1970, UTC; spans are
`since <= time < until`. Not here: the plain list of samples (`Storage.samples`), who asks (`services/history/`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields

from services.storage import FINAL_STATES, TIMES, Item, Mission, Sample, Storage
from services.storage.mysql_text import MICROSECONDS, moment

SECOND = 1_000_000
LAST = (2**31 - 1) * SECOND  # what MariaDB's TIMESTAMP holds
YEAR_0_TO_1970_S = (
    62_167_219_200  # TO_SECONDS counts whole ones, in UTC as our sessions do; UNIX_TIMESTAMP slow decimals
)
AGGREGATES = "COUNT(s.num), MIN(s.num), AVG(s.num), MAX(s.num) FROM sample s"
PIECE = 50  # buckets asked for at once; SQLite joins no more than 500 questions
LOOKED_AT = 10_000  # samples at once, for what changed: a tenth of a second
CROWD = 150  # samples in a bucket: from there on a range for each is quicker than groups


@dataclass(frozen=True, slots=True)
class Dialect:
    """What differs: a time as a literal, a column as microseconds, a join that keeps its order, whole division."""

    at: Callable[[int], str]
    micro: str
    join: str
    div: str
    greatest_key: str  # the newest key of an item before a bound, as a subquery
    bucket: str  # the second that the bucket of a sample begins in


DIALECTS = {
    "mysql": Dialect(
        moment, MICROSECONDS, "STRAIGHT_JOIN", "DIV",
        "(SELECT x.time FROM sample x WHERE x.item_id=i.item_id AND x.time<{} ORDER BY x.time DESC LIMIT 1)",
        f"(TO_SECONDS(s.time) - {YEAR_0_TO_1970_S}) DIV {{every_s}} * {{every_s}}",
    ),
    "sqlite": Dialect(
        str, "{}", "CROSS JOIN", "/", "(SELECT MAX(x.time) FROM sample x WHERE x.item_id=i.item_id AND x.time<{})",
        f"s.time / ({{every_s}} * {SECOND}) * {{every_s}}",
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Bucket:
    """The numbers of an item in a span that begins at `start`, in microseconds; `mean` is that of the samples."""

    start: int
    n: int
    lo: float
    mean: float
    hi: float


def items(storage: Storage) -> dict[str, Item]:
    """The items as the database has them now; another process may have made some."""
    return {row[0]: Item(*row) for row in storage.read("SELECT name, kind, unit, item_id FROM item")}


def before(storage: Storage, item: Item, until: int) -> Sample | None:
    """The last sample before a time: the state as of then."""
    sql = DIALECTS[storage.dialect]
    rows = storage.read(
        f"SELECT {sql.micro.format('s.time')}, s.num, s.text FROM sample s "
        f"WHERE s.item_id={item.item_id} AND s.time<{sql.at(until)} ORDER BY s.time DESC LIMIT 1"
    )
    return Sample(item.name, *rows[0]) if rows else None


def oldest(storage: Storage, item: Item, since: int, limit: int) -> list[Sample]:
    """The oldest samples of an item from a time on: for going through all of them in pieces."""
    sql = DIALECTS[storage.dialect]
    rows = storage.read(
        f"SELECT {sql.micro.format('s.time')}, s.num, s.text FROM sample s WHERE s.item_id={item.item_id} "
        f"AND s.time>={sql.at(max(since, SECOND))} ORDER BY s.time LIMIT {int(limit)}"
    )
    return [Sample(item.name, *row) for row in rows]


def all_before(storage: Storage, until: int) -> dict[str, Sample]:
    """The same of every item that has one."""
    sql = DIALECTS[storage.dialect]
    key = sql.greatest_key.format(sql.at(until))
    rows = storage.read(
        f"SELECT i.name, {sql.micro.format('s.time')}, s.num, s.text "
        f"FROM item i {sql.join} sample s ON s.item_id=i.item_id AND s.time={key}"
    )
    return {row[0]: Sample(*row) for row in rows}


def changes(
    storage: Storage, since: int, until: int, items: Iterable[Item] | None = None, limit: int = LOOKED_AT
) -> tuple[list[Sample], int]:
    """What changed in a span: samples that differ from the one before of the same item, oldest first.

    Of a span with more than `limit` samples the newest are looked at. With it from when on: the span's begin, or
    later where there was more to look at.
    """
    wanted = None if items is None else [item.item_id for item in items]
    rows = [] if wanted == [] else _between(storage, since, until, wanted, limit)
    if not rows:
        return [], since
    if len(rows) >= limit:
        since = rows[0].time + 1  # others of that very moment may be missing
        rows = [row for row in rows if row.time >= since]
    last = {name: (one.num, one.text) for name, one in all_before(storage, since).items()}
    changed = []
    for row in rows:
        if last.get(row.item) != (row.num, row.text):
            last[row.item] = (row.num, row.text)
            changed.append(row)
    return changed, since


def _between(storage: Storage, since: int, until: int, items: list[int] | None, limit: int) -> list[Sample]:
    sql = DIALECTS[storage.dialect]
    which = "" if items is None else f"WHERE i.item_id IN ({','.join(map(str, items))}) "
    rows = storage.read(
        f"SELECT i.name, {sql.micro.format('s.time')}, s.num, s.text FROM item i {sql.join} sample s "
        f"ON s.item_id=i.item_id AND s.time>={sql.at(since)} AND s.time<{sql.at(until)} {which}"
        f"ORDER BY s.time DESC LIMIT {int(limit)}"
    )
    return [Sample(*row) for row in reversed(rows)]


def durations(storage: Storage, item: Item, since: int, until: int) -> dict[str, int]:
    """How long an item was in each state, in microseconds; the state before the span counts until its first change.

    A number is told as its text. Time before the first sample ever is in no state.
    """
    sql = DIALECTS[storage.dialect]
    first = before(storage, item, since + 1)
    start = first.time if first else since
    rows = storage.read(
        "SELECT v, SUM(b - a) FROM (SELECT COALESCE(text, num) v, "
        f"CASE WHEN t<{int(since)} THEN {int(since)} ELSE t END a, "
        f"COALESCE(LEAD(t) OVER (ORDER BY t), {int(until)}) b FROM "
        f"(SELECT {sql.micro.format('s.time')} t, s.num, s.text FROM sample s WHERE s.item_id={item.item_id} "
        f"AND s.time>={sql.at(start)} AND s.time<{sql.at(until)}) r) d GROUP BY v"
    )
    return {_plain(value): int(spent) for value, spent in rows}


def open_orders(storage: Storage) -> list[tuple[str, str, int]]:
    """Camera, id and first time of the orders that have not ended, oldest first."""
    micro = DIALECTS[storage.dialect].micro.format("at")
    return [
        (str(camera), str(order), int(at))
        for camera, order, at in storage.read(
            f"SELECT camera, order_id, {micro} FROM camera_order WHERE state NOT IN {FINAL_STATES} ORDER BY at"
        )
    ]


def newest_missions(storage: Storage, limit: int) -> list[Mission]:
    """The missions that began last, oldest first."""
    return missions(storage, SECOND, LAST, limit)


def missions(storage: Storage, since: int, until: int, limit: int) -> list[Mission]:
    """The newest missions that began in a span, oldest first."""
    sql = DIALECTS[storage.dialect]
    names = [one.name for one in fields(Mission)]
    columns = ", ".join(sql.micro.format(name) if name in TIMES else name for name in names)
    rows = storage.read(
        f"SELECT {columns} FROM mission WHERE started>={sql.at(max(since, SECOND))} AND started<{sql.at(until)} "
        f"ORDER BY started DESC LIMIT {int(limit)}"
    )
    return [Mission(*row) for row in reversed(rows)]


def _plain(value: object) -> str:
    return value if isinstance(value, str) else str(value).removesuffix(".0")


def buckets(storage: Storage, item: Item, since: int, until: int, every_s: int) -> list[Bucket]:
    """Count, least, mean and greatest number per bucket of `every_s` seconds, counted from 1970; empty ones left out.

    Kept means (`keeping.py`) are used where they fit, the raw rows before and after them.
    """
    width, begin, end = _kept_means(storage, item, every_s)
    first, then = (min(max(since, at * SECOND), until) for at in (begin, end))
    found: list[Bucket] = []
    for bucket in (
        *_from_samples(storage, item, since, first, every_s),
        *_from_means(storage, item, first, then, every_s, width),
        *_from_samples(storage, item, then, until, every_s),
    ):
        same = bool(found) and found[-1].start == bucket.start
        found[-1 if same else len(found) :] = [_merged(found[-1], bucket) if same else bucket]
    return found


def made(storage: Storage, item: Item, width: int) -> tuple[int, int] | None:
    """From and until when (seconds) an item's means of that width are made; None when there are none."""
    rows = storage.read(f"SELECT MIN(start), MAX(start) FROM summary WHERE item_id={item.item_id} AND width={width}")
    first, last = rows[0]
    return None if last is None else (int(first), int(last) + width)


def _kept_means(storage: Storage, item: Item, every_s: int) -> tuple[int, int, int]:
    """The widest kept means that buckets of this width can be made of, where they begin and end, seconds; else 0.

    From one width to the next narrower one: each is a look at the key, where a list of widths reads all means.
    """
    width = every_s + 1
    while width := _narrower(storage, item, width):
        span = made(storage, item, width)
        if span and every_s % width == 0:
            return width, *span
    return 0, 0, 0


def _narrower(storage: Storage, item: Item, width: int) -> int:
    rows = storage.read(f"SELECT MAX(width) FROM summary WHERE item_id={item.item_id} AND width<{width}")
    return int(rows[0][0] or 0)


def _from_means(storage: Storage, item: Item, since: int, until: int, every_s: int, width: int) -> list[Bucket]:
    if since >= until:
        return []
    sql = DIALECTS[storage.dialect]
    rows = storage.read(
        f"SELECT start {sql.div} {every_s} * {every_s} b, SUM(n), MIN(lo), SUM(mean*n)/SUM(n), MAX(hi) FROM summary "
        f"WHERE item_id={item.item_id} AND width={width} AND start>={since // SECOND} AND start<{until // SECOND} "
        f"GROUP BY b ORDER BY NULL"  # else MariaDB sorts every row, not every bucket
    )
    return _in_order(rows)


def _from_samples(storage: Storage, item: Item, since: int, until: int, every_s: int) -> list[Bucket]:
    """In pieces of so many buckets; how crowded one was tells how the next is best asked for."""
    step, found, crowded = every_s * SECOND, list[Bucket](), False
    while since < until:
        end = min((since // step + PIECE) * step, until)
        ask = _range_by_range if crowded else _grouped
        piece = _in_order(storage.read(ask(DIALECTS[storage.dialect], item, since, end, every_s)))
        crowded = sum(bucket.n for bucket in piece) > PIECE * CROWD
        found += piece
        since = end
    return found


def _grouped(sql: Dialect, item: Item, since: int, until: int, every_s: int) -> str:
    return (
        f"SELECT {sql.bucket.format(every_s=every_s)} b, {AGGREGATES} WHERE s.item_id={item.item_id} "
        f"AND s.num IS NOT NULL AND s.time>={sql.at(since)} AND s.time<{sql.at(until)} "
        f"GROUP BY b ORDER BY NULL"  # else MariaDB sorts every sample, not every bucket: twice the time for a year
    )


def _range_by_range(sql: Dialect, item: Item, since: int, until: int, every_s: int) -> str:
    """Each bucket by its own range of the key, without a table of groups: 0.75 of the time on MariaDB, 0.45 on SQLite,
    where a bucket has 720 samples. An empty one costs 50 us, where it costs nothing in groups."""
    step = every_s * SECOND
    return " UNION ALL ".join(
        f"SELECT {start // SECOND}, {AGGREGATES} WHERE s.item_id={item.item_id} "
        f"AND s.time>={sql.at(max(start, since))} AND s.time<{sql.at(min(start + step, until))}"
        for start in range(since // step * step, until, step)
    )


def _in_order(rows: Iterable[tuple[object, ...]]) -> list[Bucket]:
    found = []
    for row in rows:
        if row[1]:
            start, n, lo, mean, hi = (float(str(value)) for value in row)
            found.append(Bucket(int(start) * SECOND, int(n), lo, mean, hi))
    return sorted(found, key=lambda bucket: bucket.start)


def _merged(one: Bucket, other: Bucket) -> Bucket:
    n = one.n + other.n
    mean = (one.mean * one.n + other.mean * other.n) / n
    return Bucket(one.start, n, min(one.lo, other.lo), mean, max(one.hi, other.hi))
