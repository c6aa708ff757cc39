"""What a real database does when it is in trouble: a deadlock, and a disk that is full."""

from __future__ import annotations

import threading
from contextlib import closing
from pathlib import Path

import pytest

from services import peers
from services.errors import Unavailable
from services.peers import mariadb
from services.storage import Batch, Item, Sample, open_storage
from tests.databases import connected, fresh_mariadb, fresh_sqlite

T = 1_769_839_200_000_000
TIME = "'2026-01-31 06:00:00'"


def waiting(server: mariadb.Server) -> bool:
    """Whether somebody waits for a lock there."""
    with connected(server, server.admin, "", None) as look, look.cursor() as cursor:
        cursor.execute("SELECT COUNT(*) FROM information_schema.innodb_trx WHERE trx_state='LOCK WAIT'")
        return bool(cursor.fetchone()[0])


@pytest.mark.mariadb
def test_a_batch_that_has_to_give_way_in_a_deadlock_is_written_whole_afterwards(mariadb_server: mariadb.Server) -> None:
    address, server = fresh_mariadb(mariadb_server).address, mariadb_server
    with (
        closing(open_storage(address)) as storage,
        connected(server, server.user, server.password, server.database) as other,
        other.cursor() as cursor,
    ):
        other.query("SET time_zone='+00:00'")
        storage.add_items([Item("A", "Number"), Item("B", "Number")])
        a, b = (storage.items[name].item_id for name in "AB")
        # It has changed more rows than the batch, so the server lets the batch give way.
        cursor.execute(f"INSERT INTO sample SELECT {b}, FROM_UNIXTIME(seq), seq, NULL FROM seq_1000000_to_1001000")
        cursor.execute(f"INSERT INTO sample VALUES ({b}, {TIME}, 7, NULL)")
        batch = Batch([Sample("A", T, 1.0, None), Sample("B", T, 2.0, None), Sample("B", T + 1, 3.0, None)])
        failed: list[BaseException] = []

        def write() -> None:
            try:
                storage.write(batch)
            except BaseException as error:
                failed.append(error)

        writer = threading.Thread(target=write)
        writer.start()
        peers.wait_until(lambda: waiting(server), "the batch to wait for the other's row", 30.0)
        cursor.execute(f"INSERT INTO sample VALUES ({a}, {TIME}, 8, NULL) ON DUPLICATE KEY UPDATE num=num")
        other.commit()
        writer.join(30)
        assert not failed
        assert storage.deadlocks == 1
        assert [one.num for one in storage.samples("A")] == [8.0]  # of two rows with one key the first stays
        assert [one.num for one in storage.samples("B", since=T)] == [7.0, 3.0]


def test_a_full_disk_takes_nothing_of_a_batch_and_all_of_it_later(tmp_path: Path) -> None:
    with closing(open_storage(fresh_sqlite(tmp_path).address)) as storage:
        storage.add_items([Item("Note", "String")])
        ((pages,),) = storage.read("PRAGMA page_count")
        storage.read(f"PRAGMA max_page_count={pages + 5}")
        batch = Batch([Sample("Note", T + n, None, "x" * 1000) for n in range(100)])
        with pytest.raises(Unavailable, match="full"):
            storage.write(batch)
        assert storage.samples("Note") == []
        storage.read(f"PRAGMA max_page_count={pages + 1000}")
        storage.write(batch)
        assert len(storage.samples("Note")) == 100
