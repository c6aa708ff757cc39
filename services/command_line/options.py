"""What nearly every command has: the screen, the configuration file, data instead of text, leave to move, files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.text import Text

from services.command_line import completion
from services.errors import ConfigError

CONFIG = Path("config/apartment.yaml")
Config = Annotated[Path, typer.Option("--config", help="The configuration file.")]
Unread = completion.Unread
Json = Annotated[bool, typer.Option("--json", help="Data instead of text.")]
YesMove = Annotated[bool, typer.Option("--yes-move", help="It may move; else the terminal is asked.")]
Camera = Annotated[str, typer.Argument(autocompletion=completion.cameras)]
Marker = Annotated[int, typer.Argument(min=0, max=9999, autocompletion=completion.markers)]
SERVICES = typer.Argument(autocompletion=completion.services)


def printable(text: str) -> str:
    """The text with an escape for each character that is none to look at: whoever publishes has no say over us."""
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


class Screen(Console):
    """Shows every text as it is, line by line: a place named `TV [old]` is no markup, and nothing steers the terminal.

    A `Text` is made by us, and shown as it was made.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(soft_wrap=True, highlight=False, markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """See rich; every str that is printed, or stands in a table, comes by here."""
        return super().render_str("\n".join(map(printable, text.split("\n"))), **options)


out = Screen()


def writable(file: Path | None, option: str) -> None:
    """ConfigError when no file can be written there: told before the work, not after it."""
    if file is None:
        return
    if file.is_dir() or not os.access(file if file.exists() else file.parent, os.W_OK):
        raise ConfigError([f"{option}: expected a file that can be written, got {str(file)!r}"])
