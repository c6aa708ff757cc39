"""The questions that users of OpenHAB's tables ask, on a database that the service filled."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from services.persistence import Config
from services.persistence.service import Persistence
from services.states import base_type
from services.storage import Item, open_storage
from tests.databases import Database, shown
from tests.storage import day

FILE = Path(__file__).parents[1] / "fixtures" / "history" / "queries.sql"


@dataclass(frozen=True)
class Query:
    """One question, in the words of each database."""

    name: str
    statement: str
    sqlite: str
    answer: str


def queries() -> list[Query]:
    """What the file holds; see its first lines."""
    blocks = re.findall(r"^-- (Q\d+) .*? => (.*)\n(.*)\n(?:-- SQLite: (.*)\n)?", FILE.read_text(encoding="utf-8"), re.M)
    return [Query(name, statement, sqlite or statement, answer) for name, answer, statement, sqlite in blocks]


@pytest.fixture
def madrid(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """SQLite's views show the local time of the process that reads."""
    monkeypatch.setenv("TZ", "Europe/Madrid")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def play_the_day(database: Database) -> Counter[str]:
    """The service writes the day, message by message; the items are there before, so that their ids are known."""
    storage = open_storage(database.address)
    storage.add_items(Item(name, base_type(item.type), item.unit) for name, item in day.HOME.items.items())
    service = Persistence(Config(url="sqlite:///unused", home=day.HOME), lambda: storage)
    for message in day.messages():
        assert not list(service.handle(message, message.received))
        service.tick(message.received)
    service.connection.close()
    return service.counters


@pytest.mark.usefixtures("madrid")
def test_every_question_gets_its_answer(database: Database) -> None:
    counters = play_the_day(database)
    assert counters["refused"] == counters["unit_mismatch"] == 0
    asked = queries()
    assert len(asked) == 30
    wrong = {}
    for query in asked:
        statement = query.sqlite if database.kind == "sqlite" else query.statement
        rows = database.rows(statement, reader="bus." not in statement)
        answer = "; ".join(shown(row) for row in rows)
        if without_fractions(answer, query) != without_fractions(query.answer, query):
            wrong[query.name] = (answer, query.answer)
    assert not wrong


def without_fractions(answer: str, query: Query) -> str:
    """Q30 shows its times without the fraction on SQLite."""
    return answer.replace(".250", "") if query.name == "Q30" else answer
