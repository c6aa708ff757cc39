"""Backup, wipe, restore: everything is as it was. On SQLite and on a real MariaDB, and from the one to the other."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from services import backup
from services.config import load
from services.errors import ConfigError
from services.storage import (
    Address,
    Batch,
    CameraOrder,
    Diagnostic,
    Item,
    Mission,
    Sample,
    Scan,
    Sighting,
    keeping,
    open_storage,
)
from services.storage.dump import TABLES
from tests.databases import Database, Sqlite, fresh_sqlite

ROOT = Path(__file__).parents[1]
T0 = 1_769_839_200_000_000
MINUTE = 60_000_000
ODD = 'it\'s "odd" \\ % ? 日本 🏠\nline;--\0'
MANY = 2345  # samples of one item: more than a piece


class Home:
    """A configuration with its places, a state folder and a database with something in every table."""

    def __init__(self, folder: Path, database: Database) -> None:
        self.folder = folder
        self.database = database
        self.config = folder / "config" / "simulated.yaml"
        shutil.copytree(ROOT / "config", folder / "config")
        (folder / "state/camera-ip1").mkdir(parents=True)
        (folder / "state/camera-ip1/learnt.json").write_text('{"speed": 1.5}')
        (folder / "state/picture.bin").write_bytes(bytes(range(256)))
        (folder / "config/ip1/preset_position.yaml").write_text("Küche: [1.25, 2.5, 0]\n")
        fill(database.address)

    def run(self, *words: str) -> subprocess.CompletedProcess[str]:
        address = self.database.address
        url = f"sqlite:///{address.path.absolute()}" if address.dialect == "sqlite" else _url(address)
        environment = {
            **os.environ,
            "APARTMENT_STATE": str(self.folder / "state"),
            "APARTMENT_DATABASE": url,
            "APARTMENT_DATABASE_PASSWORD": address.password or "",
        }
        command = [sys.executable, "-m", "services", *words, "--config", str(self.config)]
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)

    def files(self) -> dict[str, bytes]:
        found = (path for part in ("config", "state") for path in (self.folder / part).rglob("*") if path.is_file())
        return {str(path.relative_to(self.folder)): path.read_bytes() for path in found}


def _url(address: Address) -> str:
    return f"mysql://{address.user}@localhost/{address.database}?socket={address.socket}"


def fill(address: Address) -> None:
    with closing(open_storage(address)) as storage:
        storage.add_items([Item("Lab_Temp", "Number", "°C"), Item("Note", "String"), Item("Lamp", "Switch")])
        storage.write(Batch([Sample("Lab_Temp", T0 + n * MINUTE + n, 20 + n / 7, None) for n in range(MANY)]))
        storage.write(
            Batch(
                samples=[
                    Sample("Lamp", T0, 1.0, "ON"),
                    Sample("Note", T0, None, ODD),
                    Sample("Note", T0 + 1, None, "UNDEF"),
                    Sample("Lab_Temp", T0 - MINUTE, 1e300, None),
                ],
                rows=[
                    Sighting("s1", "ip1", 582, "DICT_5X5_1000", "Küche", T0, T0 - 1, x=0.1, zoom=2.5, why=ODD[:100]),
                    Sighting("s1", "ip1", 17, "DICT_5X5_1000", None, T0),
                    Mission("m1", "tiago", 582, "found", ODD[:99], "Küche", 1.5, -2.0, 0.7, "ip1", T0, T0 + 9, "[]"),
                    Mission("m2", "tiago", 17, "drives", None, None, None, None, None, None, T0, None, None),
                    Scan("s1", "ip1", "done", "582", "582", T0, None, 8, 8),
                    CameraOrder("o1", "ip1", "Goto", "Küche", "done", None, T0),
                    Diagnostic("camera/ip1", T0, 0, "fine", ODD),
                ],
            )
        )
        assert keeping.summarise(storage, storage.items["Lab_Temp"], 3600, T0 // 1_000_000, T0 // 1_000_000 + 86400)


def rows(address: Address) -> dict[str, list[tuple[Any, ...]]]:
    """Every table but those of the writer's bookkeeping, as the database has them."""
    with closing(open_storage(address)) as storage:
        order = {table.name: ", ".join(f"`{name}`" for name in table.key) for table in TABLES}
        return {name: storage.read(f"SELECT * FROM {name} ORDER BY {keys}") for name, keys in order.items()}


def test_no_table_and_no_column_is_forgotten(tmp_path: Path) -> None:
    """The schema's own tables are made by whoever opens a database, the writer's bookkeeping is of the past."""
    with closing(open_storage(fresh_sqlite(tmp_path).address)) as storage:
        names = [row[0] for row in storage.read("SELECT name FROM sqlite_master WHERE type='table'")]
        columns = {name: {row[1] for row in storage.read(f"PRAGMA table_info({name})")} for name in names}
    left_out = {"schema_version", "kind", "mqtt_seen", "mqtt_noted", "sqlite_sequence"}
    assert {table.name: set(table.columns) for table in TABLES} == {
        name: found for name, found in columns.items() if name not in left_out
    }


