"""Old samples become means, in pieces, and questions get the same answers from them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pydantic import ValidationError

from services.apartment.home import Home
from services.apartment.home import Item as HomeItem
from services.history import Config
from services.history.keeping import Keep, by_item, pieces
from services.history.service import PAUSE_S, ROUND_EVERY_S, SETTLE_S, History
from services.storage import Batch, Item, Sample, Storage, open_storage, reading
from tests.databases import Database

DAY = 86_400
T0 = 1_769_817_600  # 2026-01-31 00:00 UTC
US = 1_000_000
HOME = Home(groups={"gAll": "All"}, items={
    "Temp": HomeItem(type="Number", label="T", groups=("gAll",)), "Light": HomeItem(type="Switch", label="L"),
})  # fmt: skip
LINE = Keep(items=("gAll*", "Light"), raw="2d", means={"5m": "5d", "1h": "forever"})
LINES = by_item((LINE,), HOME)


@pytest.fixture
def storage(database: Database) -> Iterator[Storage]:
    """Ten days of a sample a minute, and a light that was switched once."""
    opened = open_storage(database.address)
    opened.add_items([Item("Temp", "Number", "°C"), Item("Light", "Switch")])
    times = range(T0, T0 + 10 * DAY, 60)
    opened.write(Batch([Sample("Temp", t * US, float(t // 60 % 100), None) for t in times]))
    opened.write(Batch([Sample("Light", T0 * US, 1.0, "ON"), Sample("Temp", (T0 + 30) * US, None, "UNDEF")]))
    yield opened
    opened.close()


def count(storage: Storage, table: str, where: str = "1=1") -> int:
    return int(storage.read(f"SELECT COUNT(*) FROM {table} WHERE {where}")[0][0])


def test_a_round_leaves_what_the_lines_say_and_the_same_answers(storage: Storage) -> None:
    temp, now = storage.items["Temp"], T0 + 10 * DAY
    before = reading.buckets(storage, temp, T0 * US, now * US, 3600)
    steps = list(pieces(storage, LINES, now))
    assert max(steps) <= 2000
    assert count(storage, "summary", "width=300") == (5 * DAY - 300) // 300
    assert count(storage, "summary", "width=3600") == 10 * 24 - 1
    assert [one.time // US for one in storage.samples("Temp")] == list(range(T0 + 8 * DAY, T0 + 10 * DAY, 60))
    assert len(storage.samples("Light")) == 1
    after = reading.buckets(storage, temp, T0 * US, now * US, 3600)
    assert [(b.start, b.n, b.lo, round(b.mean, 9), b.hi) for b in after] == [
        (b.start, b.n, b.lo, round(b.mean, 9), b.hi) for b in before
    ]
    day = reading.buckets(storage, temp, (T0 + 6 * DAY) * US, (T0 + 7 * DAY) * US, 300)
    assert len(day) == 288
    assert list(pieces(storage, LINES, now)) == [0]  # a second round has nothing to do


def test_the_last_of_an_interval_and_a_gap_are_kept(storage: Storage) -> None:
    temp = storage.items["Temp"]
    storage.write(Batch([Sample("Temp", (T0 + 40 * DAY) * US, 7.0, None)]))
    list(pieces(storage, LINES, T0 + 50 * DAY))
    assert storage.read(f"SELECT last FROM summary WHERE width=3600 AND start={T0}") == [
        (float((T0 + 3540) // 60 % 100),)
    ]
    assert reading.made(storage, temp, 3600) == (T0, T0 + 40 * DAY + 3600)
    assert [one.num for one in storage.samples("Temp")] == [7.0]  # older than all, and yet the newest


def test_what_may_still_come_late_is_not_closed(storage: Storage) -> None:
    list(pieces(storage, LINES, T0 + 10 * DAY))
    assert reading.made(storage, storage.items["Temp"], 300) == (T0 + 5 * DAY, T0 + 10 * DAY - 300)


def test_samples_brought_along_later_are_seen_and_become_means_before_they_go(storage: Storage) -> None:
    """As `apartment db import` does with those of another house's years."""
    temp, now, since = storage.items["Temp"], T0 + 10 * DAY, T0 - 20 * DAY

    def means() -> dict[int, float]:
        return {
            one.start // US: round(one.mean, 9) for one in reading.buckets(storage, temp, since * US, now * US, 7200)
        }

    before = means()
    list(pieces(storage, LINES, now))
    brought = range(since, since + DAY, 60)
    storage.write(Batch([Sample("Temp", t * US, float(t // 3600 % 2), None) for t in brought]))
    after = {**dict.fromkeys(range(since, since + DAY, 7200), 0.5), **before}
    assert means() == after
    list(pieces(storage, LINES, now))
    assert storage.samples("Temp", until=T0 * US) == []
    assert means() == after
    assert list(pieces(storage, LINES, now)) == [0]


def test_the_service_keeps_house_in_pieces_between_questions(storage: Storage, database: Database) -> None:
    service = History(lambda: open_storage(database.address), LINES)
    now = float(T0 + 10 * DAY)
    service.tick(now)
    assert service.due == now + SETTLE_S
    ticks = 0
    while service.due is not None and service.due - now < ROUND_EVERY_S:
        assert service.due - now in (SETTLE_S, pytest.approx(PAUSE_S, abs=1e-6))
        now = service.due
        service.tick(now)
        ticks += 1
    assert service.counters["pieces"] == ticks - 1 > 20
    assert len(storage.samples("Temp")) <= 2 * DAY // 60
    service.close()


def test_the_newest_that_has_its_time_is_kept_beside_a_forecast(storage: Storage) -> None:
    storage.write(Batch([Sample("Temp", (T0 + 400 * DAY) * US, 9.0, None)]))
    list(pieces(storage, LINES, T0 + 20 * DAY))
    newest = float((T0 + 10 * DAY - 60) // 60 % 100)
    assert [one.num for one in storage.samples("Temp")] == [newest, 9.0]


def rounds(service: History, now: float, until: float) -> float:
    """Ticks whenever one is wanted; when the last of them was."""
    while service.due is not None and service.due <= until:
        now = max(now, service.due)
        service.tick(now)
    return now


@pytest.mark.parametrize("writes_too", [False, True])
def test_a_clock_that_is_set_on_by_years_clears_nothing_away(
    storage: Storage, database: Database, caplog: pytest.LogCaptureFixture, *, writes_too: bool
) -> None:
    service = History(lambda: open_storage(database.address), LINES)
    now = rounds(service, T0 + 10.0 * DAY, T0 + 10.0 * DAY + 2 * ROUND_EVERY_S)
    before = count(storage, "sample")
    ahead = now + 1000 * DAY
    if writes_too:  # the writer has the same clock
        storage.write(Batch([Sample("Temp", round(ahead * US), 1.0, None)]))
    service.tick(ahead)
    rounds(service, ahead, ahead + DAY / 2)
    assert count(storage, "sample") == before + writes_too
    assert caplog.text.count("nothing is cleared away meanwhile") == 1
    service.close()


def test_an_apartment_that_was_away_is_kept_again_when_something_is_stored(
    storage: Storage, database: Database
) -> None:
    service = History(lambda: open_storage(database.address), LINES)
    now = T0 + 40.0 * DAY
    service.tick(now)
    now = rounds(service, now, now + DAY)
    assert count(storage, "sample", "num IS NOT NULL") == 10 * DAY // 60 + 1
    storage.write(Batch([Sample("Light", round(now * US), 0.0, "OFF")]))
    rounds(service, now, now + 2 * ROUND_EVERY_S)
    assert [one.num for one in storage.samples("Temp")] == [float((T0 + 10 * DAY - 60) // 60 % 100)]  # its newest
    service.close()


@pytest.mark.parametrize(
    ("keep", "told"),
    [
        ({"items": ["Nothing"], "raw": "1d"}, "expected an item"),
        ({"items": ["*"], "raw": "soon"}, "expected a length"),
        ({"items": ["*"], "raw": "0d"}, "expected a length"),
        ({"items": ["*"], "raw": "1d", "means": {"1h": "5m"}}, "expected a longer time than 1h"),
        ({"items": [], "raw": "1d"}, "at least 1 item"),
    ],
)
def test_a_line_that_cannot_be_kept_is_told(keep: dict[str, object], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        Config.model_validate({"url": "sqlite:///x.db", "home": HOME, "keep": [keep]})
