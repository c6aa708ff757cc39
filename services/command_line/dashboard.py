"""`apartment dashboard ...`: makes the line of the configuration that lets somebody log in."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from services.command_line.options import CONFIG, Unread

app = typer.Typer(no_args_is_help=True, help="Who may open the dashboard.")
SHORTEST = 8


@app.callback()
def about() -> None:
    """Who may open the dashboard."""


@app.command(epilog="Example: apartment dashboard user ann --role operator")
def user(
    name: str,
    role: Annotated[str, typer.Option(help="viewer (looks only) or operator.")] = "viewer",
    _config: Unread = CONFIG,
) -> None:
    """Ask for a password and print the line for `dashboard.users`: the hash alone stands there."""
    from services.dashboard import passwords  # for this command alone

    if role not in ("viewer", "operator"):
        raise typer.BadParameter(f"expected viewer or operator, got {role!r}")
    password = _asked()
    if len(password) < SHORTEST:
        raise typer.BadParameter(f"expected at least {SHORTEST} characters")
    typer.echo(f'{name}: {{role: {role}, password: "{passwords.hashed(password)}"}}')


def _asked() -> str:
    """From the terminal, twice; else the first line of standard input."""
    if not sys.stdin.isatty():
        return sys.stdin.readline().rstrip("\n")
    return str(typer.prompt("Password", hide_input=True, confirmation_prompt=True))
