"""The commands about what is stored: `apartment history` and `apartment db ...`. One short function each.

Not here: the other commands (`__main__.py`), the work itself (`services/history/`, `services/storage/`).
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from pydantic import ValidationError

from services.config import Apartment, load
from services.errors import ConfigError
from services.payloads import HistoryGet

if TYPE_CHECKING:  # the databases' libraries, for these commands alone
    from services.persistence import Config as Persistence

Config = Annotated[Path, typer.Option("--config", help="The configuration file.")]
Json = Annotated[bool, typer.Option("--json", help="Data instead of text.")]
CONFIG = Path("config/apartment.yaml")
db = typer.Typer(no_args_is_help=True, help="The database: make, check, upgrade, import, export, let others read.")


def add_to(app: typer.Typer) -> None:
    """Adds these commands to the program's."""
    app.command(epilog="Example: apartment history Lab_Temp --since 7d --every 1h")(history)
    app.add_typer(db, name="db")


def history(
    item: Annotated[str, typer.Argument(help="An item; needless for --what changes.")] = "",
    what: Annotated[str, typer.Option(help="samples, last, changes or durations (time in each state).")] = "samples",
    since: Annotated[str, typer.Option(help="A time, or how long ago: 90m, 24h, 7d.")] = "",
    until: Annotated[str, typer.Option(help="The same; now when not given.")] = "",
    every: Annotated[str, typer.Option(help="Count, least, mean, greatest per 5m, 1h, 1d.")] = "",
    limit: int = 20,
    plot: Annotated[Path | None, typer.Option(help="Draw the numbers into this SVG file.")] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Comma-separated values.")] = False,
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Show what was stored of an item, oldest first; exit 1 when there is nothing."""
    from services.history import command  # the database's libraries, for this command alone

    apartment = load(config, ("persistence",))
    address, zone, now = _settings(apartment).address, apartment.home.zone, time.time()
    begin, end = command.moment(since, now, zone), command.moment(until, now, zone)
    asked = _question(item, what, begin, end, command.every_s(every), limit)
    if plot is not None:
        plot.write_text(command.as_plot(address, asked, zone), encoding="utf-8")
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
