"""What a service is started with by systemd: it sees nothing of the shell in which somebody asks."""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Mapping

from services.config import Apartment
from services.installation import layout

ANSWER_S = 5.0


def of(apartment: Apartment, service: str) -> str:
    """The name of the unit in which a service runs, or would run."""
    return next(part.unit for part in layout.parts(apartment) if service in [one.name for one in part.services])


def environment(unit: str, shell: Mapping[str, str]) -> Mapping[str, str]:
    """The environment of a unit, with what people added to it; where systemd has no such unit that of the shell."""
    command = ["systemctl", "show", "--property=LoadState,Environment", unit]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=ANSWER_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return shell
    told = dict(line.partition("=")[::2] for line in done.stdout.splitlines())
    if told.get("LoadState") != "loaded":
        return shell
    return dict(word.partition("=")[::2] for word in shlex.split(told.get("Environment", "")))