def wipe(home: Home, request: pytest.FixtureRequest, folder: Path) -> None:
    shutil.rmtree(home.folder / "config")
    shutil.rmtree(home.folder / "state")
    if isinstance(home.database, Sqlite):
        shutil.rmtree(home.database.address.path.parent)
        home.database.address.path.parent.mkdir()
    else:
        from tests.databases import fresh_mariadb

        fresh_mariadb(request.getfixturevalue("mariadb_server"))


def test_backup_wipe_restore_gives_everything_back_as_it_was(
    tmp_path: Path, database: Database, request: pytest.FixtureRequest
) -> None:
    home = Home(tmp_path / "home", database)
    before, files = rows(database.address), home.files()
    assert all(before.values())
    saved = home.run("backup", str(tmp_path / "all.zip"))
    assert saved.returncode == 0, saved.stderr
    assert f"{home.config}: what this configuration says and names" in saved.stdout
    assert (tmp_path / "all.zip").stat().st_mode & 0o777 == 0o600
    wipe(home, request, tmp_path)
    done = home.run("restore", str(tmp_path / "all.zip"))
    assert done.returncode == 0, done.stderr
    assert home.files() == files
    assert rows(database.address) == before
    with closing(open_storage(database.address)) as storage:
        assert storage.last("Note") == Sample("Note", T0 + 1, None, "UNDEF")
        storage.add_items([Item("New", "Switch")])
        assert storage.items["New"].item_id > 3
    again = home.run("restore", str(tmp_path / "all.zip"))
    assert again.returncode == 2
    assert "expected an empty one" in again.stderr


def test_where_rows_are_in_the_way_nothing_is_written_and_the_way_out_is_told(
    tmp_path: Path, database: Database, request: pytest.FixtureRequest
) -> None:
    home = Home(tmp_path / "home", database)
    assert home.run("backup", str(tmp_path / "all.zip")).returncode == 0
    (home.folder / "config/ip1/preset_position.yaml").write_text("Sofa: [9, 9, 0]\n")
    (home.folder / "state/picture.bin").unlink()
    files = home.files()
    for words in (("--force",), ("--force", "--init")):
        done = home.run("restore", str(tmp_path / "all.zip"), *words)
        assert done.returncode == 2
        assert "expected an empty one, got rows in item" in done.stderr
        assert home.files() == files
    told = done.stderr.partition("any more: sudo ")[2].strip()
    if database.kind == "sqlite":
        subprocess.run(["sh", "-c", told], check=True, timeout=60)
    else:
        assert told == (
            "mariadb -e 'DROP DATABASE IF EXISTS bus; DROP DATABASE IF EXISTS OpenHAB', and then restore with --init"
        )
        wipe(home, request, tmp_path)
    done = home.run("restore", str(tmp_path / "all.zip"), "--force")
    assert done.returncode == 0, done.stderr
    assert "Küche" in (home.folder / "config/ip1/preset_position.yaml").read_text()
    assert rows(database.address)["camera_order"]


@pytest.mark.skipif(os.geteuid() != 0, reason="nobody else may give files away")
def test_the_services_may_write_what_root_puts_back_on_another_machine(tmp_path: Path) -> None:
    group = 12345
    home = Home(tmp_path / "home", fresh_sqlite(tmp_path))
    for name in ("cameras/ip1/learnt.json", "snapshots/ip1/1.jpg", "persistence/aside/1.json"):
        (home.folder / "state" / name).parent.mkdir(parents=True)
        (home.folder / "state" / name).write_text("{}")
    assert home.run("backup", str(tmp_path / "all.zip")).returncode == 0
    state = home.folder / "state"
    shutil.rmtree(state)
    state.mkdir()
    os.chown(state, 0, group)
    state.chmod(0o2770)  # as the installation makes it
    home.database.address.path.unlink()
    done = home.run("restore", str(tmp_path / "all.zip"))
    assert done.returncode == 0, done.stderr
    put_back = list(state.rglob("*"))
    assert len(put_back) > 8
    for path in put_back:
        mode = path.stat().st_mode & 0o7777
        assert (mode, path.stat().st_gid) == (0o2770 if path.is_dir() else 0o660, group), path


