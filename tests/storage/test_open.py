"""Addresses, versions of the schema, accounts: what must be right before the first row."""

from __future__ import annotations

import logging
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pymysql
import pytest

from services.errors import BadMessage, ConfigError, Unavailable
from services.peers import free_port, mariadb, wait_until
from services.storage import Batch, Item, Sample, open_storage, read_address
from services.storage.migrate import statements, versions
from tests.databases import Database, connected, fresh_mariadb

ADDRESSES = [
    ("sqlite:///bus.db", {"dialect": "sqlite", "path": Path("/site/bus.db")}),
    ("sqlite:///data/bus.db", {"path": Path("/site/data/bus.db")}),
    ("sqlite:////var/lib/bus.db", {"path": Path("/var/lib/bus.db")}),
    ("mysql://me@db.example/bus", {"dialect": "mysql", "host": "db.example", "port": 3306, "user": "me"}),
    ("mysql://me@127.0.0.1:3307/bus", {"host": "127.0.0.1", "port": 3307, "database": "bus"}),
    ("mysql://me@localhost/bus?socket=/run/m.sock", {"socket": "/run/m.sock", "ssl_ca": None}),
    ("mysql://me@db.example/bus?ssl_ca=/etc/ca.pem", {"ssl_ca": "/etc/ca.pem"}),
]
WRONG = [
    ("postgres://me@host/bus", "expected sqlite"),
    ("sqlite://bus.db", "expected sqlite:///FILE"),
    ("sqlite:///", "expected sqlite:///FILE"),
    ("mysql://host/bus", "got no user"),
    ("mysql://me@host/", "expected a name of letters"),
    ("mysql://me@host/bus`x", "expected a name of letters"),
    ("mysql://me:secret123@host/bus", "expected no password"),
    ("mysql://me@host/bus?charset=latin1", "expected one of socket"),
    ("mysql://me@host:99999/bus", "expected a port"),
    ("mysql://me@host/OpenHAB", "expected another database"),
]


@pytest.mark.parametrize(("url", "wanted"), ADDRESSES, ids=[row[0] for row in ADDRESSES])
def test_an_address_says_where_the_database_is(url: str, wanted: dict[str, object]) -> None:
    address = read_address(url, folder=Path("/site"))
    assert {name: getattr(address, name) for name in wanted} == wanted


@pytest.mark.parametrize(("url", "fault"), WRONG, ids=[row[0] for row in WRONG])
def test_an_address_that_cannot_be_used_is_told(url: str, fault: str) -> None:
    with pytest.raises(ConfigError, match=fault) as caught:
        read_address(url)
    assert "secret123" not in str(caught.value)


def test_a_password_is_not_shown() -> None:
    address = read_address("mysql://me@localhost/bus", password="secret123")
    assert "secret123" not in f"{address!r} {address}"


def test_comments_are_no_statements() -> None:
    assert statements("-- one; two\nCREATE a (b); -- c\n\nINSERT d;\n") == ["CREATE a (b)", "INSERT d"]


@pytest.mark.parametrize("dialect", ["mysql", "sqlite"])
def test_versions_are_numbered_without_a_gap(dialect: str) -> None:
    assert list(versions(dialect)) == list(range(1, len(versions("mysql")) + 1))


def test_a_newer_schema_is_refused(database: Database) -> None:
    storage = open_storage(database.address)
    storage.close()
    newer(database)
    with pytest.raises(ConfigError, match="schema version 99, this program knows 4"):
        open_storage(database.address)


def newer(database: Database) -> None:
    """As a program of next year leaves it."""
    if database.kind == "sqlite":
        with closing(sqlite3.connect(database.address.path)) as connection, connection:
            connection.execute("INSERT INTO schema_version VALUES (99, 0, '')")
        return
    with pymysql.connect(
        unix_socket=database.address.socket, user=database.address.user, password=database.address.password or "",
        database="bus", autocommit=True,
    ) as connection:  # fmt: skip
        connection.query("INSERT INTO schema_version VALUES (99, NOW(6), '')")


def test_a_file_that_is_no_database_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "bus.db"
    file.write_text("this is a shopping list, and a long one, so that it has a header")
    with pytest.raises(ConfigError, match="not a database"):
        open_storage(f"sqlite:///{file}")


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="folder cannot be made"):
        open_storage("sqlite:///file/bus.db", tmp_path)


