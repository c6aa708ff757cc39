"""`apartment doctor`: what is not well, and how it is mended.

Not here: the looking, `services/doctor/`.
"""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

CONFIG = Path("config/apartment.yaml")
out = Console(soft_wrap=True, highlight=False)


def doctor(
    config: Annotated[Path, typer.Option("--config", help="The configuration file.")] = CONFIG,
    json: Annotated[bool, typer.Option("--json", help="Data instead of text.")] = False,
) -> None:
    """Look whether all that the apartment needs is well, and name the mend of what is not (then exit 1)."""
    from services.doctor.examination import examine  # databases and HTTP, for this command alone

    findings = []
    for one in examine(config, os.environ):
        findings.append(one)
        if not json:
            out.print(f"{'well' if one.good else 'ILL '}  {one.part}: {one.what}", markup=False)
            if not one.good:
                out.print(f"      mend: {one.mend}", markup=False)
    if json:
        out.print_json(data=[asdict(one) for one in findings])
    if not all(one.good for one in findings):
        raise typer.Exit(1)
