"""`apartment scan`: a scan is ordered, its progress shown, and what it found told as a table.

Not here: the picture of it (`scanned.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from math import sqrt
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from services import client, topics
from services.bus import Message
from services.client import Client
from services.command_line import completion
from services.command_line.options import CONFIG, Camera, Config, Json, out
from services.config import load
from services.payloads import OrderResult, ScanResult, ScanState

LONGEST_S = 600.0
Advance = Callable[[ScanState], None]


def scan(
    camera: Camera,
    target: Annotated[list[int], typer.Option(help="A marker; repeat for more.", autocompletion=completion.markers)],
    full: Annotated[bool, typer.Option("--full", help="Every place, in both picture modes.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw a plan with what was found into this PNG file.")] = None,
    world: Annotated[Path | None, typer.Option(help="The file with the rooms; default: the simulated one.")] = None,
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Look for markers with a camera; exit 1 when one was not found."""
    from services.command_line import scanned  # it brings OpenCV

    apartment = load(config)
    if camera not in apartment.cameras:
        raise typer.BadParameter(f"expected one of {', '.join(apartment.cameras) or 'none'}, got {camera!r}")
    filters = [row.filter_for(cam=camera) for row in (topics.CAMERA_ORDER_RESULT, *scanned.HEARD)]
    with client.connected(apartment.bus, filters) as bus, progress(out, quiet=json) as advance:
        end = _ended(bus, camera, {"targets": target, "full": full}, advance)
        heard = [message for message in bus.seen if not message.topic.endswith("/order_result")]
    found = {one.payload.marker: one for one in map(_read, heard) if one.topic is topics.CAMERA_SCAN_RESULT}
    if json:
        for one in found.values():
            out.print_json(one.message.payload.decode())
    else:
        out.print(table(one.payload for one in found.values()) if found else f"found nothing: {end.error or end.state}")
    if plot is not None:
        scanned.plot(apartment, camera, heard, plot, world)
    if end.state != "done" or not found:
        raise typer.Exit(1)


@contextmanager
def progress(screen: Console, *, quiet: bool = False) -> Iterator[Advance]:
    """A bar on a terminal, a line for each place elsewhere."""
    columns = (TextColumn("  {task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=screen, disable=quiet or not screen.is_terminal, transient=True) as bar:
        task = bar.add_task("scan", total=1.0)
        told: list[str] = []

        def advance(state: ScanState) -> None:
            text = f"{state.place or state.state} ({state.frames_analysed} frames)"
            bar.update(task, completed=state.progress, description=text)
            place = state.place or ""
            if not quiet and not screen.is_terminal and place and place not in told:
                told.append(place)
                screen.print(f"  looking from {place}")

        yield advance


def _ended(bus: Client, camera: str, wish: dict[str, object], advance: Advance) -> OrderResult:
    """Waits for the end of the scan that is ordered, and shows each of its states meanwhile."""
    given = bus.give(camera, "Scan", wish)

    def is_the_end(message: Message) -> bool:
        payload = _read(message).payload
        if isinstance(payload, ScanState) and payload.state == "running":
            advance(payload)
        return isinstance(payload, OrderResult) and payload.id == given and payload.final

    result: OrderResult = _read(bus.until(is_the_end, LONGEST_S, "the end of the scan")).payload
    return result


def _read(message: Message) -> topics.Read:
    return topics.read(message, message.received)


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
