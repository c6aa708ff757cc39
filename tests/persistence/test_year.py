"""The bench of a year, small: its rows are there, and questions get the same answers from means as from raw rows."""

from __future__ import annotations

import random
import time
from contextlib import closing

from services.history import answers
from services.history.keeping import pieces
from services.payloads import stamp
from services.payloads.history import HistoryGet
from services.storage import Storage, open_storage
from tests.databases import Database
from tests.persistence import year_bench as year

DAYS, ITEMS = 92, 2


def points(storage: Storage, end: int) -> list[tuple[str, float]]:
    question = HistoryGet(id="q", item="Y1", since=stamp(end - DAYS * year.DAY), until=stamp(end), every=year.POINT_S)
    return [(at, round(float(value), 6)) for at, value in answers.answer(storage, question, float(end)).samples]


def test_means_answer_as_the_raw_rows_did_and_old_ones_go(database: Database) -> None:
    end = int(time.time()) // year.DAY * year.DAY
    with closing(open_storage(database.address)) as storage:
        year.fill(storage, ITEMS, end, DAYS)
        assert database.rows("SELECT COUNT(*) FROM sample") == [(ITEMS * DAYS * 1440,)]
        raw = points(storage, end)
        assert len(year.asked(storage, ITEMS, end, 1, None, random.Random(1))) == year.QUESTIONS
        year.make_means(storage, ITEMS, end, DAYS)
        assert points(storage, end) == raw
        cleared = sum(pieces(storage, dict.fromkeys(year.names(ITEMS), year.LINE), end))
        assert cleared == ITEMS * 2 * 1440
        assert points(storage, end) == raw
