"""`apartment backup` and `apartment restore`: everything in one file, and back.

Not here: the work itself, `services/backup.py`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from services.command_line.options import CONFIG, Config, out
from services.config import Apartment, load
from services.errors import ConfigError

if TYPE_CHECKING:  # the databases' libraries, for these commands alone
    from services.storage import Address


def backup(file: Path, config: Config = CONFIG) -> None:
    """Write configuration, places, what was learnt and the database into one file; services may run meanwhile."""
    from services import backup as work

    apartment = load(config, ("persistence",))
    for line in work.save(file, apartment, _database(apartment)):
        out.print(line, markup=False)


def restore(
    file: Path,
    force: Annotated[bool, typer.Option("--force", help="Replace files that are there.")] = False,
    init: Annotated[
        bool, typer.Option("--init", help="Make databases and accounts before the rows, as `apartment db init` does.")
    ] = False,
    config: Config = CONFIG,
) -> None:
    """Put all of it back, the rows into an empty database; stop the services before."""
    from services import backup as work
    from services.command_line import stored

    told = work.manifest(file)
    _expect_room(file, config.with_name(told["config"]), init=init)
    for line in work.put_files_back(file, work.CONFIG, config.parent, force=force):
        out.print(line, markup=False)
    apartment = load(config.with_name(told["config"]), ("persistence",))
    for line in work.put_files_back(file, work.STATE, apartment.state, force=force):
        out.print(line, markup=False)
    if (database := _database(apartment)) is not None:
        if init:
            stored.init(config=apartment.file)
        for line in work.put_rows_back(file, database):
            out.print(line, markup=False)


def _expect_room(file: Path, config: Path, *, init: bool) -> None:
    """Before anything is written: ConfigError when the database that the backup's configuration names has rows.

    A fault of that configuration is told later, with its place in the files that are written then.
    """
    from services import backup as work

    with TemporaryDirectory() as name:
        try:
            list(work.put_files_back(file, work.CONFIG, Path(name)))
            database = _database(load(Path(name) / config.name, ("persistence",)))
        except ConfigError:
            return
    if database is None:
        return
    if database.path.is_relative_to(name):
        database = replace(database, path=config.parent / database.path.relative_to(name))
    work.expect_empty(database, made_later=init)


def _database(apartment: Apartment) -> Address | None:
    """Where the rows are; None where nothing is stored."""
    from services import persistence

    if "persistence" not in apartment.instances:
        return None
    settings = apartment.instances["persistence"].config
    assert isinstance(settings, persistence.Config)
    return settings.address
