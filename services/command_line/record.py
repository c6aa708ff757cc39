"""`apartment record`: what goes over the bus, with its times, into a file for a bug report or a demonstration.

Not here: the file's form (`recording.py`), saying it again (`replay.py`).
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path
from typing import Annotated, TextIO

import typer

from services import __version__, process, topics
from services.bus import Message
from services.command_line import hearing, recording
from services.command_line.options import CONFIG, Config, out
from services.config import load
from services.errors import BadMessage, ConfigError
from services.topics import Kind

MEGABYTE = 1_000_000


def record(
    file: Annotated[Path, typer.Argument(help="A new file; packed when its name ends in .gz.")],
    filters: Annotated[list[str] | None, hearing.FILTERS] = None,
    seconds: Annotated[float | None, typer.Option("--for", min=0.0, help="End after so many seconds.")] = None,
    pictures: Annotated[bool, typer.Option("--pictures", help="Pictures too.")] = False,
    limit: Annotated[float, typer.Option(min=0.001, help="End when so many megabytes are written, unpacked.")] = 500.0,
    config: Config = CONFIG,
) -> None:
    """Write what goes over the bus into a file, what is retained first, until Ctrl-C, SIGTERM or the limit.

    It tells who was at home when: look at it before it goes to somebody else.
    """
    wanted, apartment = hearing.checked(filters or ["#"]), load(config)
    watch, written = hearing.Stopwatch(seconds), 0
    with process.stop_signals(watch.stop):
        with hearing.listening(apartment.bus, wanted) as batches, closing(_new(file)) as output:
            size = _write(output, [recording.header(__version__, time.time(), wanted)])
            for came in batches(watch):
                lines = [recording.line(one) for one in came if pictures or not is_picture(one)]
                size, written = size + _write(output, lines), written + len(lines)
                if size > limit * MEGABYTE:
                    out.print(f"{limit:g} MB are written: this is the end (--limit)")
                    break
        out.print(f"{file}: {written} messages, {size / MEGABYTE:.3f} MB", markup=False)


def _new(file: Path) -> TextIO:
    try:
        return recording.create(file)
    except OSError as error:
        raise ConfigError([f"{file}: expected a new file that can be written, got: {error.strerror}"]) from error


def _write(output: TextIO, lines: Iterable[str]) -> int:
    """Writes whole lines, so that a file is good up to its last one whatever happens to us; how many bytes."""
    text = "".join(f"{one}\n" for one in lines)
    if text:
        output.write(text)
        output.flush()
    return len(text.encode())


def is_picture(message: Message) -> bool:
    """Whether it carries a picture, by the table; on a topic that is not in it, whether it is no text."""
    try:
        return topics.find(message.topic)[0].kind is Kind.BLOB
    except BadMessage:
        return not _is_text(message.payload)


def _is_text(payload: bytes) -> bool:
    try:
        payload.decode()
    except UnicodeDecodeError:
        return False
    return True
