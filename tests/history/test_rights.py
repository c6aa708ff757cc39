"""The accounts of the history service on a real MariaDB, as `apartment db init` makes them: what each can do."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from pymysql import err

from services import history
from services.bus import Message
from services.config import load
from services.errors import Unavailable
from services.history.service import SETTLE_S
from services.peers import mariadb
from services.storage import Batch, Item, Sample, open_ready, open_storage, read_address
from services.topics import HISTORY_GET
from tests.databases import connected
from tests.storage.test_db_command import run

NOW = 1_769_839_200.0
SAMPLES = [Sample("Temp", round((NOW - 86_400 * 20 + 60 * minute) * 1e6), 20.0, None) for minute in range(60)]
WRITES = (
    "INSERT INTO sample (item_id, time, num) VALUES (1, NOW(6), 1)", "UPDATE sample SET num=0", "DELETE FROM sample",
    "INSERT INTO item (name, kind) VALUES ('X', 'Switch')", "DELETE FROM sighting", "DROP TABLE sample",
    "CREATE TABLE mine (a INT)", "ALTER TABLE item ADD b INT", "DELETE FROM schema_version", "CREATE USER x",
    "GRANT ALL ON *.* TO x", "SELECT * FROM mysql.user", "SELECT 1 INTO OUTFILE '/tmp/x'",
)  # fmt: skip
REFUSED = {1044, 1045, 1142, 1143, 1227, 1410}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, mariadb_server: mariadb.Server) -> Iterator[Path]:
    """A configuration on a database of its own, just made by its administrator, with samples of three weeks ago."""
    folder, server = tmp_path_factory.mktemp("rights"), mariadb_server
    where = f"localhost/least?socket={server.socket}"
    (folder / "home.yaml").write_text("items: {Temp: {type: Number, label: T}}\n")
    config = folder / "apartment.yaml"
    config.write_text(
        f"home: home.yaml\npersistence: {{url: 'mysql://w@{where}', password: w-secret, view_database: LeastViews}}\n"
        f"history:\n  url: mysql://r@{where}\n  password: r-secret\n  keeper: {{user: k, password: k-secret}}\n"
        "  keep: [{items: [Temp], raw: 7d, means: {1h: forever}}]\n"
    )
    run(config, "init", "--admin", server.admin)
    run(config, "init", "--admin", server.admin)
    address = read_address(f"mysql://w@{where}", password="w-secret", view_database="LeastViews")
    with closing(open_storage(address)) as storage:
        storage.add_items([Item("Temp", "Number")])
        storage.write(Batch([*SAMPLES, Sample("Temp", round(NOW * 1e6), 21.0, None)]))
    yield config
    with connected(server, server.admin, "", None) as admin:
        for what in ("DATABASE least", "DATABASE LeastViews", "USER w@localhost, r@localhost, k@localhost"):
            admin.query(f"DROP {what}")


def settings(site: Path) -> history.Config:
    """The section, as the service gets it."""
    config = load(site, ("history",)).instances["history"].config
    assert isinstance(config, history.Config)
    return config


def tried(server: mariadb.Server, user: str, statement: str) -> int:
    """The number of the error that a statement ends with, as that user; 0 for none. Nothing stays."""
    with connected(server, user, f"{user}-secret", "least") as link, link.cursor() as cursor:
        try:
            cursor.execute(statement)
        except err.MySQLError as error:
            return int(error.args[0])
        finally:
            link.rollback()
    return 0


@pytest.mark.mariadb
@pytest.mark.parametrize("statement", WRITES)
def test_the_reader_reads_and_nothing_else(site: Path, mariadb_server: mariadb.Server, statement: str) -> None:
    assert tried(mariadb_server, "r", "SELECT COUNT(*) FROM sample") == 0
    assert tried(mariadb_server, "r", statement) in REFUSED


@pytest.mark.mariadb
def test_the_keeper_clears_samples_and_makes_means_and_nothing_else(site: Path, mariadb_server: mariadb.Server) -> None:
    assert tried(mariadb_server, "k", "DELETE FROM sample") == 0
    for statement in WRITES:
        if statement != "DELETE FROM sample":
            assert tried(mariadb_server, "k", statement) in REFUSED, statement


@pytest.mark.mariadb
def test_the_service_answers_and_keeps_house_with_these_rights(site: Path) -> None:
    with history.start(settings(site), lambda message: None) as service:
        asked = Message(HISTORY_GET.name(), json.dumps({"id": "q", "item": "Temp"}).encode(), received=NOW)
        (told, *_) = service.handle(asked, NOW)
        answer = json.loads(told.payload)
        assert answer["error"] is None
        assert answer["samples"][-1][1] == 21.0
        now = NOW
        while service.due is not None and service.due - now <= SETTLE_S:
            now = max(now, service.due)
            service.tick(now)
        assert service.counters["pieces"] > 0
        with closing(open_ready(settings(site).address)) as storage:
            assert storage.read("SELECT COUNT(*) FROM sample") == [(1,)]
            assert storage.read("SELECT SUM(n) FROM summary") == [(60,)]


@pytest.mark.mariadb
def test_a_reader_that_comes_before_the_writer_waits_for_the_tables(mariadb_server: mariadb.Server) -> None:
    server = mariadb_server
    with connected(server, server.admin, "", None) as admin:
        admin.query("CREATE DATABASE empty")
        try:
            with pytest.raises(Unavailable, match="the writer brings them up to date"):
                open_ready(read_address(f"mysql://{server.admin}@localhost/empty?socket={server.socket}"))
        finally:
            admin.query("DROP DATABASE empty")
