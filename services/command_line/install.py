"""`apartment install`: puts the apartment on this machine as services of systemd.

Not here: the work itself, `services/installation/`.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from services.command_line.options import CONFIG, Config, out
from services.errors import ConfigError

PLACEHOLDER = "not yet known"  # for a secret that the check of a new configuration would miss


def install(
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only show what would be done.")] = False,
    systemd: Annotated[bool, typer.Option("--systemd", help="Do it.")] = False,
    host: Annotated[list[str] | None, typer.Option(help="A name of this machine, for its certificates.")] = None,
    compose_file: Annotated[
        Path | None, typer.Option("--compose", help="Write a compose file there, for containers.")
    ] = None,
    root: Annotated[Path, typer.Option(help="Write below this folder instead, and run nothing.")] = Path("/"),
    config: Config = CONFIG,
) -> None:
    """Install as services of systemd: units, users, folders, passwords, certificates, the broker's files."""
    from services import document
    from services.command_line.secrets import own_hosts
    from services.config import load
    from services.credentials import passwords
    from services.installation import compose, layout, steps

    if [dry_run, systemd, compose_file is not None].count(True) != 1:
        raise ConfigError(["install: expected one of --dry-run, --systemd and --compose"])
    there = root / layout.SYSTEM.relative_to("/") / config.name
    file = there if there.is_file() else config
    unknown = {name: PLACEHOLDER for names in passwords.names(file) for name in names}
    apartment = load(file, None, {**os.environ, **unknown})
    if compose_file is not None:
        document.write(compose_file, compose.compose(layout.parts(apartment), config.name))
        return
    plan = [] if there.is_file() else list(steps.copied(config.parent, root))
    plan += steps.files(apartment, Path(sys.executable))
    plan += list(steps.gone(plan, root))
    plan += [steps.ACCOUNTS]
    after = [*steps.handed_out(root), *steps.commands()]
    if systemd:
        for step in plan:
            steps.do(step, root)
        for told in steps.fill_secrets(there, [*(host or []), *own_hosts()], root):
            out.print(told, markup=False)
        for step in after:
            steps.do(step, root)
    else:
        plan += steps.filled(file, root)
    for step in [*plan, *after]:
        out.print(str(step), markup=False)
    for line in steps.next_words():
        out.print(line, markup=False)
