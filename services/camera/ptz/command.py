"""`apartment calibrate ptz CAMERA`: asks, orders it of the running service, and shows what was learnt.

The service does the work, as with any order: it has the motors, arbitration and the watchdog. Not here: how
(`calibrate.py`).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.prompt import Confirm
from rich.table import Table

from services.camera.ptz import calibrate
from services.camera.ptz.kept import recalled
from services.camera.ptz.skill import Skill
from services.errors import ConfigError

ASK = "May {} turn now? It turns every way for two to four minutes, with every speed, and returns to where it looks."


def run(out: Console, camera: str, state: Path, order: Callable[[], bool], *, yes_move: bool) -> bool:
    """Asks before anything moves; whether it was done. `order` gives the order and waits for its end."""
    if not yes_move:
        if not sys.stdin.isatty():
            raise ConfigError(["--yes-move: expected it where nobody can be asked: the camera moves"])
        if not Confirm.ask(ASK.format(camera), console=out):
            return False
    if not order():
        return False
    skill = recalled(state, camera)
    if skill is None:
        out.print(f"done; what was learnt is kept where the service runs, not in {state}")
    else:
        show(out, skill)
    return True


def show(out: Console, skill: Skill) -> None:
    """The speed table, and the habits below it."""
    rows = Table("axis", "speed", "per second", "+-")
    for one in calibrate.table(skill):
        rows.add_row(one.axis, str(one.speed), f"{one.rate:.2f}", f"{one.doubt:.2f}")
    out.print(rows)
    for name, value in calibrate.habits(skill).items():
        out.print(f"{name}: {value}")
