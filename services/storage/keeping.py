"""Old samples to means, in small pieces: what each piece does to the tables.

A piece reads first and then inserts values, or deletes some rows by their key, in a transaction of its own: nothing
that the writer touches is locked for long. Which pieces are wanted, and when: `services/history/keeping.py`.
"""

from __future__ import annotations

from services.storage import Item, Storage, ahead, reading
from services.storage.reading import DIALECTS, SECOND


def next_sample(storage: Storage, item: Item, since_s: int) -> int | None:
    """The time (seconds) of the first sample from then on."""
    found = reading.oldest(storage, item, since_s * SECOND, 1)
    return found[0].time // SECOND if found else None


def summarise(storage: Storage, item: Item, width: int, since_s: int, until_s: int) -> int:
    """Makes the means of whole intervals; how many. Made again they stay as they are."""
    sql = DIALECTS[storage.dialect]
    second = {"mysql": "UNIX_TIMESTAMP(s.time)", "sqlite": f"s.time/{SECOND}"}[storage.dialect]
    rows = storage.read(
        f"SELECT g.b, g.n, g.lo, g.mean, g.hi, l.num FROM (SELECT {second} {sql.div} {width} * {width} b, COUNT(*) n, "
        f"MIN(s.num) lo, AVG(s.num) mean, MAX(s.num) hi, MAX(s.time) t FROM sample s WHERE s.item_id={item.item_id} "
        f"AND s.num IS NOT NULL AND s.time>={sql.at(since_s * SECOND)} AND s.time<{sql.at(until_s * SECOND)} "
        "GROUP BY b) g "
        f"JOIN sample l ON l.item_id={item.item_id} AND l.time=g.t ORDER BY g.b"
    )
    values = ",".join(f"({item.item_id},{width},{','.join(map(str, row))})" for row in rows)
    if values:
        ignored = {"mysql": "ON DUPLICATE KEY UPDATE n=n", "sqlite": "ON CONFLICT DO NOTHING"}[storage.dialect]
        storage.change(f"INSERT INTO summary (item_id, width, start, n, lo, mean, hi, last) VALUES {values} {ignored}")
    return len(rows)


def clear(storage: Storage, item: Item, until_s: int, most: int, now: float) -> int:
    """Deletes the oldest samples before a time, `most` at most, but never the newest whose time has come; how many."""
    newest = reading.before(storage, item, ahead.believed(now))
    if newest is None:
        return 0
    sql = DIALECTS[storage.dialect]
    until = min(until_s * SECOND, newest.time)
    found = [one for one in reading.oldest(storage, item, 0, most) if one.time < until]
    if not found:
        return 0
    return storage.change(
        f"DELETE FROM sample WHERE item_id={item.item_id} AND time<={sql.at(found[-1].time)} AND time<{sql.at(until)}"
    )


def forget(storage: Storage, item: Item, width: int, until_s: int) -> int:
    """Deletes means that are older than wanted; how many."""
    return storage.change(
        f"DELETE FROM summary WHERE item_id={item.item_id} AND width={width} AND start+width<={int(until_s)}"
    )
