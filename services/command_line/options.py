"""What nearly every command has: the screen, the configuration file, data instead of text, leave to move."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from services.command_line import completion

CONFIG = Path("config/apartment.yaml")
Config = Annotated[Path, typer.Option("--config", help="The configuration file.")]
Unread = completion.Unread
Json = Annotated[bool, typer.Option("--json", help="Data instead of text.")]
YesMove = Annotated[bool, typer.Option("--yes-move", help="It may move; else the terminal is asked.")]
Camera = Annotated[str, typer.Argument(autocompletion=completion.cameras)]
Marker = Annotated[int, typer.Argument(min=0, max=9999, autocompletion=completion.markers)]
SERVICES = typer.Argument(autocompletion=completion.services)
out = Console(soft_wrap=True, highlight=False)
