"""`apartment scan`: a scan is ordered, its progress shown, and what it found told as a table.

Not here: the picture of it (`scanned.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from math import inf, sqrt
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from services import client
from services.client import Client
from services.command_line import completion
from services.command_line.options import CONFIG, Camera, Config, Json, out, printable, writable
from services.command_line.order import with_camera
from services.config import load
from services.payloads import OrderResult, ScanResult, ScanState
from services.topics import read

Advance = Callable[[ScanState], None]
Target = Annotated[
    list[int], typer.Option(metavar="ID...", help="The markers; may be repeated.", autocompletion=completion.markers)
]
More = Annotated[
    list[int] | None, typer.Argument(metavar="ID", help="More, after --target.", autocompletion=completion.markers)
]


def scan(
    camera: Camera,
    target: Target,
    more: More = None,
    full: Annotated[bool, typer.Option("--full", help="Every place, in both picture modes.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw a plan with what was found into this PNG file.")] = None,
    world: Annotated[Path | None, typer.Option(help="The file with the rooms; default: the simulated one.")] = None,
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Look for markers with a camera; exit 1 when one of them was not found."""
    from services.command_line import scanned  # it brings OpenCV

    writable(plot, "--plot")
    apartment = with_camera(load(config), camera)
    wanted = list(dict.fromkeys([*target, *(more or [])]))
    filters = [row.filter_for(cam=camera) for row in scanned.HEARD]
    with client.connected(apartment.bus, filters) as bus, progress(out, quiet=json) as advance:
        end = ordered(bus, camera, {"targets": wanted, "full": full}, advance)
    found = newest(read(message, message.received).payload for message in bus.seen)
    missing = [str(marker) for marker in wanted if marker not in found]
    if json:
        for one in found.values():
            out.print_json(one.model_dump_json(), indent=None)
    else:
        _show(found, missing, "" if end.state == "done" else f" ({end.error or end.state})")
    if plot is not None:
        scanned.plot(apartment, camera, bus.seen, plot, world)
    if end.state != "done" or missing:
        raise typer.Exit(1)


@contextmanager
def progress(screen: Console, *, quiet: bool = False) -> Iterator[Advance]:
    """A bar on a terminal, a line for each place elsewhere."""
    columns = (TextColumn("  {task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=screen, disable=quiet or not screen.is_terminal, transient=True) as bar:
        task = bar.add_task("scan", total=1.0)
        told: list[str] = []

        def advance(state: ScanState) -> None:
            text = printable(f"{state.place or state.state} ({state.frames_analysed} frames)")
            bar.update(task, completed=state.progress, description=text)
            place = state.place or ""
            if not quiet and not screen.is_terminal and place and place not in told:
                told.append(place)
                screen.print(f"  looking from {place}")

        yield advance


def ordered(bus: Client, camera: str, wish: object, advance: Advance, timeout_s: float = inf) -> OrderResult:
    """Orders a scan, and shows each of its states until its end."""

    def hear(said: object) -> None:
        if isinstance(said, ScanState) and said.state == "running":
            advance(said)

    return bus.order(camera, "Scan", wish, timeout_s, hear=hear)


def newest(said: Iterable[object]) -> dict[int, ScanResult]:
    """By marker, where it was seen last: a scan tells of every place where a marker was seen at a time."""
    results = [one for one in said if isinstance(one, ScanResult)]
    return {one.marker: one for one in sorted(results, key=lambda result: result.stamp)}


def _show(found: dict[int, ScanResult], missing: list[str], why: str) -> None:
    if found:
        out.print(table(found.values()))
    if missing:
        out.print(f"not found: {', '.join(missing)}{why}", markup=False)


def table(found: Iterable[ScanResult]) -> Table:
    """Metres in the apartment; the standard deviation is that of the worst axis."""
    made = Table("marker", "x", "y", "z", "±", "seen from", "at (UTC)", "distance")
    for one in sorted(found, key=lambda result: result.marker):
        at = (f"{one.position.x:.3f} m", f"{one.position.y:.3f} m", f"{one.position.z:.3f} m") if one.position else ()
        sigma = sqrt(max(0.0, *(row[n] for n, row in enumerate(one.covariance)))) if one.covariance else None
        sure = f"{1000 * sigma:.0f} mm" if sigma is not None else one.why or ""
        far = f"{one.distance:.2f} m" if one.distance is not None else ""
        made.add_row(str(one.marker), *(at or ("", "", "")), sure, one.place, one.stamp[11:19], far)
    return made
