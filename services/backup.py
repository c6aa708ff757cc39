"""One file with everything that an apartment knows: configuration and places, what was learnt, what is stored.

A ZIP archive: `manifest.json`, `config/...`, `state/...`, `database.jsonl`. Without passwords and certificates, which
are in a folder of their own (`services/credentials/`). Not here: how rows become lines, `services/storage/dump.py`.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path, PurePath, PurePosixPath

from services import __version__
from services.config import Apartment
from services.errors import ConfigError
from services.storage import Address, Storage, dump, open_plain, open_storage, schema_version
from services.whole_file import PRIVATE, whole_file, write_whole

FORM = 1  # of the archive
DATABASE = "database.jsonl"
CONFIG, STATE = "config/", "state/"
CLIENT = "client"  # who a service is to the broker, in its folder (`process.py`): its own, and nobody else's to know
PRIVATE_PARTS = ("secrets", "broker", "secrets.yaml")  # of the configuration's folder
CERTIFICATES = (".crt", ".key", ".pem")  # of this machine; those of another one would not fit its authority
LARGEST = 1 << 30  # bytes of one file that is put back; a small archive may claim to hold a large one


def save(file: Path, apartment: Apartment, database: Address | None) -> Iterator[str]:
    """Writes the archive; whoever looks meanwhile sees no file, or the old one. Yields a line for each part."""
    yield f"{apartment.file}: what this configuration says and names"
    with (
        whole_file(file, mode=PRIVATE) as output,
        zipfile.ZipFile(output, "w", zipfile.ZIP_DEFLATED, strict_timestamps=False) as archive,
    ):
        yield from _save_parts(archive, apartment, database)
    yield f"{file}: {file.stat().st_size} bytes, without passwords and certificates"


def _save_parts(archive: zipfile.ZipFile, apartment: Apartment, database: Address | None) -> Iterator[str]:
    made = {"form": FORM, "version": __version__, "made": datetime.now(UTC).isoformat(), "config": apartment.file.name}
    folders = ((CONFIG, apartment.file.parent), (STATE, apartment.state))
    for begin, folder in folders:
        files = _files(folder, () if begin == STATE else (apartment.state,), database)
        for path in files:
            archive.write(path, begin + path.relative_to(folder).as_posix())
        yield f"{folder}: {len(files)} files"
    if database is not None:
        with closing(open_storage(database)) as storage:
            made["schema"] = str(schema_version(storage))
            with archive.open(DATABASE, "w", force_zip64=True) as lines:
                count = sum(1 for line in dump.lines(storage) if lines.write(line.encode() + b"\n"))
        yield f"{database}: {count} rows"
    archive.writestr("manifest.json", json.dumps(made, indent=1))


def _files(folder: Path, but: tuple[Path, ...], database: Address | None) -> list[Path]:
    """What is kept of a folder: files of its own, neither the database's nor the secrets' nor what is half written."""
    stored = database.path.name if database is not None and database.dialect == "sqlite" else None
    found = []
    for path in sorted(folder.rglob("*")) if folder.is_dir() else ():
        inner = path.relative_to(folder)
        hidden = any(part.startswith(".") for part in inner.parts)
        if not path.is_file() or path.is_symlink() or hidden or _secret(inner) or any(map(path.is_relative_to, but)):
            continue
        if stored is None or not path.name.startswith(stored):
            found.append(path)
    return found


def _secret(inner: PurePath) -> bool:
    """Whether a file of a folder is this installation's alone: passwords, certificates and keys, who a service is."""
    return inner.parts[0] in PRIVATE_PARTS or inner.name == CLIENT or inner.suffix in CERTIFICATES


def manifest(file: Path) -> dict[str, str]:
    """What an archive says of itself; ConfigError when it is none of ours, or of a newer program."""
    try:
        with zipfile.ZipFile(file) as archive:
            told: dict[str, str] = json.loads(archive.read("manifest.json"))
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise ConfigError([f"{file}: expected a file that `apartment backup` wrote, got {error}"]) from error
    if int(told.get("form", 0)) != FORM:
        raise ConfigError([f"{file}: expected a backup of form {FORM}, got {told.get('form')}"])
    return told


def put_files_back(file: Path, begin: str, folder: Path, *, force: bool = False) -> Iterator[str]:
    """Writes the files of a part; one that is there and says something else is a fault, or with `force` replaced.

    Certificates and keys, which older programs saved too, are not put back.
    """
    with zipfile.ZipFile(file) as archive:
        there = [one for one in archive.infolist() if one.filename.startswith(begin) and not one.is_dir()]
        inner = {one.filename: _inside(one, begin) for one in there}
        wanted = [one for one in there if not _secret(inner[one.filename])]
        targets = {one.filename: folder / inner[one.filename] for one in wanted}
        if not force:
            other = [
                path
                for one in wanted
                if (path := targets[one.filename]).exists() and path.read_bytes() != archive.read(one)
            ]
            if other:
                raise ConfigError([f"{path}: expected no other file there: --force replaces it" for path in other])
        for one in wanted:
            write_whole(targets[one.filename], archive.read(one))
    yield f"{folder}: {len(wanted)} files"


def _inside(one: zipfile.ZipInfo, begin: str) -> PurePosixPath:
    """The path of a file in its folder; nothing leads out of it, and nothing is larger than anything of ours."""
    path = PurePosixPath(one.filename.removeprefix(begin))
    if path.is_absolute() or ".." in path.parts or "\\" in one.filename or not path.parts:
        raise ConfigError([f"{one.filename!r}: expected a path inside of the backup"])
    if one.file_size > LARGEST:
        raise ConfigError([f"{one.filename!r}: expected at most {LARGEST} bytes, got {one.file_size}"])
    return path


def expect_empty(database: Address, *, made_later: bool) -> None:
    """ConfigError when it has rows, with what empties it, or when it cannot be opened and is not to be made later."""
    made_later = made_later or (database.dialect == "sqlite" and not database.path.exists())
    try:
        storage = open_plain(database)
    except ConfigError:
        if made_later:
            return
        raise
    with closing(storage):
        _expect_empty(storage, database)


def _expect_empty(storage: Storage, database: Address) -> None:
    if (table := dump.occupied(storage)) is None:
        return
    how = f"sudo rm {database.path}*"
    if database.dialect == "mysql":
        names = "; ".join(f"DROP DATABASE IF EXISTS {one}" for one in (database.database, database.view_database))
        how = f"sudo mariadb -e '{names}', and then restore with --init"
    raise ConfigError([f"{database}: expected an empty one, got rows in {table}. If nobody needs them any more: {how}"])


def put_rows_back(file: Path, database: Address) -> Iterator[str]:
    """Writes all rows into an empty database, which is made where it is missing; nothing where the backup has none."""
    told = manifest(file)
    with zipfile.ZipFile(file) as archive:
        if DATABASE not in archive.namelist():
            return
        with closing(open_storage(database)) as storage, archive.open(DATABASE) as lines:
            if int(told["schema"]) > (own := schema_version(storage)):
                raise ConfigError([f"{file}: its schema has version {told['schema']}, this program knows {own}"])
            _expect_empty(storage, database)
            counted = dump.put_back(storage, (line.decode() for line in lines))
    with closing(open_storage(database)) as storage:  # it learns the items
        storage.remake_views()
    yield f"{database}: {sum(counted.values())} rows"
