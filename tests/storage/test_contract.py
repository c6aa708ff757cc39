"""What every storage promises, on SQLite and on a real MariaDB."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from services.errors import BadMessage
from services.payloads import FINAL
from services.storage import (
    FINAL_STATES,
    Batch,
    CameraOrder,
    Diagnostic,
    Item,
    Mission,
    Sample,
    Scan,
    Sighting,
    Storage,
    open_storage,
    reading,
)
from tests.databases import Database

T0 = 1_769_839_200_000_000  # 2026-01-31 06:00 UTC
MINUTE = 60_000_000
LAB = Item("Lab_Temp", "Number", "°C")
LIGHT = Item("Kitchen_Light", "Switch")
NOTE = Item("Note", "String")


@pytest.fixture
def storage(database: Database) -> Iterator[Storage]:
    storage = open_storage(database.address)
    storage.add_items([LAB, LIGHT, NOTE])
    yield storage
    storage.close()


def test_samples_come_back_as_they_were(storage: Storage) -> None:
    samples = [
        Sample("Lab_Temp", T0, 21.5, None),
        Sample("Lab_Temp", T0 + 1, -0.1, None),
        Sample("Lab_Temp", T0 + 2, None, "UNDEF"),
        Sample("Lab_Temp", T0 + 3, 1e300, None),
    ]
    storage.write(Batch(samples=samples))
    assert storage.samples("Lab_Temp") == samples
    assert storage.last("Lab_Temp") == samples[-1]


@pytest.mark.parametrize(
    "text", ["21.5 °C", "Salón", "日本", "🏠 home 🔥", 'it\'s "quoted" \\ % ? ;--', "", "line\nline", "x" * 262_144]
)
def test_any_text_comes_back_whole(storage: Storage, text: str) -> None:
    storage.write(Batch(samples=[Sample("Note", T0, None, text)]))
    assert storage.last("Note") == Sample("Note", T0, None, text)


def test_writing_a_batch_again_changes_nothing(storage: Storage, database: Database) -> None:
    batch = Batch(
        samples=[Sample("Lab_Temp", T0, 21.5, None), Sample("Kitchen_Light", T0, 1.0, "ON")],
        rows=[
            Sighting("s1", "ip1", 582, "DICT_5X5_1000", "Kitchen", T0, x=1.0),
            Scan("s1", "ip1", "done", "582", "582", T0, T0 + MINUTE, 8, 8),
            CameraOrder("o1", "ip1", "Goto", "Kitchen", "done", None, T0),
            Mission("m1", "tiago", 582, "found", "", "Sofa", 1.0, 2.0, 0.5, "tiago", T0, T0 + MINUTE, "[]"),
            Diagnostic("camera/ip1", T0, 0, "fine", None),
        ],
    )
    storage.write(batch)
    before = content(database)
    storage.write(batch)
    assert content(database) == before
    assert [len(rows) for rows in before] == [2, 1, 1, 1, 1, 1]


def content(database: Database) -> list[list[object]]:
    """Every row of the tables that batches go to."""
    tables = ("sample", "sighting", "scan", "camera_order", "mission", "diagnostic")
    return [list(database.rows(f"SELECT * FROM {table} ORDER BY 1, 2")) for table in tables]


def test_a_batch_is_written_whole_or_not_at_all(storage: Storage) -> None:
    bad = Diagnostic("camera/ip1", T0, None, "no level", None)  # type: ignore[arg-type]
    with pytest.raises(BadMessage, match="refuses a value"):
        storage.write(Batch(samples=[Sample("Lab_Temp", T0, 21.5, None)], rows=[bad]))
    assert storage.samples("Lab_Temp") == []
    storage.write(Batch(samples=[Sample("Lab_Temp", T0, 22.0, None)]))
    assert storage.last("Lab_Temp") == Sample("Lab_Temp", T0, 22.0, None)


def test_a_range_holds_its_start_and_not_its_end_and_a_limit_keeps_the_newest(storage: Storage) -> None:
    samples = [Sample("Lab_Temp", T0 + n * MINUTE, float(n), None) for n in range(10)]
    storage.write(Batch(samples=samples))
    assert storage.samples("Lab_Temp", since=T0 + 2 * MINUTE, until=T0 + 5 * MINUTE) == samples[2:5]
    assert storage.samples("Lab_Temp", since=T0, limit=3) == samples[-3:]
    assert storage.samples("Lab_Temp", until=T0) == []
    assert storage.samples("Nobody") == []
    assert storage.last("Nobody") is None


def test_last_values_and_last_diagnostics_are_the_newest_of_each(storage: Storage) -> None:
    storage.write(
        Batch(
            samples=[
                Sample("Lab_Temp", T0, 20.0, None),
                Sample("Kitchen_Light", T0 + 1, 1.0, "ON"),
                Sample("Lab_Temp", T0 + 2, 21.0, None),
            ],
            rows=[Diagnostic("a", T0, 0, "fine", None), Diagnostic("a", T0 + 1, 2, "no answer", '{"x": 1}')],
        )
    )
    assert storage.last_values() == {
        "Lab_Temp": Sample("Lab_Temp", T0 + 2, 21.0, None),
        "Kitchen_Light": Sample("Kitchen_Light", T0 + 1, 1.0, "ON"),
    }
    assert storage.last_diagnostics() == {"a": Diagnostic("a", T0 + 1, 2, "no answer", '{"x": 1}')}


def test_sightings_of_a_marker_come_newest_first(storage: Storage) -> None:
    sightings = [
        Sighting("s1", "ip1", 582, "DICT_5X5_1000", "Kitchen", T0 + n, T0, 1.5, -2.0, 0.5, sx=0.01, frames=n, why="é")
        for n in range(5)
    ]
    storage.write(Batch(rows=[*sightings, replace(sightings[0], marker=17, stamp=T0 + 99)]))
    assert storage.sightings(582, 2) == [sightings[4], sightings[3]]
    assert storage.sightings(1, 2) == []


def test_a_scan_follows_its_states_until_it_has_ended(storage: Storage, database: Database) -> None:
    scan = Scan("s1", "ip1", "running", "582", "", T0, None, 1, 0)
    storage.write(Batch(rows=[scan, replace(scan, frames_taken=5, started=T0 + 7)]))
    storage.write(Batch(rows=[replace(scan, state="done", found="582", frames_taken=8, ended=T0 + MINUTE)]))
    storage.write(Batch(rows=[replace(scan, state="running"), replace(scan, state="failed", ended=T0 + 2 * MINUTE)]))
    rows = database.rows("SELECT state, found, frames_taken FROM scan")
    assert rows == [("done", "582", 8)]
    seconds = {"sqlite": "(ended-started)/1000000", "mariadb": "TIMESTAMPDIFF(SECOND,started,ended)"}[database.kind]
    assert database.rows(f"SELECT {seconds} FROM scan") == [(60,)]


def test_an_order_ends_in_the_states_in_which_it_ends_on_the_bus() -> None:
    assert FINAL_STATES == FINAL


def test_a_mission_follows_its_states_until_it_has_ended(storage: Storage) -> None:
    going = Mission("m1", "tiago", 582, "go", "to Sofa", "Sofa", None, None, None, None, T0, None, None)
    found = replace(going, state="found", reason="seen", x=1.5, y=2.0, z=0.5, seen_by="tiago", ended=T0 + MINUTE)
    storage.write(Batch(rows=[replace(going, state="look", place=None), going]))
    assert reading.missions(storage, 0, T0 + MINUTE, 9) == [going]
    storage.write(Batch(rows=[replace(going, state="scan", place=None)]))
    assert reading.missions(storage, 0, T0 + MINUTE, 9) == [replace(going, state="scan")]
    storage.write(Batch(rows=[replace(found, story='[[0, "go", "to Sofa"]]')]))
    storage.write(Batch(rows=[going, replace(found, state="failed", place="Hall", ended=T0 + 2 * MINUTE)]))
    assert reading.missions(storage, 0, T0 + MINUTE, 9) == [replace(found, story='[[0, "go", "to Sofa"]]')]


def test_the_newest_missions_of_a_span_are_told_oldest_first(storage: Storage) -> None:
    one = Mission("m0", "tiago", 1, "found", None, None, None, None, None, None, T0, T0, None)
    storage.write(Batch(rows=[replace(one, mission=f"m{n}", started=T0 + n * MINUTE) for n in range(5)]))
    told = reading.missions(storage, T0 + MINUTE, T0 + 4 * MINUTE, 2)
    assert [mission.mission for mission in told] == ["m2", "m3"]


def test_an_order_keeps_its_first_time_and_its_final_state(storage: Storage, database: Database) -> None:
    order = CameraOrder("o1", "ip1", "Goto", "Kitchen", "accepted", None, T0)
    failed = replace(order, state="failed", error="no such place")
    storage.write(Batch(rows=[order, replace(order, state="running")]))
    assert database.rows("SELECT state, error FROM camera_order") == [("running", None)]
    storage.write(Batch(rows=[failed, order, replace(failed, state="done", error=None)]))
    assert database.rows("SELECT state, error FROM camera_order") == [("failed", "no such place")]


def test_an_id_may_be_used_again_by_another_and_on_another_day(storage: Storage, database: Database) -> None:
    order = CameraOrder("a", "ip1", "Goto", "Kitchen", "done", None, T0)
    others = [replace(order, camera="ip2"), replace(order, order_id="A"), replace(order, at=T0 + MINUTE)]
    mission = Mission("a", "tiago", 1, "found", None, None, None, None, None, None, T0, T0, None)
    more = [replace(mission, robot="rosie"), replace(mission, mission="A"), replace(mission, started=T0 + MINUTE)]
    for _ in range(2):
        storage.write(Batch(rows=[order, *others, mission, *more]))
    assert database.rows("SELECT COUNT(*) FROM camera_order") == [(4,)]
    assert database.rows("SELECT COUNT(*) FROM mission") == [(4,)]
    running = replace(order, state="running", at=T0 + 9)
    storage.write(Batch(rows=[running]))
    assert reading.open_orders(storage) == [("ip1", "a", T0 + 9)]
    assert reading.newest_missions(storage, 1) == [more[-1]]


def test_items_are_made_once_and_keep_their_id_and_unit(storage: Storage, database: Database) -> None:
    ids = {name: item.item_id for name, item in storage.items.items()}
    storage.add_items([LAB, Item("Lab_Temp", "Number", "°F"), Item("lab_temp", "String"), Item("Note", "String", "m")])
    assert {name: ids[name] for name in ids} == {name: storage.items[name].item_id for name in ids}
    assert storage.items["Lab_Temp"].unit == "°C"
    assert storage.items["Note"].unit == "m"
    assert storage.items["lab_temp"].item_id not in ids.values()
    assert (
        len(database.rows("SELECT * FROM Items" if database.kind == "sqlite" else "SELECT * FROM OpenHAB.Items")) == 4
    )


VIEWS = [
    ("Number", Sample("X", T0, 21.5, None), 21.5),
    ("Dimmer", Sample("X", T0, 60.0, None), 60),
    ("Rollershutter", Sample("X", T0, 100.0, None), 100),
    ("Switch", Sample("X", T0, 1.0, "ON"), "ON"),
    ("Contact", Sample("X", T0, 1.0, "OPEN"), "OPEN"),
    ("Color", Sample("X", T0, 50.0, "120,100,50"), "120,100,50"),
    ("String", Sample("X", T0, None, "Salón"), "Salón"),
    ("DateTime", Sample("X", T0, 1769839200250000.0, "2026-01-31T06:00:00.250Z"), "2026-01-31 06:00:00.250"),
    ("Location", Sample("X", T0, None, "40.4,-3.7"), "40.4,-3.7"),
    ("Player", Sample("X", T0, 1.0, "PLAY"), "PLAY"),
]


@pytest.mark.parametrize(("kind", "sample", "value"), VIEWS, ids=[row[0] for row in VIEWS])
def test_each_kind_is_seen_as_openhab_wrote_it(database: Database, kind: str, sample: Sample, value: object) -> None:
    storage = open_storage(database.address)
    storage.add_items([Item("X", kind)])
    storage.write(Batch(samples=[sample, Sample("X", T0 + 1, None, "UNDEF"), Sample("X", T0 + 2, None, "NULL")]))
    storage.close()
    ((seen,),) = database.rows("SELECT Value FROM Item1", reader=True)
    if kind == "DateTime":
        assert str(seen)[14:23] == str(value)[14:23]  # minutes and below: the same in every zone of full hours
        assert len(str(seen).rstrip("0")) == len("2026-01-31 06:00:00.25")
    else:
        assert (seen, type(seen)) == (value, type(value))


def test_an_item_of_another_kind_gets_another_view(storage: Storage, database: Database) -> None:
    storage.write(Batch(samples=[Sample("Note", T0, 3.0, "3")]))
    storage.add_items([Item("Note", "Number")])
    view = f"Item{storage.items['Note'].item_id}"
    assert database.rows(f"SELECT Value FROM {view}", reader=True) == [(3.0,)]


def test_what_was_written_is_there_for_the_next_who_opens(storage: Storage, database: Database) -> None:
    storage.write(Batch(samples=[Sample("Lab_Temp", T0, 21.5, None)]))
    storage.close()
    again = open_storage(database.address)
    assert again.last("Lab_Temp") == Sample("Lab_Temp", T0, 21.5, None)
    assert again.items["Lab_Temp"].unit == "°C"
    assert database.rows("SELECT MAX(version) FROM schema_version") == [(4,)]
    again.close()


def test_twenty_thousand_rows_of_a_thousand_items_are_written_in_batches(storage: Storage, database: Database) -> None:
    storage.add_items(Item(f"I{n}", "Number") for n in range(1000))
    for start in range(0, 20_000, 1000):
        samples = [Sample(f"I{n % 1000}", T0 + n, n / 7, None) for n in range(start, start + 1000)]
        storage.write(Batch(samples=samples))
    assert database.rows("SELECT COUNT(*) FROM sample") == [(20_000,)]


def test_a_batch_larger_than_a_packet_is_written(storage: Storage) -> None:
    texts = [f"{n}" + "ä" * 200_000 for n in range(30)]  # 12 MB of UTF-8
    storage.write(Batch(samples=[Sample("Note", T0 + n, None, text) for n, text in enumerate(texts)]))
    assert [sample.text for sample in storage.samples("Note")] == texts
