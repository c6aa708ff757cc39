"""What was, as the day of `tests/storage/day.py` has it, on both databases."""

from __future__ import annotations

import collections
import itertools
import random
import statistics
from collections.abc import Iterator

import pytest

from services.history.answers import answer
from services.payloads import stamp
from services.payloads.history import HistoryGet
from services.storage import Batch, Item, Sample, Storage, open_storage, reading
from tests.databases import Database, fresh_mariadb, fresh_sqlite
from tests.storage import day
from tests.storage.day import at
from tests.storage.test_queries import play_the_day

US = 1_000_000
NOW = at("10:00")


def us(clock: str) -> int:
    return round(at(clock) * US)


@pytest.fixture(scope="module", params=["sqlite", pytest.param("mariadb", marks=pytest.mark.mariadb)])
def storage(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Storage]:
    """The day, for questions that change nothing."""
    if request.param == "sqlite":
        played: Database = fresh_sqlite(tmp_path_factory.mktemp("day"))
    else:
        played = fresh_mariadb(request.getfixturevalue("mariadb_server"))
    play_the_day(played)
    opened = open_storage(played.address)
    yield opened
    opened.close()


@pytest.fixture
def own_storage(database: Database) -> Iterator[Storage]:
    """The day once more, for one test alone."""
    play_the_day(database)
    opened = open_storage(database.address)
    yield opened
    opened.close()


def clocks(samples: list[Sample]) -> list[tuple[str, object]]:
    """Times without the day, and the state."""
    return [(stamp(one.time / US)[11:-1].removesuffix(".000"), one.text or one.num) for one in samples]


def ask(storage: Storage, **question: object) -> object:
    reply = answer(storage, HistoryGet.model_validate({"id": "q", **question}), NOW)
    assert reply.error is None
    return reply


@pytest.mark.parametrize(
    ("item", "clock", "state"),
    [("Lab_Temp", "07:59:59", "UNDEF"), ("Lab_Temp", "07:00:01", 21.5), ("Lab_Temp", "07:00", 20.5),
     ("Kitchen_Light", "12:00", "OFF"), ("Cam1_Goto", "12:00", "Salón"), ("Cam1_Goto", "06:00", None)],
)  # fmt: skip
def test_the_state_before_a_time(storage: Storage, item: str, clock: str, state: object) -> None:
    found = reading.before(storage, storage.items[item], us(clock))
    assert (found and (found.text or found.num)) == state


def test_what_changed_between_two_times(storage: Storage) -> None:
    found, since = reading.changes(storage, us("07:10"), us("07:20"))
    assert since == us("07:10")
    assert [(one.item, *clocks([one])[0]) for one in found] == [
        ("Front_Door", "07:14:58", "OPEN"),
        ("Kitchen_Light", "07:15:00.250", "ON"),
        ("Front_Door", "07:15:02", "CLOSED"),
    ]


def test_a_repeated_value_is_no_change_even_at_the_beginning_of_a_span(storage: Storage) -> None:
    lab = [storage.items["Lab_Temp"]]
    assert clocks(reading.changes(storage, us("08:10"), us("09:30"), lab)[0]) == [("08:30:00.250", 21.0)]
    assert reading.changes(storage, us("08:59"), us("09:30"), lab) == ([], us("08:59"))
    assert reading.changes(storage, us("08:59"), us("09:30"), []) == ([], us("08:59"))


def test_where_more_is_stored_than_is_looked_at_it_is_said_from_when_on(storage: Storage) -> None:
    lab = [storage.items["Lab_Temp"]]
    found, since = reading.changes(storage, us("06:00"), us("09:30"), lab, limit=3)
    assert (clocks(found), since) == ([("08:30:00.250", 21.0)], us("08:00") + 1)
    found, since = reading.changes(storage, us("06:00"), us("09:30"), lab, limit=100)
    assert (len(found), since) == (6, us("06:00"))


