"""One SQLite file for services with users of their own: whoever makes it, all who share its folder write it."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from services.errors import ConfigError
from services.storage import Address, Batch, Item, Sample, open_storage, upkeep

WRITER, KEEPER, GROUP = 12345, 12346, 12347
DELETES = "import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); c.execute('DELETE FROM sample'); c.commit()"
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="nobody else may make files for others")


@pytest.fixture
def folder() -> Iterator[Path]:
    """As /var/lib/apartment is; pytest's own folders are for one user alone."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        made = Path(name) / "apartment"
        made.mkdir()
        if os.geteuid() == 0:
            os.chown(made, 0, GROUP)
        made.chmod(0o2770)
        yield made


@contextmanager
def user(uid: int) -> Iterator[None]:
    """As one of the services: its user, the group of all, what is new is for the group."""
    groups, umask = os.getgroups(), os.umask(0o007)
    os.setgroups([])
    os.setegid(GROUP)
    os.seteuid(uid)
    try:
        yield
    finally:
        os.seteuid(0)
        os.setegid(0)
        os.setgroups(groups)
        os.umask(umask)


def address(folder: Path) -> Address:
    return Address("sqlite", path=folder / "bus.db")


def written(address: Address) -> None:
    """Opens it, and leaves it with a row in the log beside the file."""
    with closing(open_storage(address)) as storage:
        storage.add_items([Item("Lab_Temp", "Number")])
        storage.write(Batch([Sample("Lab_Temp", 1, 21.5, None)]))
        for file in address.path.parent.glob("bus.db-*"):
            assert file.stat().st_mode & 0o060 == 0o060, file.name


def delete(address: Address, uid: int) -> None:
    """As the keeper does, in a process of his own."""
    program = [Path(sys.executable).resolve(), "-I", "-c", DELETES, address.path]
    subprocess.run(program, user=uid, group=GROUP, extra_groups=[], umask=0o007, check=True, cwd="/", timeout=60)


@as_root
def test_what_root_makes_the_services_write(folder: Path) -> None:
    with closing(open_storage(address(folder))):
        pass
    made = address(folder).path.stat()
    assert (made.st_uid, made.st_gid, made.st_mode & 0o777) == (0, GROUP, 0o660)
    with user(WRITER):
        written(address(folder))
    delete(address(folder), KEEPER)
    with closing(open_storage(address(folder))) as storage:
        assert storage.samples("Lab_Temp") == []


@as_root
def test_what_the_writer_makes_the_keeper_clears(folder: Path) -> None:
    with user(WRITER):
        written(address(folder))
    delete(address(folder), KEEPER)
    with closing(open_storage(address(folder))) as storage:
        assert storage.samples("Lab_Temp") == []


def test_a_file_that_may_only_be_read_is_refused_before_the_first_row(folder: Path) -> None:
    open_storage(address(folder)).close()
    address(folder).path.chmod(0o444)

    def refused() -> None:
        with pytest.raises(ConfigError, match=r"bus\.db may not be written: sudo chown --reference="):
            open_storage(address(folder))

    if os.geteuid() != 0:
        refused()
        return
    with user(WRITER):
        refused()


@pytest.mark.parametrize(("mode", "good"), [(0o660, True), (0o664, True), (0o640, False), (0o644, False)])
def test_a_look_tells_a_file_that_not_all_can_write(folder: Path, mode: int, *, good: bool) -> None:
    open_storage(address(folder)).close()
    address(folder).path.chmod(mode)
    found = [what for well, what in upkeep.look(address(folder)) if not well]
    assert bool(found) is not good
    assert all(what.endswith(f"sudo chmod 660 {address(folder).path}*") for what in found)


def test_a_folder_of_ones_own_shares_nothing(folder: Path) -> None:
    open_storage(address(folder)).close()
    folder.chmod(0o700)
    address(folder).path.chmod(0o600)
    assert all(well for well, _ in upkeep.look(address(folder)))
