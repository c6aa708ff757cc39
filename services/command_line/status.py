"""`apartment status`: how the apartment stands, on one screen, once or as it goes on.

Not here: what is known (`standing.py`), why something is not well (`services/doctor/`).
"""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime, tzinfo
from time import time
from typing import Annotated, Any, Literal

import typer
from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.live import Live
from rich.segment import Segment
from rich.style import Style
from rich.table import Table
from rich.text import Text

from services.command_line import hearing
from services.command_line.options import CONFIG, Config, Json, out, printable
from services.command_line.standing import COUNTED, FILTERS, STALE_S, Camera, Robot, Service, Standing
from services.config import load
from services.errors import ConfigError
from services.payloads import stamp

LISTENS_S = STALE_S + 0.5  # two diagnostics of each service come within 2 s; a busy machine takes longer
WIDE = 160  # columns where there is no terminal that has some
COLOURS = {
    "online": "green", "offline": "red", "never seen": "red", "service offline": "red", "service never seen": "red",
    "ok": "green", "warning": "yellow", "error": "red", "stale": "yellow",
}  # fmt: skip


def status(
    live: Annotated[bool, typer.Option("--live", help="Go on showing it, until Ctrl-C.")] = False,
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Show on one screen how it stands: services and how busy they are, cameras, robots, troubles.

    Exit 1 when a service is not online, or the broker went away.
    """
    if live and (json or not out.is_terminal):
        raise ConfigError(["--live: expected a terminal and no --json"])
    apartment = load(config)
    zone = apartment.home.zone
    on_bus = [name for name, one in apartment.instances.items() if one.row.on_bus]
    standing = Standing.of(on_bus, apartment.cameras)
    with hearing.listening(apartment.bus, FILTERS) as batches:
        if live:
            with Live(screen(standing, zone), console=out, screen=True, auto_refresh=False) as shown:
                for came in batches(hearing.Stopwatch()):
                    _hear(standing, came, connected=batches.connected)
                    shown.update(screen(standing, zone), refresh=True)
        for came in batches(hearing.Stopwatch(LISTENS_S)):
            _hear(standing, came, connected=batches.connected)
            if standing.settled:
                break
    if json:
        out.print_json(data=data(standing))
    else:
        out.print(screen(standing, zone), width=None if out.is_terminal else WIDE, crop=False)
    if not standing.well:
        raise typer.Exit(1)


def _hear(standing: Standing, came: list[Any], *, connected: bool) -> None:
    standing.look(time(), connected=connected)
    for message in came:
        standing.hear(message)


def data(standing: Standing) -> dict[str, Any]:
    """The same for a program."""

    def dump(one: Service | Camera | Robot, **more: object) -> dict[str, Any]:
        shown = {name: value for name, value in vars(one).items() if name not in ("counted", "posed")} | more
        return {name: value.model_dump() if hasattr(value, "model_dump") else value for name, value in shown.items()}

    def seen(one: Robot) -> dict[str, Any]:
        return dump(one, away=standing.away("mission"), was_there=standing.was_there(one))

    return {
        "no_broker_since": None if standing.gone is None else stamp(standing.gone),
        "services": {name: dump(one, stale=standing.is_stale(one)) for name, one in sorted(standing.services.items())},
        "cameras": {
            name: dump(one, away=standing.away(f"camera-{name}")) for name, one in sorted(standing.cameras.items())
        },
        "robots": {name: seen(one) for name, one in sorted(standing.robots.items())},
        "troubles": [asdict(one) for one in standing.troubles()],
    }


def screen(standing: Standing, zone: tzinfo) -> Group:
    """Everything as tables; those that would be empty are left out, and all are pale while there is no broker."""
    tables = [_services(standing, zone), _cameras(standing), _robots(standing, zone), _troubles(standing, zone)]
    parts = [part for one in tables if one.row_count for part in (one, Text())]
    if standing.gone is None:
        return Group(*parts)
    since = f"{datetime.fromtimestamp(standing.gone, zone):%H:%M:%S}"
    return Group(Text(f"no broker since {since}; what was known then:", style="bold red"), Text(), *map(_Pale, parts))


class _Pale:
    """A part of the screen without its colours: nothing of it is so any more, as far as we know."""

    def __init__(self, part: Table | Text) -> None:
        self._part = part

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield from Segment.apply_style(
            Segment.remove_color(console.render(self._part, options)), post_style=Style(dim=True)
        )


def _services(standing: Standing, zone: tzinfo) -> Table:
    table = _table("service", "status", "since", "version", "received/s", "published/s", "bad", "health")
    for name, one in sorted(standing.services.items()):
        stale = standing.is_stale(one)
        busy = one.rates if one.status == "online" and not stale else None
        rates = [f"{busy[kind]:.1f}" if busy else "" for kind in COUNTED]
        since, version = (when(one.info.started, zone), one.info.version) if one.info else ("", "")
        bad = f"{one.info.counters.get('bad', 0):.0f}" if one.info else ""
        health = one.diagnostic.message if one.diagnostic and one.status == "online" else ""
        if stale:
            health = "stale"
        _add(table, name, one.status, since, version, *rates, bad, health)
    return table


def _cameras(standing: Standing) -> Table:
    table = _table("camera", "status", "looks at", "scan", "reason")
    for name, one in sorted(standing.cameras.items()):
        if away := standing.away(f"camera-{name}"):
            _add(table, name, away, "", "", "")
            continue
        place = "" if one.position is None else one.position.place or _degrees(one.position.pan, one.position.tilt)
        scan = "" if one.scan is None else str(one.scan.state)
        if one.scan is not None and one.scan.state == "running":
            scan = f"running {100 * one.scan.progress:.0f} %"
        _add(table, name, one.status.state if one.status else "", place, scan, one.status.reason if one.status else "")
    return table


def _degrees(pan: float, tilt: float) -> str:
    return f"{pan:.1f}° {tilt:.1f}°"


def _robots(standing: Standing, zone: tzinfo) -> Table:
    table = _table("robot", "mission", "marker", "at, m", "seen", "reason")
    for name, one in sorted(standing.robots.items()):
        step, reason = (one.mission.state, one.mission.reason) if one.mission else ("", "")
        marker = "" if one.mission is None or one.mission.marker is None else str(one.mission.marker)
        if away := standing.away("mission"):
            step, marker, reason = away, "", ""
        at, seen = (f"{one.pose.x:.2f} {one.pose.y:.2f}", when(one.pose.stamp, zone)) if one.pose else ("", "")
        if at and standing.was_there(one):
            at = f"was {at}"
        _add(table, name, step, marker, at, seen, reason)
    return table


def _troubles(standing: Standing, zone: tzinfo) -> Table:
    table = _table("trouble", "level", "since", "what")
    for one in standing.troubles():
        _add(table, one.who, one.level if one.now else f"was {one.level}", when(one.time, zone), one.message)
    return table


def when(at: str, zone: tzinfo) -> str:
    """A time of ours on the home's clock; as it stands when it is none."""
    try:
        return f"{datetime.fromisoformat(at).astimezone(zone):%d.%m. %H:%M:%S}"
    except ValueError:
        return at


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, title_justify="left", header_style="bold")
    for name in columns:
        justify: Literal["right", "left"] = "right" if name.endswith("/s") or name == "bad" else "left"
        table.add_column(name, justify=justify, no_wrap=name != columns[-1])
    return table


def _add(table: Table, *cells: str) -> None:
    """As it is, without rich's markup: what stands on the bus has no say over the terminal."""
    table.add_row(*(Text(printable(one), style=COLOURS.get(one, "")) for one in cells))
