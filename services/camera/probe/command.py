"""`apartment probe`: which camera, with which password, may it move, and where the papers go."""

from __future__ import annotations

import getpass
import json
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from pydantic import SecretStr
from rich.console import Console
from rich.live import Live
from rich.prompt import Confirm
from rich.table import Table

from services.camera.address import Address
from services.camera.probe import likeness, paper, show
from services.camera.probe.contact import Teller, contact
from services.camera.probe.findings import Findings
from services.camera.probe.wire import Wire
from services.camera.settings import Config
from services.camera.watchdog import Watchdog
from services.errors import ConfigError

PASSWORD = "CAMERA_{}_PASSWORD"
ASK = (
    "May it move now? It turns by some 20 degrees to each side and up and down, tries one absolute position 3 degrees "
    "away, and returns to where it looks."
)


NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class Target:
    """Which camera, and who logs in."""

    name: str
    url: str
    user: str
    password: SecretStr
    certificate: Path | None = None


def stranger(
    name: str, url: str, user: str, secret: Callable[[str], str | None], certificate: Path | None = None
) -> Target:
    """A camera that no configuration knows yet; its password is where secrets are, or asked on the terminal."""
    if not NAME.fullmatch(name):
        raise ConfigError([f"CAMERA: expected a name like ip1 (small letters, digits, _), got {name[:80]!r}"])
    if "@" in url or not url.startswith(("http://", "https://")):
        raise ConfigError([f"--url: expected http://host or https://host without a password in it, got {url[:80]!r}"])
    if certificate is not None and not url.startswith("https://"):
        raise ConfigError([f"--certificate: expected an https:// address with --url beside it, got {url[:80]!r}"])
    variable = PASSWORD.format(name.upper())
    known = secret(variable)
    if known is not None:
        return Target(name, url, user, SecretStr(known), certificate)
    if not sys.stdin.isatty():
        raise ConfigError([f"{variable}: expected the camera's password in the environment, got nothing"])
    return Target(name, url, user, SecretStr(getpass.getpass(f"Password of {user} at {url}: ")), certificate)


def configured(name: str, settings: object) -> Target:
    """A camera of the configuration."""
    assert isinstance(settings, Config)
    return Target(name, settings.url, settings.user, settings.password, settings.address.certificate)


def run(
    out: Console, camera: Target, folder: Path, known: likeness.Known, *, yes_move: bool, json_only: bool
) -> Findings:
    """Finds out, tells, and writes the papers into the folder. DeviceError when the camera cannot be asked.

    `known`: the firmwares that have a name, to say which of them it is like.
    """
    quiet = Console(stderr=True, soft_wrap=True, highlight=False) if json_only else out
    wire = Wire(camera.url, camera.user, camera.password, camera.certificate)
    with closing(wire), telling(quiet) as (teller, pause), ExitStack() as stack:

        def may_move(found: Findings) -> bool:
            if allowed := yes_move or _asked(quiet, found, pause):
                channel = found.switches["ptz_channels"][-1]
                address = Address(
                    camera.url, camera.user, camera.password, channel=channel, certificate=camera.certificate
                )
                wire.turning = stack.enter_context(closing(Watchdog("amcrest", address))).tell
            return allowed

        found = contact(wire, teller, may_move)
    found.like = likeness.nearest(found.switches, known)
    files = paper.write(folder, found, wire, camera.name)
    if json_only:
        out.print_json(json.dumps(found.data()))
        return found
    show.report(out, found)
    _say_files(out, files, camera)
    return found


@contextmanager
def telling(console: Console) -> Iterator[tuple[Teller, Live | None]]:
    """Shows the steps as they are done."""
    if not console.is_terminal:
        yield show.Lines(console), None
        return
    with Live(console=console, refresh_per_second=10, transient=True) as live:
        yield show.Spinning(console, live), live


def _asked(console: Console, found: Findings, live: Live | None) -> bool:
    """Whether it may move; without a terminal there is nobody to ask, so it may not."""
    if live is None or not sys.stdin.isatty():
        return False
    live.stop()
    console.print(f"\nEverything so far was only read. The camera looks at {show.where(found)}.")
    allowed = Confirm.ask(ASK, console=console, default=False)
    live.start()
    return allowed


def _say_files(out: Console, files: list[Path], camera: Target) -> None:
    section, profile, report, *replies = files
    table = Table.grid(padding=(0, 2))
    table.add_row("Its section for the configuration", str(section))
    table.add_row("Its firmware for the simulator", str(profile))
    table.add_row("Everything as data", str(report))
    table.add_row(f"{len(replies)} answers without names", str(replies[0].parent) if replies else "")
    out.print()
    out.print(table)
    out.print(
        f"The password belongs into the environment or secrets.yaml as {PASSWORD.format(camera.name.upper())}.",
        markup=False,
    )
    out.print(f"When its service runs, `apartment calibrate ptz {camera.name}` shows it its motors.", markup=False)
