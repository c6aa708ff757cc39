"""`apartment backup` and `apartment restore`: everything in one file, and back.

Not here: the work itself, `services/backup.py`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from services.command_line.options import CONFIG, Config, out
from services.config import Apartment, load

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


def _database(apartment: Apartment) -> Address | None:
    """Where the rows are; None where nothing is stored."""
    from services import persistence

    if "persistence" not in apartment.instances:
        return None
    settings = apartment.instances["persistence"].config
    assert isinstance(settings, persistence.Config)
    return settings.address
