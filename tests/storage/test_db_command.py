"""`apartment db`: databases and accounts made on a real server, versions both ways, OpenHAB's own tables in and out."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pymysql
import pytest
from typer.testing import CliRunner

from services.__main__ import app
from services.errors import ConfigError
from services.peers import mariadb
from services.storage import (
    Batch,
    CameraOrder,
    Item,
    Mission,
    Sample,
    open_plain,
    open_storage,
    read_address,
    reading,
    upkeep,
)
from services.storage.migrate import back, versions
from tests.databases import Database, MariaDb, connected, fresh_mariadb
from tests.persistence.test_service import url

HOME = """timezone: Europe/Madrid
items:
  Lab_Temp: {type: "Number:Temperature", label: Lab, unit: °C}
  Kitchen_Light: {type: Switch, label: Light}
  Front_Door: {type: Contact, label: Door}
  Hall_Dimmer: {type: Dimmer, label: Hall}
  Door_Opened: {type: DateTime, label: Opened}
  Note: {type: String, label: Note}
"""
# As OpenHAB 2.4 leaves them behind, by its documented schema; an hour of local time is there twice in October.
OLD_LAYOUT = """
CREATE TABLE Items (ItemId INT NOT NULL AUTO_INCREMENT,ItemName VARCHAR(200) NOT NULL,PRIMARY KEY (ItemId));
INSERT INTO Items VALUES (1,'Lab_Temp'),(2,'Kitchen_Light'),(3,'Front_Door'),(4,'Hall_Dimmer');
INSERT INTO Items VALUES (7,'Door_Opened'),(9,'Gone_Item');
CREATE TABLE Item1 (Time DATETIME, Value DOUBLE, PRIMARY KEY(Time));
INSERT INTO Item1 VALUES ('2018-06-01 12:00:00',21.5),('2018-10-28 02:30:00',20.25),('2018-12-01 12:00:00',-3);
CREATE TABLE Item2 (Time DATETIME, Value CHAR(3), PRIMARY KEY(Time));
INSERT INTO Item2 VALUES ('2018-12-01 12:00:01','ON'),('2018-12-01 12:00:02','OFF');
CREATE TABLE Item3 (Time DATETIME, Value VARCHAR(6), PRIMARY KEY(Time));
INSERT INTO Item3 VALUES ('2018-12-01 12:00:01','OPEN'),('2018-12-01 12:00:02','CLOSED');
CREATE TABLE Item4 (Time DATETIME, Value TINYINT, PRIMARY KEY(Time));
INSERT INTO Item4 VALUES ('2018-12-01 12:00:01',60),('2018-12-01 12:00:02',0);
CREATE TABLE Item7 (Time DATETIME, Value DATETIME, PRIMARY KEY(Time));
INSERT INTO Item7 VALUES ('2018-12-01 12:00:01','2018-12-01 11:59:00');
CREATE TABLE Item9 (Time DATETIME, Value VARCHAR(6), PRIMARY KEY(Time));
INSERT INTO Item9 VALUES ('2018-12-01 12:00:01','ON'),('2018-12-01 12:00:02','OFF')
"""
# As the JDBC service makes them: one default name, one with the item's name, TIMESTAMP(3).
JDBC_LAYOUT = """
CREATE TABLE items (ItemId INT NOT NULL AUTO_INCREMENT, itemname VARCHAR(500) NOT NULL, PRIMARY KEY (ItemId));
INSERT INTO items VALUES (1,'Lab_Temp'),(2,'Kitchen_Light'),(3,'Note'),(4,'Door_Opened');
CREATE TABLE item0001 (TIME, value DOUBLE, PRIMARY KEY(time));
INSERT INTO item0001 VALUES ('2024-06-01 10:00:00.125',21.5),('2024-10-27 00:30:00',20.25),('2024-10-27 01:30:00',20.5);
CREATE TABLE kitchen_light_0002 (TIME, value VARCHAR(6), PRIMARY KEY(time));
INSERT INTO kitchen_light_0002 VALUES ('2024-06-01 10:00:00','ON');
CREATE TABLE note_0003 (TIME, value VARCHAR(16255), PRIMARY KEY(time));
INSERT INTO note_0003 VALUES ('2024-06-01 10:00:00','Salón '' 日本 😀');
CREATE TABLE item0004 (TIME, value TIMESTAMP(3) NULL, PRIMARY KEY(time));
INSERT INTO item0004 VALUES ('2024-06-01 10:00:00','2024-06-01 09:00:00');
CREATE TABLE somebody_elses (id INT PRIMARY KEY)
"""


def us(text: str) -> int:
    return round(datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp() * 1e6)


def run(config: Path, *words: str, code: int = 0, **environment: str) -> str:
    done = CliRunner(env=environment).invoke(app, ["db", *words, "--config", str(config)])
    assert done.exit_code == code, (done.output, done.exception)
    return done.output


def configured(folder: Path, address: str, password: str | None = None) -> Path:
    (folder / "home.yaml").write_text(HOME)
    config = folder / "apartment.yaml"
    secret = f", password: '{password}'" if password else ""
    config.write_text(f"home: home.yaml\npersistence: {{url: '{address}'{secret}}}\n")
    return config


@pytest.fixture
def site(database: Database, tmp_path: Path) -> Path:
    return configured(tmp_path, url(database.address), database.address.password)


@pytest.fixture
def openhab(mariadb_server: mariadb.Server) -> Iterator[Any]:
    """Makes a database as an OpenHAB left it, and gives its address."""
    name = "old_openhab"

    def made(script: str) -> str:
        script = script.replace("(TIME,", "(time TIMESTAMP(3) NOT NULL DEFAULT CURRENT_TIMESTAMP(3),")
        with connected(mariadb_server, mariadb_server.admin, "", None) as admin:
            admin.query(f"CREATE DATABASE {name} CHARACTER SET utf8mb4")
            admin.select_db(name)
            admin.query("SET time_zone='+00:00'")
            for statement in filter(str.strip, script.split(";\n")):
                admin.query(statement)
            admin.commit()
        return f"mysql://{mariadb_server.admin}@localhost/{name}?socket={mariadb_server.socket}"

    yield made
    with connected(mariadb_server, mariadb_server.admin, "", None) as admin:
        admin.query(f"DROP DATABASE IF EXISTS {name}")


def samples(database: Database, item: str) -> list[tuple[int, float | None, str | None]]:
    storage = open_storage(database.address)
    found = [(one.time, one.num, one.text) for one in storage.samples(item)]
    storage.close()
    return found


@pytest.mark.mariadb
def test_tables_of_the_old_binding_are_imported_whole(database: Database, site: Path, openhab: Any) -> None:
    source = openhab(OLD_LAYOUT)
    told = json.loads(run(site, "import", source, "--json"))
    assert {one["item"]: (one["read"], one["odd"]) for one in told} == {
        "Lab_Temp": (3, 0), "Kitchen_Light": (2, 0), "Front_Door": (2, 0), "Hall_Dimmer": (2, 0),
        "Door_Opened": (1, 0), "Gone_Item": (2, 0),
    }  # fmt: skip
    assert samples(database, "Lab_Temp") == [  # Madrid's clock: +02:00 in summer, and in the first of the double hours
        (us("2018-06-01 10:00:00"), 21.5, None), (us("2018-10-28 00:30:00"), 20.25, None),
        (us("2018-12-01 11:00:00"), -3.0, None),
    ]  # fmt: skip
    assert samples(database, "Front_Door") == [
        (us("2018-12-01 11:00:01"), 1.0, "OPEN"), (us("2018-12-01 11:00:02"), 0.0, "CLOSED"),
    ]  # fmt: skip
    assert [row[1] for row in samples(database, "Hall_Dimmer")] == [60.0, 0.0]
    opened = us("2018-12-01 10:59:00")
    assert samples(database, "Door_Opened")[0][1:] == (opened, "2018-12-01T11:59:00.000+0100")
    storage = open_storage(database.address)
    assert {name: (item.kind, item.unit) for name, item in storage.items.items()} == {
        "Lab_Temp": ("Number", "°C"), "Kitchen_Light": ("Switch", None), "Front_Door": ("Contact", None),
        "Hall_Dimmer": ("Dimmer", None), "Door_Opened": ("DateTime", None), "Gone_Item": ("Switch", None),
    }  # fmt: skip
    storage.close()
    run(site, "import", source)
    assert len(samples(database, "Lab_Temp")) == 3  # again: nothing twice


@pytest.mark.mariadb
def test_tables_of_the_jdbc_service_are_imported_whole(database: Database, site: Path, openhab: Any) -> None:
    told = run(site, "import", openhab(JDBC_LAYOUT))
    assert "kitchen_light_0002  Kitchen_Light  1 rows" in told
    assert samples(database, "Lab_Temp") == [
        (us("2024-06-01 10:00:00.125"), 21.5, None), (us("2024-10-27 00:30:00"), 20.25, None),
        (us("2024-10-27 01:30:00"), 20.5, None),
    ]  # fmt: skip
    assert samples(database, "Note")[0][2] == "Salón ' 日本 😀"
    assert samples(database, "Door_Opened")[0][1] == us("2024-06-01 09:00:00")


def test_a_jdbc_file_of_sqlite_with_the_items_names_is_imported(site: Path, database: Database, tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "openhab.db")) as made, made:
        made.execute("CREATE TABLE Kitchen_Light (time TIMESTAMP NOT NULL, value VARCHAR(6), PRIMARY KEY(time))")
        made.execute("INSERT INTO Kitchen_Light VALUES ('2024-06-01 12:00:00.500', 'ON')")
    run(site, "import", f"sqlite:///{tmp_path}/openhab.db")
    assert samples(database, "Kitchen_Light") == [(us("2024-06-01 10:00:00.5"), 1.0, "ON")]


def test_forecasts_are_left_out_of_an_import_and_counted(site: Path, database: Database, tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "openhab.db")) as made, made:
        made.execute("CREATE TABLE Lab_Temp (time TIMESTAMP NOT NULL, value DOUBLE, PRIMARY KEY(time))")
        for days in (-2, -1, 1, 2, 1000):
            at = datetime.now(UTC) + timedelta(days=days)
            made.execute("INSERT INTO Lab_Temp VALUES (?, ?)", (f"{at:%Y-%m-%d %H:%M:%S}", days))
    source = f"sqlite:///{tmp_path}/openhab.db"
    (told,) = json.loads(run(site, "import", source, "--json"))
    assert (told["read"], told["future"]) == (5, 3)
    assert "5 rows, 3 whose time has not come left out" in run(site, "import", source)
    assert [row[1] for row in samples(database, "Lab_Temp")] == [-2.0, -1.0]


@pytest.mark.mariadb
def test_a_long_table_is_imported_in_pieces(
    database: Database, site: Path, openhab: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.persistence.openhab_tables.PIECE", 7)
    rows = ",".join(f"('2024-06-01 10:{n // 60:02d}:{n % 60:02d}',{n})" for n in range(100))
    source = openhab(
        "CREATE TABLE Items (ItemId INT PRIMARY KEY, ItemName VARCHAR(200));\n"
        "INSERT INTO Items VALUES (1,'Lab_Temp');\n"
        f"CREATE TABLE Item1 (Time DATETIME, Value DOUBLE, PRIMARY KEY(Time));\nINSERT INTO Item1 VALUES {rows}"
    )
    run(site, "import", source)
    assert [row[1] for row in samples(database, "Lab_Temp")] == [float(n) for n in range(100)]


@pytest.mark.mariadb
@pytest.mark.parametrize("layout", ["jdbc", "mysql"])
def test_what_is_exported_can_be_imported_again(
    mariadb_server: mariadb.Server, tmp_path: Path, openhab: Any, layout: str
) -> None:
    ours = configured(tmp_path, f"sqlite:///{tmp_path}/bus.db")
    storage = open_storage("sqlite:///bus.db", tmp_path)
    storage.add_items([Item("Lab_Temp", "Number", "°C"), Item("Kitchen_Light", "Switch"), Item("Hall_Dimmer", "Dimmer"),
                       Item("Door_Opened", "DateTime"), Item("Note", "String")])  # fmt: skip
    t, s = us("2024-06-01 10:00:00"), 1_000_000
    kept = {
        "Lab_Temp": [(t, 21.5, None), (t + s, -3.25, None)],
        "Kitchen_Light": [(t, 1.0, "ON"), (t + s, 0.0, "OFF")],
        "Hall_Dimmer": [(t, 60.0, None)],
        "Door_Opened": [(t, float(us("2024-06-01 09:00:00")), "2024-06-01T11:00:00.000+0200")],
        "Note": [(t, None, "O'Neill, 日本")],
    }
    storage.write(Batch([Sample(name, *row) for name, rows in kept.items() for row in rows]))
    storage.write(Batch([Sample("Lab_Temp", t + 2 * s, None, "UNDEF")]))
    storage.close()
    there = openhab("")
    run(ours, "export", there, "--layout", layout)
    run(ours, "export", there, "--layout", layout)
    (tmp_path / "again").mkdir()
    again = configured(tmp_path / "again", f"sqlite:///{tmp_path}/again.db")
    run(again, "import", there)
    back = open_storage("sqlite:///again.db", tmp_path)
    assert {name: [(one.time, one.num, one.text) for one in back.samples(name)] for name in kept} == kept
    back.close()


@pytest.mark.mariadb
def test_a_foreign_index_is_not_overwritten(openhab: Any, tmp_path: Path) -> None:
    ours = configured(tmp_path, f"sqlite:///{tmp_path}/bus.db")
    storage = open_storage("sqlite:///bus.db", tmp_path)
    storage.add_items([Item("Note", "String")])
    storage.close()
    done = CliRunner().invoke(app, ["db", "export", openhab(OLD_LAYOUT), "--config", str(ours)])
    assert isinstance(done.exception, ConfigError)
    assert "the number of Note for another item" in str(done.exception)


def test_a_database_without_openhabs_tables_is_told(tmp_path: Path) -> None:
    config = configured(tmp_path, f"sqlite:///{tmp_path}/bus.db")
    sqlite3.connect(tmp_path / "empty.db").close()
    done = CliRunner().invoke(app, ["db", "import", f"sqlite:///{tmp_path}/empty.db", "--config", str(config)])
    assert "expected OpenHAB's tables" in str(done.exception)


def test_the_schema_goes_back_and_forth_and_keeps_the_rows(database: Database, site: Path) -> None:
    run(site, "init") if database.kind == "sqlite" else open_storage(database.address).close()
    storage = open_storage(database.address)
    storage.add_items([Item("Note", "String")])
    storage.write(Batch([Sample("Note", us("2026-01-31 07:00:00"), None, "kept")]))
    orders = [
        CameraOrder(which, "ip1", "Goto", "Sofa", "done", None, us(at))
        for which, at in [("a", "2026-01-31 07:00:00"), ("a", "2026-01-31 08:00:00"), ("b", "2026-01-31 07:00:00")]
    ]
    mission = Mission("a", "tiago", 1, "found", "", None, 1.0, None, None, None, us("2026-01-31 07:00:00"), None, "[]")
    missions = [mission, replace(mission, started=us("2026-01-31 09:00:00"))]
    storage.write(Batch(rows=[*orders, *missions]))
    storage.close()
    assert "from schema version 4 to 3" in run(site, "upgrade", "--to", "3")
    assert database.rows("SELECT COUNT(*) FROM camera_order") == [(2,)]  # that program knows an id once
    assert "schema version 4" in run(site, "upgrade")
    storage = open_storage(database.address)
    assert reading.newest_missions(storage, 9) == missions[1:]
    assert database.rows("SELECT order_id FROM camera_order ORDER BY at") == [("b",), ("a",)]
    storage.close()
    newest = max(versions(database.address.dialect))
    assert f"from schema version {newest} to 1" in run(site, "upgrade", "--to", "1")
    assert database.rows("SELECT MAX(version) FROM schema_version") == [(1,)]
    assert database.rows("SELECT COUNT(*) FROM mqtt_session") == [(0,)]
    assert f"schema version {newest}" in run(site, "upgrade")
    assert [row[2] for row in samples(database, "Note")] == ["kept"]
    assert database.rows("SELECT Value FROM Item1", reader=True) == [("kept",)]
    with pytest.raises(ConfigError, match="expected a version from 1"):
        upkeep.take_back(database.address, 0)


@pytest.mark.mariadb
@pytest.mark.parametrize("done", range(len(dict(back("mysql", 4, 3))[4])))
def test_a_way_back_that_stopped_half_way_is_finished(mariadb_server: mariadb.Server, done: int) -> None:
    """As after a power cut: no statement on the way takes the only copy of a row, and all may be said again."""
    database = fresh_mariadb(mariadb_server)
    order = CameraOrder("a", "ip1", "Goto", "Sofa", "done", None, us("2026-01-31 07:00:00"))
    mission = Mission("a", "tiago", 1, "found", "", None, 1.0, None, None, None, us("2026-01-31 07:00:00"), None, "[]")
    with closing(open_storage(database.address)) as storage:
        storage.write(Batch(rows=[order, mission]))
    with closing(open_plain(database.address)) as storage:
        for statement in dict(back("mysql", 4, 3))[4][:done]:
            storage.change(statement)
    assert upkeep.take_back(database.address, 3) == 4
    assert database.rows("SELECT order_id, value FROM camera_order") == [("a", "Sofa")]
    assert database.rows("SELECT mission, state FROM mission") == [("a", "found")]
    assert not [name for (name,) in database.rows("SHOW TABLES") if name.endswith(("_3", "_4"))]


def test_check_tells_what_is_well(database: Database, site: Path) -> None:
    open_storage(database.address).close()
    found = json.loads(CliRunner().invoke(app, ["db", "check", "--json", "--config", str(site)]).output)
    assert {"good": True, "what": "0 items"} in found
    bad = [one["what"] for one in found if not one["good"]]
    assert bad == [] or bad == [f"named time zones are missing: {upkeep.ZONES}"]


def test_check_names_rows_whose_time_has_not_come(database: Database, site: Path) -> None:
    storage = open_storage(database.address)
    storage.add_items([Item("Lab_Temp", "Number"), Item("Note", "String")])
    now = round(time.time() * 1e6)
    rows = [Sample("Lab_Temp", us("2037-01-31 07:00:00"), 1.0, None), Sample("Note", now + 60_000_000, None, "soon")]
    storage.write(Batch(rows))
    storage.close()
    told = run(site, "check", code=1)
    assert "BAD   rows whose time has not come, which nobody goes by: Lab_Temp (2037-01-31T07:00:00Z)\n" in told


@pytest.mark.mariadb
class TestAccounts:
    def test_databases_and_the_writers_account_are_made_and_a_reader_sees_the_views_alone(
        self, mariadb_server: mariadb.Server, tmp_path: Path
    ) -> None:
        server = mariadb_server
        address = f"mysql://new_writer@localhost/new_bus?socket={server.socket}"
        config = configured(tmp_path, address, "writer-secret")
        config.write_text(config.read_text().replace("persistence: {", "persistence: {view_database: new_views, "))
        admin = ("--admin", server.admin)
        try:
            assert "ready" in run(config, "init", *admin)
            run(config, "init", *admin)
            told = run(config, "grant", "grafana", *admin, READER_PASSWORD="it's secret")
            assert "secret" not in told
            with connected(server, "grafana", "it's secret", "new_views") as reader, reader.cursor() as cursor:
                cursor.execute("SELECT * FROM Items")
                with pytest.raises(pymysql.err.OperationalError, match="1142"):
                    cursor.execute("SELECT * FROM new_bus.item")
            run(config, "grant", "grafana", "--host", "192.0.2.%", *admin, READER_PASSWORD="x")
            with connected(server, server.admin, "", None) as root, root.cursor() as cursor:
                cursor.execute("SHOW CREATE USER grafana@`192.0.2.%`")
                assert "REQUIRE SSL" in cursor.fetchone()[0]
        finally:
            with connected(server, server.admin, "", None) as root:
                for statement in ("DATABASE IF EXISTS new_bus", "DATABASE IF EXISTS new_views",
                                  "USER IF EXISTS new_writer@localhost", "USER IF EXISTS grafana@localhost",
                                  "USER IF EXISTS grafana@`192.0.2.%`"):  # fmt: skip
                    root.query(f"DROP {statement}")

    def test_new_passwords_of_the_configuration_are_given_to_the_accounts(
        self, mariadb_server: mariadb.Server, tmp_path: Path
    ) -> None:
        """As after `apartment secrets init --force`."""
        server, where = mariadb_server, f"localhost/forced?socket={mariadb_server.socket}"
        config = configured(tmp_path, f"mysql://w@{where}", "old_w")
        config.write_text(
            config.read_text().replace("persistence: {", "persistence: {view_database: ForcedViews, ")
            + f"history: {{url: 'mysql://r@{where}', password: old_r, keeper: {{user: k, password: old_k}}}}\n"
        )
        try:
            run(config, "init", "--admin", server.admin)
            config.write_text(config.read_text().replace("old_", "new_"))
            run(config, "init", "--admin", server.admin)
            for user in "wrk":
                with connected(server, user, f"new_{user}", "forced"):
                    pass
                with pytest.raises(pymysql.err.OperationalError, match="1045"):
                    connected(server, user, f"old_{user}", "forced")
        finally:
            with connected(server, server.admin, "", None) as root:
                for what in ("DATABASE IF EXISTS forced", "DATABASE IF EXISTS ForcedViews",
                             "USER IF EXISTS w@localhost, r@localhost, k@localhost"):  # fmt: skip
                    root.query(f"DROP {what}")

    def test_an_account_that_needs_no_password_goes_on_without_one(self, mariadb_server: mariadb.Server) -> None:
        server = mariadb_server
        writer = read_address(f"mysql://by_socket@localhost/{server.database}?socket={server.socket}")
        with connected(server, server.admin, "", None) as root, root.cursor() as cursor:
            cursor.execute("CREATE USER by_socket@localhost IDENTIFIED VIA unix_socket")
            try:
                upkeep.make_databases(writer, upkeep.administrator(writer, server.admin, None))
                cursor.execute("SHOW CREATE USER by_socket@localhost")
                assert "VIA unix_socket" in cursor.fetchone()[0]
            finally:
                cursor.execute("DROP USER by_socket@localhost")

    def test_a_name_that_is_no_name_is_refused(self, mariadb_server: mariadb.Server) -> None:
        database: MariaDb = fresh_mariadb(mariadb_server)
        admin = upkeep.administrator(database.address, mariadb_server.admin, None)
        with pytest.raises(ConfigError, match="expected a name"):
            upkeep.let_read(database.address, admin, "x'; DROP", "secret")


def test_a_file_has_no_accounts(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no accounts"):
        upkeep.administrator(read_address("sqlite:///bus.db", folder=tmp_path), "root", None)
    with pytest.raises(ConfigError, match="there is no"):
        open_plain(read_address("sqlite:///nothing.db", folder=tmp_path))
