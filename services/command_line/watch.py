"""`apartment watch`: what goes over the bus, as it comes, for people and for other programs.

Not here: keeping it (`record.py`), the form of a line of data (`recording.py`).
"""

from __future__ import annotations

import json as json_
from datetime import datetime, tzinfo
from typing import Annotated

import typer
from rich.highlighter import JSONHighlighter
from rich.text import Text

from services import process
from services.bus import Message
from services.command_line import hearing, recording
from services.command_line.options import CONFIG, Config, Json, out, printable
from services.config import load

NARROW = 400  # characters of a message where there is no terminal whose width would say
COLOURED = JSONHighlighter()


def watch(
    filters: Annotated[list[str] | None, hearing.FILTERS] = None,
    count: Annotated[int | None, typer.Option(min=1, help="End after so many; exit 1 when fewer came.")] = None,
    seconds: Annotated[float | None, typer.Option("--for", min=0.0, help="End after so many seconds.")] = None,
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Show what goes over the bus, as it comes; Ctrl-C ends it.

    First comes what the broker retains, marked R. --json: one object a line, as in a recording.
    """
    wanted, apartment = hearing.checked(filters or ["#"]), load(config)
    zone, left, stopwatch = apartment.home.zone, count, hearing.Stopwatch(seconds)
    with process.stop_signals(stopwatch.stop), hearing.listening(apartment.bus, wanted) as batches:
        for came in batches(stopwatch):
            for message in came[:left]:
                typer.echo(recording.line(message)) if json else _show(message, zone)
            left = None if left is None else left - len(came[:left])
            if left == 0:
                return
    if left:
        raise typer.Exit(1)


def _show(message: Message, zone: tzinfo) -> None:
    shown = text_of(message, zone)
    if not out.is_terminal:
        typer.echo(shown.plain)
        return
    shown.truncate(out.width, overflow="ellipsis")
    out.print(shown)


def text_of(message: Message, zone: tzinfo) -> Text:
    """One line: time in that zone, R where it was retained, topic, payload; JSON in colours."""
    when = datetime.fromtimestamp(message.received, zone)
    text = Text().append(f"{when:%H:%M:%S}.{when.microsecond // 1000:03d} ", style="dim")
    text.append("R " if message.retain else "  ", style="magenta")
    text.append(f"{printable(message.topic)} ", style="bold")
    payload = Text(short(message.payload))
    if _is_json(message.payload):
        COLOURED.highlight(payload)
    return text.append_text(payload)


def short(payload: bytes) -> str:
    """A payload in NARROW characters of one line, without anything that would steer a terminal."""
    try:
        text = printable(payload.decode())
    except UnicodeDecodeError:
        return f"<{len(payload)} bytes>"
    return text if len(text) <= NARROW else f"{text[: NARROW - 1]}…"


def _is_json(payload: bytes) -> bool:
    if payload[:1] not in (b"{", b"["):
        return False
    try:
        json_.loads(payload)
    except ValueError:
        return False
    return True
