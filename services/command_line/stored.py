"""The commands about what is stored: `apartment history` and `apartment db ...`. One short function each.

Not here: the other commands (`__main__.py`), the work itself (`services/history/`, `services/storage/`).
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import asdict
from datetime import tzinfo
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from pydantic import ValidationError

from services.command_line import completion
from services.command_line.options import CONFIG, Config, Json, writable
from services.config import Apartment, load
from services.errors import ConfigError
from services.payloads.history import HistoryGet

if TYPE_CHECKING:  # the databases' libraries, for these commands alone
    from services.persistence import Config as Persistence
    from services.persistence.openhab_tables import Tally
    from services.storage import Address

Admin = Annotated[str, typer.Option(help="Who may make accounts there; DATABASE_ADMIN_PASSWORD, or by the socket.")]
NO_VIEWS = "no_views_there"  # an address wants the name of a database for views; another one has none
db = typer.Typer(no_args_is_help=True, help="The database: make, check, upgrade, import, export, let others read.")


def add_to(app: typer.Typer) -> None:
    """Adds these commands to the program's."""
    app.command(epilog="Example: apartment history Lab_Temp --since 24h --plot lab.png")(history)
    app.add_typer(db, name="db")


def history(
    item: Annotated[
        str, typer.Argument(help="An item; needless for --what changes or missions.", autocompletion=completion.items)
    ] = "",
    what: Annotated[
        str, typer.Option(help="samples, last, changes, durations (time in each state) or missions.")
    ] = "samples",
    since: Annotated[str, typer.Option(help="A time, or how long ago: 90m, 24h, 7d.")] = "",
    until: Annotated[str, typer.Option(help="The same; now when not given.")] = "",
    every: Annotated[str, typer.Option(help="Count, least, mean, greatest per 5m, 1h, 1d.")] = "",
    limit: Annotated[int, typer.Option(min=1)] = 20,
    plot: Annotated[Path | None, typer.Option(help="Draw the numbers into this PNG or SVG file.")] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Comma-separated values.")] = False,
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Show what was stored of an item, oldest first; exit 1 when there is nothing."""
    from services.history import command  # the database's libraries, for this command alone

    apartment = load(config, ("persistence",))
    address, zone, now = _settings(apartment).address, apartment.home.zone, time.time()
    begin, end = command.moment(since, now, zone), command.moment(until, now, zone)
    if what == "missions":
        _missions(command.missions(address, begin, end, limit), zone, json=json, as_csv=as_csv)
        return
    asked = _question(item, what, begin, end, command.every_s(every), limit)
    if plot is not None:
        if plot.suffix not in command.SUFFIXES:
            raise ConfigError([f"--plot: expected a file in {' or '.join(command.SUFFIXES)}, got {str(plot)!r}"])
        writable(plot, "--plot")
        plot.write_bytes(command.as_plot(address, asked, zone, plot.suffix))
        _say(f"{plot}")
        return
    reply = command.ask(address, asked)
    if json:
        _say(command.as_json(reply))
    elif as_csv:
        _say(command.as_csv(reply).rstrip("\n"))
    else:
        _say("\n".join(command.table(reply, zone)))
    if command.is_empty(reply):
        raise typer.Exit(1)


def _missions(found: list[dict[str, object]], zone: tzinfo, *, json: bool, as_csv: bool) -> None:
    from services.history import command

    rows = [tuple(found[0]), *(tuple(map(str, one.values())) for one in found)] if found else []
    if json:
        _say(dumps(found, ensure_ascii=False))
    elif as_csv:
        _say(command.comma_separated(rows).rstrip("\n"))
    elif rows:
        _say("\n".join(command.aligned(rows, zone)))
    if not found:
        raise typer.Exit(1)


@db.command(epilog="Example: apartment db init --admin root")
def init(admin: Admin = "root", config: Config = CONFIG) -> None:
    """Make the databases, the accounts of writer, reader and keeper, and the tables; what is there stays.

    The accounts get the passwords of the configuration, new ones too. A SQLite file is just made.
    """
    from services.storage import open_storage, upkeep

    apartment = load(config, ("persistence", "history"))
    address = _settings(apartment).address
    if address.dialect == "sqlite":
        open_storage(address).close()
    else:
        server = upkeep.administrator(address, admin, _admin_password())
        upkeep.make_databases(address, server)
        open_storage(address).close()
        for other, rights in _readers(apartment, address):
            upkeep.make_account(other, server, rights)
    _say(f"{address}: ready")


def _readers(apartment: Apartment, writer: Address) -> Iterator[tuple[Address, Mapping[str, str]]]:
    """Who of the section history comes under another name than the writer, and what he may do."""
    from services import history as history_service
    from services.storage import upkeep

    settings = apartment.instances["history"].config if "history" in apartment.instances else None
    if not isinstance(settings, history_service.Config):
        return
    for one, rights in ((settings.address, upkeep.READING), (settings.keeping_address, upkeep.KEEPING)):
        if one.user != writer.user:
            yield one, rights


@db.command(epilog="Example: apartment db upgrade")
def upgrade(
    to: Annotated[int | None, typer.Option(help="Back to an older version of the schema.")] = None,
    config: Config = CONFIG,
) -> None:
    """Bring the tables up to date and make the views anew; with --to go back, before an older program is installed."""
    from services.storage import open_storage, schema_version, upkeep

    address = _settings(load(config, ("persistence",))).address
    if to is not None:
        _say(f"{address}: from schema version {upkeep.take_back(address, to)} to {to}")
        return
    with closing(open_storage(address)) as storage:
        storage.remake_views()
        _say(f"{address}: schema version {schema_version(storage)}, {len(storage.items)} items and their views")


@db.command(epilog="Example: apartment db check")
def check(config: Config = CONFIG, json: Json = False) -> None:
    """Look whether the database is as it should be; exit 1 when something is not."""
    from services.storage import upkeep

    found = list(upkeep.look(_settings(load(config, ("persistence",))).address))
    if json:
        _say(dumps([{"good": good, "what": what} for good, what in found]))
    else:
        _say("\n".join(f"{'good' if good else 'BAD '}  {what}" for good, what in found))
    if not all(good for good, _ in found):
        raise typer.Exit(1)


@db.command(name="import", epilog="Example: apartment db import mysql://openhab@localhost/OpenHAB")
def import_(source: str, config: Config = CONFIG, json: Json = False) -> None:
    """Copy an OpenHAB's own tables into ours: of the old MySQL binding, or of the JDBC service. It may run again.

    Its password comes from OPENHAB_DATABASE_PASSWORD. Times without a zone are on the home's clock (`timezone`). Rows
    whose time has not come (forecasts) are left out.
    """
    from services.persistence import openhab_tables
    from services.storage import open_plain, open_storage

    apartment = load(config, ("persistence",))
    with closing(open_plain(_other(source))) as there, closing(open_storage(_settings(apartment).address)) as ours:
        tallies = [
            openhab_tables.copy(there, table, ours, apartment.home, apartment.home.zone, time.time())
            for table in openhab_tables.find(there)
        ]
    _tell(tallies, json)


@db.command(epilog="Example: apartment db export mysql://openhab@localhost/openhab_jdbc")
def export(
    target: str,
    layout: Annotated[str, typer.Option(help="jdbc (item0001) or mysql (Item1).")] = "jdbc",
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Write OpenHAB's real tables, one per item, into an empty database, for an OpenHAB that goes on with them."""
    from services.persistence import openhab_tables
    from services.storage import open_plain, open_storage

    apartment = load(config, ("persistence",))
    if layout not in openhab_tables.LAYOUTS:
        raise ConfigError([f"--layout: expected of {', '.join(openhab_tables.LAYOUTS)}, got {layout!r}"])
    with closing(open_plain(_other(target))) as there, closing(open_storage(_settings(apartment).address)) as ours:
        wanted = openhab_tables.LAYOUTS[layout]
        _tell(list(openhab_tables.write(ours, there, wanted, apartment.home.zone)), json)


@db.command(epilog="Example: apartment db grant grafana --host 192.0.2.7")
def grant(reader: str, host: str = "localhost", admin: Admin = "root", config: Config = CONFIG) -> None:
    """Let somebody read OpenHAB's tables and nothing else; from another machine by TLS alone.

    The password is asked for, or comes from READER_PASSWORD.
    """
    from services.storage import upkeep

    address = _settings(load(config, ("persistence",))).address
    password = os.environ.get("READER_PASSWORD") or typer.prompt("Password", hide_input=True, confirmation_prompt=True)
    upkeep.let_read(address, upkeep.administrator(address, admin, _admin_password()), reader, password, host)
    _say(f"{reader} at {host} may read {address.view_database}")


def _admin_password() -> str | None:
    """None where the server knows its administrator by the socket, as on Debian."""
    return os.environ.get("DATABASE_ADMIN_PASSWORD")


def _other(url: str) -> Address:
    from services.storage import read_address

    return read_address(url, password=os.environ.get("OPENHAB_DATABASE_PASSWORD"), view_database=NO_VIEWS)


def _tell(tallies: list[Tally], json: bool) -> None:
    if json:
        _say(dumps([asdict(one) for one in tallies]))
        return
    for one in tallies:
        odd = f", {one.odd} kept as text" if one.odd else ""
        future = f", {one.future} whose time has not come left out" if one.future else ""
        _say(f"{one.table}  {one.item}  {one.read} rows{odd}{future}")


def _question(
    item: str, what: Any, since: str | None, until: str | None, every: float | None, limit: int
) -> HistoryGet:
    try:
        return HistoryGet(
            id="terminal", item=item or None, what=what, since=since, until=until, every=every, limit=limit
        )
    except ValidationError as error:
        raise ConfigError([f"{one['loc'][0]}: {one['msg']}" for one in error.errors()]) from error


def _settings(apartment: Apartment) -> Persistence:
    from services import persistence

    if "persistence" not in apartment.instances:
        raise ConfigError([f"{apartment.file}:1: persistence: expected this section, got nothing"])
    settings = apartment.instances["persistence"].config
    assert isinstance(settings, persistence.Config)
    return settings


def _say(text: str) -> None:
    print(text, flush=True)
