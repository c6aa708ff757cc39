"""`apartment doctor`: what is not well, and how it is mended.

Not here: the looking, `services/doctor/`.
"""

from __future__ import annotations

import os
from dataclasses import asdict

import typer

from services.command_line.options import CONFIG, Config, Json, out


def doctor(
    config: Config = CONFIG,
    json: Json = False,
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
    if config != CONFIG and not json and any(" apartment " in f" {one.mend}" for one in findings):
        out.print(f"      (each `apartment ...` with --config {config})", markup=False)
    if json:
        out.print_json(data=[asdict(one) for one in findings])
    if not all(one.good for one in findings):
        raise typer.Exit(1)