def test_a_file_locked_by_another_writer_is_unavailable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.storage.sqlite.BUSY_S", 0.05)
    storage = open_storage("sqlite:///bus.db", tmp_path)
    storage.add_items([Item("Note", "String")])
    with closing(sqlite3.connect(tmp_path / "bus.db", isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(Unavailable, match="locked"):
            storage.write(Batch(samples=[Sample("Note", 1, None, "x")]))
    storage.close()


def test_a_server_that_is_away_is_unavailable() -> None:
    with pytest.raises(Unavailable, match="2003"):
        open_storage(read_address(f"mysql://me@127.0.0.1:{free_port()}/bus", password="secret123"))


@pytest.mark.mariadb
class TestMariaDb:
    def test_a_wrong_password_or_database_is_told(self, mariadb_server: mariadb.Server) -> None:
        address = fresh_mariadb(mariadb_server).address
        with pytest.raises(ConfigError, match="1045"):
            open_storage(replace(address, password="secret123"))
        with pytest.raises(ConfigError, match=r"1044|1049"):
            open_storage(replace(address, database="nowhere"))
        with pytest.raises(ConfigError, match=r"1044|1049"):
            open_storage(replace(address, view_database="nowhere"))

    def test_tcp_works_as_the_socket_does(self, mariadb_server: mariadb.Server) -> None:
        fresh_mariadb(mariadb_server)
        open_storage(read_address(mariadb_server.tcp_url, password=mariadb_server.password)).close()

    def test_a_database_in_another_character_set_is_refused(self, mariadb_server: mariadb.Server) -> None:
        database = fresh_mariadb(mariadb_server)
        with connected(mariadb_server, mariadb_server.admin, "", "bus") as admin:
            admin.query("ALTER DATABASE bus CHARACTER SET latin1")
        with pytest.raises(ConfigError, match="expected character set utf8mb4, got latin1"):
            open_storage(database.address)

    def test_tables_of_a_real_openhab_are_not_touched(self, mariadb_server: mariadb.Server) -> None:
        database = fresh_mariadb(mariadb_server)
        with connected(mariadb_server, mariadb_server.admin, "", "OpenHAB") as admin:
            admin.query("CREATE TABLE Items (ItemId INT NOT NULL AUTO_INCREMENT PRIMARY KEY, ItemName VARCHAR(200))")
        with pytest.raises(ConfigError, match=r"OpenHAB\.Items is a table of somebody else"):
            open_storage(database.address)

    def test_a_migration_that_stopped_half_way_is_finished(self, mariadb_server: mariadb.Server) -> None:
        database = fresh_mariadb(mariadb_server)
        with connected(mariadb_server, mariadb_server.admin, "", "bus") as admin:
            for statement in versions("mysql")[1][:4]:
                admin.query(statement)
        open_storage(database.address).close()
        assert database.rows("SELECT version FROM schema_version") == [(n,) for n in versions("mysql")]
        assert database.rows("SELECT COUNT(*) FROM kind") == [(12,)]

    def test_missing_views_are_made_at_the_start(self, mariadb_server: mariadb.Server) -> None:
        database = fresh_mariadb(mariadb_server)
        storage = open_storage(database.address)
        storage.add_items([Item("Note", "String")])
        storage.close()
        with connected(mariadb_server, mariadb_server.admin, "", "OpenHAB") as admin:
            admin.query("DROP VIEW Item1, Items")
        open_storage(database.address).close()
        assert database.rows("SELECT * FROM Item1", reader=True) == []
        assert database.rows("SELECT * FROM Items", reader=True) == [(1, "Note")]

    def test_the_reader_may_read_the_views_and_nothing_else(self, mariadb_server: mariadb.Server) -> None:
        database = fresh_mariadb(mariadb_server)
        storage = open_storage(database.address)
        storage.add_items([Item("Lab_Temp", "Number")])
        storage.write(Batch(samples=[Sample("Lab_Temp", 1_769_839_200_000_000, 21.5, None)]))
        storage.close()
        assert database.rows("SELECT Value FROM Item1", reader=True) == [(21.5,)]
        assert database.rows("SHOW DATABASES", reader=True) == [("OpenHAB",), ("information_schema",)]
        for statement in (
            "SELECT * FROM bus.sample",
            "SELECT * FROM bus.item",
            "DELETE FROM Item1",
            "UPDATE Item1 SET Value=0",
            "INSERT INTO Item1 VALUES (NOW(), 1)",
            "DROP VIEW Item1",
            "CREATE TABLE mine (a INT)",
            "SELECT * FROM mysql.global_priv",
        ):
            with pytest.raises(pymysql.err.OperationalError, match=r"1142|1044|denied"):
                database.rows(statement, reader=True)

    def test_a_value_beyond_the_calendar_is_refused(self, mariadb_server: mariadb.Server) -> None:
        storage = open_storage(fresh_mariadb(mariadb_server).address)
        storage.add_items([Item("Note", "String")])
        with pytest.raises(BadMessage, match="1292"):
            storage.write(Batch(samples=[Sample("Note", 2**52, None, "2112")]))
        storage.close()

    def test_it_warns_of_a_server_that_answers_before_it_has_written(
        self, mariadb_server: mariadb.Server, caplog: pytest.LogCaptureFixture
    ) -> None:
        database = fresh_mariadb(mariadb_server)
        with connected(mariadb_server, mariadb_server.admin, "", None) as admin, caplog.at_level(logging.WARNING):
            admin.query("SET GLOBAL innodb_flush_log_at_trx_commit=2")
            open_storage(database.address).close()
            admin.query("SET GLOBAL innodb_flush_log_at_trx_commit=1")
        assert "a power cut can lose" in caplog.text


def test_the_log_of_a_file_is_emptied_beside_the_writer(tmp_path: Path) -> None:
    file = tmp_path / "bus.db"
    with closing(open_storage(f"sqlite:///{file}")) as storage:
        storage.add_items([Item("Kitchen_Temp", "Number")])
        sizes = []
        for turn in range(200):
            times = range(turn * 100, turn * 100 + 100)
            storage.write(
                Batch(samples=[Sample("Kitchen_Temp", time * 1_000_000, float(time), None) for time in times])
            )
            sizes.append(file.with_name("bus.db-wal").stat().st_size)
        wait_until(lambda: file.stat().st_size > 200_000, "the rows are in the file itself")
        assert max(sizes) < 8_000_000
        assert len(storage.samples("Kitchen_Temp")) == 20_000
    assert not file.with_name("bus.db-wal").exists()
