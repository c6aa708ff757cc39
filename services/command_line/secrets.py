"""`apartment secrets ...`: makes the passwords and certificates of an installation, and renews them.

Not here: the work itself, `services/credentials/`.
"""

from __future__ import annotations

import socket
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from services import secret_store
from services.command_line.options import CONFIG, Config, Unread, out
from services.errors import ConfigError

if TYPE_CHECKING:  # certificates, for these commands alone
    from services.credentials.folder import Folder

app = typer.Typer(no_args_is_help=True, help="Passwords and certificates of an installation.")
Out = Annotated[
    Path | None, typer.Option("--out", help="Their folder; default /etc/apartment/secrets or ~/.config/...")
]


@app.command(epilog="Example: apartment secrets init --host apartment.lan")
def init(
    host: Annotated[
        list[str] | None, typer.Option(help="A name or address of this machine, for its certificates; repeat for more.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="All anew, also what is there already.")] = False,
    out_folder: Out = None,
    config: Config = CONFIG,
) -> None:
    """Make what is missing: a password for every account, the broker's files, an authority and its certificates."""
    from services.credentials import folder

    for line in folder.fill(_folder(out_folder), config, [*(host or []), *own_hosts()], datetime.now(UTC), force=force):
        out.print(line, markup=False)


@app.command(epilog="Example: apartment secrets renew --within 60")
def renew(
    within: Annotated[int, typer.Option(help="Days that a certificate still holds.")] = 60,
    out_folder: Out = None,
    _config: Unread = CONFIG,
) -> None:
    """Renew the certificates that end soon; then reload the broker and restart the dashboard."""
    from services.credentials import folder

    for line in folder.renew(_folder(out_folder), timedelta(days=within), datetime.now(UTC)):
        out.print(line, markup=False)


@app.command(name="set", epilog="Example: apartment secrets set CAMERA_IP1_PASSWORD")
def set_(name: str, out_folder: Out = None, _config: Unread = CONFIG) -> None:
    """Keep a password that was made elsewhere; it is asked for, or read from standard input."""
    text = typer.prompt("Password", hide_input=True) if sys.stdin.isatty() else sys.stdin.readline().rstrip("\n")
    if not name.replace("_", "").isalnum() or not text.isprintable() or not text:
        raise ConfigError([f"{name}: expected a name of letters, digits and _, and a password in one line"])
    kept = _folder(out_folder)
    kept.make()
    kept.keep({**kept.secrets(), name: text})


def _folder(path: Path | None) -> Folder:
    from services.credentials.folder import Folder

    return Folder(path or secret_store.home())


def own_hosts() -> list[str]:
    """How this machine is called in its own network, and by itself."""
    name = socket.gethostname()
    return list(dict.fromkeys((name, f"{name}.local", "localhost", "127.0.0.1", "::1")))