@pytest.mark.parametrize("limit", [3, 4, 7])
def test_changes_asked_for_piece_by_piece_are_each_told_once(own_storage: Storage, limit: int) -> None:
    """Also those that a time in milliseconds cannot tell apart."""
    begin = us("09:10")
    times = [begin + step for step in (0, 1, 400, 1000, 1001, 2500, 60_000_000, 60_000_700)]
    wanted = [("ON", "OFF")[number % 2] for number in range(len(times))]
    own_storage.write(Batch([Sample("Kitchen_Light", at, None, told) for at, told in zip(times, wanted, strict=True)]))
    until, found = stamp(at("10:00")), list[tuple[str, object]]()
    while until is not None:
        question = {"item": "Kitchen_Light", "what": "changes", "since": stamp(at("09:00"))}
        reply = ask(own_storage, **question, until=until, limit=limit)
        found[:0] = [row for row in reply.samples if reply.since is None or row[0] >= reply.since]
        assert reply.since != until
        until = reply.since
    assert [told for _, told in found] == wanted


@pytest.mark.parametrize(
    ("item", "since", "until", "wanted"),
    [
        ("Kitchen_Light", "06:00", "09:00", {"ON": 7200, "OFF": 3000}),
        ("Kitchen_Light", "06:20", "06:30", {"ON": 600}),
        ("Kitchen_Light", "05:00", "06:00", {}),
        ("Front_Door", "07:14:58", "07:15:10", {"OPEN": 4, "CLOSED": 8}),
        ("Hall_Dimmer", "07:30", "08:30", {"60": 1800, "100": 1800}),
    ],
)
def test_how_long_in_which_state(storage: Storage, item: str, since: str, until: str, wanted: dict[str, float]) -> None:
    spent = {state: round(us_ / US, 3) for state, us_ in
             reading.durations(storage, storage.items[item], us(since), us(until)).items()}  # fmt: skip
    assert spent == wanted


def test_buckets_leave_out_what_is_no_number_and_empty_ones(storage: Storage) -> None:
    found = reading.buckets(storage, storage.items["Lab_Temp"], us("05:00"), us("10:00"), 7200)
    assert [(stamp(b.start / US)[11:16], b.n, b.lo, round(b.mean, 4), b.hi) for b in found] == [
        ("06:00", 3, 20, 20.6667, 21.5), ("08:00", 3, 21, 21.3333, 22),
    ]  # fmt: skip


def test_the_newest_samples_of_a_span_come_oldest_first(storage: Storage) -> None:
    reply = ask(storage, item="Lab_Temp", since=stamp(at("06:30")), until=stamp(at("09:00")), limit=2)
    assert reply.samples == [(stamp(at("08:00")), 22.0), ("2026-01-31T08:30:00.250Z", 21.0)]
    assert reply.unit == "°C"


def test_the_plain_question_of_the_contract(storage: Storage) -> None:
    reply = ask(storage, item="Kitchen_Light", since=None, until=None, limit=None, every=None)
    assert reply.samples == [
        (stamp(at(pair.split()[0])), pair.split()[1]) for pair in day.STATES["Kitchen_Light"].split("; ")
    ]


def test_every_gives_means_and_their_buckets(storage: Storage) -> None:
    reply = ask(storage, item="Hall_Dimmer", since=stamp(at("06:00")), until=stamp(at("09:00")), every=7200)
    assert reply.samples == [(stamp(at("06:00")), 30.0), (stamp(at("08:00")), 100.0)]
    assert reply.buckets[0] == (stamp(at("06:00")), 2, 0.0, 30.0, 60.0)


def test_durations_and_changes_by_question(storage: Storage) -> None:
    light = ask(storage, item="Kitchen_Light", what="durations", since=stamp(at("06:00")), until=stamp(at("09:00")))
    assert light.durations["ON"] == 7200.0
    changed = ask(storage, what="changes", since=stamp(at("08:40")), until=stamp(at("10:00")))
    assert changed.changes == [("Kitchen_Light", "2026-01-31T08:45:00.250Z", "OFF")]


WRONG = [
    ({"item": "Nothing"}, "nothing is stored of 'Nothing'"),
    ({"item": None}, "nothing is stored of None"),
    ({"item": "Lab_Temp", "since": "yesterday"}, "since: expected a time like"),
    ({"item": "Lab_Temp", "until": "2026-01-31T07:00:00"}, "until: expected a time like"),
    ({"item": "Lab_Temp", "since": "9999-12-31T23:59:59Z"}, "since: expected a time from 1970 to 2038"),
    ({"item": "Lab_Temp", "since": "2026-02-01T00:00:00Z", "until": "2026-01-31T00:00:00Z"}, "expected a time before"),
    ({"item": "Lab_Temp", "since": "2026-01-01T00:00:00Z", "every": 1}, "expected at most 5000 buckets"),
]