@pytest.mark.mariadb
def test_what_was_in_mariadb_can_go_on_in_a_file(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    from tests.databases import fresh_mariadb

    home = Home(tmp_path / "home", fresh_mariadb(request.getfixturevalue("mariadb_server")))
    assert home.run("backup", str(tmp_path / "all.zip")).returncode == 0
    with closing(open_storage(home.database.address)) as storage:
        before = {name: storage.samples(name) for name in storage.items}
    home.database = fresh_sqlite(tmp_path)
    home.database.address.path.parent.mkdir()
    done = home.run("restore", str(tmp_path / "all.zip"))
    assert done.returncode == 0, done.stderr
    with closing(open_storage(home.database.address)) as storage:
        assert {name: storage.samples(name) for name in storage.items} == before


def test_who_a_service_is_to_the_broker_is_not_in_a_backup(tmp_path: Path) -> None:
    home = Home(tmp_path / "home", fresh_sqlite(tmp_path))
    client = home.folder / "state" / "persistence" / "client"
    client.parent.mkdir(parents=True, exist_ok=True)
    client.write_text("persistence-0123456789abcdef")
    assert home.run("backup", str(tmp_path / "all.zip")).returncode == 0
    with zipfile.ZipFile(tmp_path / "all.zip") as archive:
        names = archive.namelist()
    assert names
    assert not [name for name in names if name.endswith("/client")]


def test_no_password_and_no_key_of_an_installation_is_in_a_backup(tmp_path: Path) -> None:
    words = ["install", "--systemd", "--root", str(tmp_path), "--config", str(ROOT / "config/apartment.yaml")]
    subprocess.run([sys.executable, "-m", "services", *words], check=True, capture_output=True, timeout=120)
    made = tmp_path / "etc/apartment"
    values = {file.read_text() for file in (made / "secrets/credentials").iterdir()}
    values |= {file.read_text() for file in made.rglob("*.*") if file.suffix in (".key", ".crt")}
    assert len(values) > 12
    environment = {"APARTMENT_SECRETS": str(made / "secrets/secrets.yaml")}
    apartment = load(made / "apartment.yaml", ("persistence",), environment)
    list(backup.save(tmp_path / "all.zip", apartment, None))
    with zipfile.ZipFile(tmp_path / "all.zip") as archive:
        texts = {name: archive.read(name).decode(errors="replace") for name in archive.namelist()}
    assert "config/apartment.yaml" in texts
    assert "config/ip1/preset_position.yaml" in texts
    assert not [name for name, text in texts.items() if any(value in text for value in values)]


@pytest.mark.parametrize(
    "name", ["ca.crt", "dashboard.key", "database/server.key", "broker/passwords", "secrets/secrets.yaml"]
)
def test_a_key_in_an_older_backup_is_not_put_over_that_of_this_machine(tmp_path: Path, name: str) -> None:
    file, mine = forged(tmp_path, f"config/{name}", "of the old machine"), tmp_path / "home" / name
    mine.parent.mkdir(parents=True)
    mine.write_text("of this machine")
    list(backup.put_files_back(file, backup.CONFIG, tmp_path / "home"))
    list(backup.put_files_back(file, backup.CONFIG, tmp_path / "home", force=True))
    assert mine.read_text() == "of this machine"


def forged(folder: Path, name: str, text: str) -> Path:
    """An archive with this one file in it."""
    file = folder / "forged.zip"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("manifest.json", json.dumps({"form": 1, "config": "apartment.yaml"}))
        archive.writestr(name, text)
    return file


def test_a_file_that_is_there_is_not_replaced_unless_told_so(tmp_path: Path) -> None:
    file, places = forged(tmp_path, "config/ip1/places.yaml", "Kitchen"), tmp_path / "home/ip1/places.yaml"
    places.parent.mkdir(parents=True)
    places.write_text("Mine")
    with pytest.raises(ConfigError, match="expected no other file there"):
        list(backup.put_files_back(file, backup.CONFIG, tmp_path / "home"))
    assert places.read_text() == "Mine"
    list(backup.put_files_back(file, backup.CONFIG, tmp_path / "home", force=True))
    assert places.read_text() == "Kitchen"
    list(backup.put_files_back(file, backup.CONFIG, tmp_path / "home"))


@pytest.mark.parametrize("name", ["../../outside", "/etc/outside", "a/../../outside", "..\\outside", "a\\..\\outside"])
def test_a_forged_backup_writes_nothing_outside(tmp_path: Path, name: str) -> None:
    file = forged(tmp_path, f"config/{name}", "x")
    with pytest.raises(ConfigError, match="inside of the backup"):
        list(backup.put_files_back(file, backup.CONFIG, tmp_path / "a/home"))
    assert not list(tmp_path.rglob("*outside*"))
    assert not Path("/etc/outside").exists()


def test_what_is_no_backup_is_told(tmp_path: Path) -> None:
    (tmp_path / "no.zip").write_text("no")
    for file in ("no.zip", "none.zip"):
        with pytest.raises(ConfigError, match="that `apartment backup` wrote"):
            backup.manifest(tmp_path / file)