@pytest.mark.parametrize(("question", "told"), WRONG, ids=itertools.count())
def test_a_question_without_an_answer_is_told_why(storage: Storage, question: dict[str, object], told: str) -> None:
    reply = answer(storage, HistoryGet.model_validate({"id": "q", **question}), NOW)
    assert reply.samples == []
    assert told in (reply.error or "")


def test_kept_means_and_raw_rows_make_one_row_of_buckets(own_storage: Storage) -> None:
    """As after the job of `keeping.py`: the first two hours are means of 300 s, their samples are gone."""
    storage = own_storage
    lab = storage.items["Lab_Temp"]
    whole = reading.buckets(storage, lab, us("05:00"), us("10:00"), 3600)
    early = storage.samples("Lab_Temp", until=us("07:00"))
    values = ",".join(f"({lab.item_id},300,{s.time // US},1,{s.num},{s.num},{s.num},{s.num})" for s in early)
    storage.change(f"INSERT INTO summary VALUES {values}")
    sql = reading.DIALECTS[storage.dialect]
    storage.change(f"DELETE FROM sample WHERE item_id={lab.item_id} AND time<{sql.at(us('07:00'))}")
    assert reading.buckets(storage, lab, us("05:00"), us("10:00"), 3600) == whole
    assert reading.buckets(storage, lab, us("05:00"), us("10:00"), 700)[0].start > us("06:30")  # 300 does not divide it


def test_crowded_spans_and_empty_ones_are_counted_alike(own_storage: Storage) -> None:
    """So many in a bucket, and so many buckets, that each is asked for by its own range; then a night without any."""
    storage, item = own_storage, Item("Crowd", "Number")
    storage.add_items([item])
    begin, every, night = us("05:00"), 20 * US, range(130, 390)
    crowded, wide = reading.CROWD + 50, 5 * reading.PIECE
    rows = {
        begin + bucket * every + number * every // crowded: float(random.Random(number + bucket).randrange(-50, 50))
        for bucket in range(wide)
        if bucket not in night
        for number in range(crowded)
    }
    storage.write(Batch([Sample("Crowd", at_us, value, None) for at_us, value in rows.items()]))
    storage.write(Batch([Sample("Crowd", begin + 7, None, "UNDEF")]))
    since, until = begin + 3 * US, begin + wide * every - 3 * US
    expected = collections.defaultdict[int, list[float]](list)
    for at_us, value in rows.items():
        if since <= at_us < until:
            expected[at_us // every * every].append(value)
    found = reading.buckets(storage, storage.items["Crowd"], since, until, every // US)
    assert [(one.start, one.n, one.lo, one.hi) for one in found] == [
        (start, len(values), min(values), max(values)) for start, values in sorted(expected.items())
    ]
    assert [one.mean for one in found] == pytest.approx([statistics.fmean(expected[one.start]) for one in found])


def test_the_widest_of_several_widths_that_fits_is_taken(own_storage: Storage) -> None:
    """Told from each other by what their means say, which no sample does."""
    storage, lab = own_storage, own_storage.items["Lab_Temp"]
    for width in (60, 300, 3600):
        start = us("06:00") // US
        storage.change(f"INSERT INTO summary VALUES ({lab.item_id},{width},{start},1,{width},{width},{width},{width})")
    for every, mean in ((7200, 3600.0), (3600, 3600.0), (600, 300.0), (240, 60.0)):
        assert [one.mean for one in reading.buckets(storage, lab, us("06:00"), us("06:01"), every)] == [mean]


def test_an_item_that_another_process_made_is_found(own_storage: Storage, database: Database) -> None:
    other = open_storage(database.address)
    other.add_items([Item("New", "Number", "W")])
    other.write(Batch([Sample("New", us("09:00"), 5.0, None)]))
    other.close()
    assert ask(own_storage, item="New", what="last").samples == [(stamp(at("09:00")), 5.0)]
