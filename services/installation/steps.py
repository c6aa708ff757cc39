"""What `apartment install` does, one step after the other; the same list is shown by `--dry-run`.

Below another `root` than `/` everything is written and nothing is run: for an image of a machine, and for tests.
"""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from services import access
from services.config import Apartment
from services.credentials.folder import Folder, files_of, fill
from services.errors import ApartmentError, ConfigError
from services.installation import units
from services.installation.layout import BROKER, DATABASE, GROUP, STATE, SYSTEM, TARGET, UNITS, parts
from services.whole_file import write_private

SECRETS = SYSTEM / "secrets"
BROKER_FILES = ("passwords", "acl", "server.crt", "server.key")
HIDDEN = ("/home/", "/root/", "/run/user/")  # what ProtectHome hides from the services


class NotDone(ApartmentError):
    """A command of the installation failed; the message has its words."""


@dataclass(frozen=True)
class Step:
    """A file to write (or to remove), or a command to run. `owner` where it is not root's; `source`: it is a copy."""

    path: Path | None = None
    text: str | bytes = field(default="", repr=False)
    source: Path | None = None  # read when the step is done, for what a step before makes
    mode: int = 0o644
    owner: str = ""
    command: tuple[str, ...] = ()
    removed: bool = False
    once: bool = False  # made where it is missing

    def __str__(self) -> str:
        if self.path is None:
            return f"run    {' '.join(self.command)}"
        if self.removed:
            return f"remove {self.path}"
        told = f"{self.path}{f' for {self.owner}' if self.owner else ''} ({self.mode:04o})"
        return f"make   {told} where it is missing" if self.once else f"write  {told}"


def copied(source: Path, root: Path) -> Iterator[Step]:
    """The configuration's own files, as far as the machine has none of that name."""
    for file in sorted(source.rglob("*")):
        path = SYSTEM / file.relative_to(source)
        if file.is_file() and not (root / path.relative_to("/")).exists():
            yield Step(path, source=file)


def files(apartment: Apartment, python: Path) -> list[Step]:
    """systemd's units, users and folders."""
    inside = next((place for place in HIDDEN if str(python).startswith(place)), None)
    if inside is not None:
        raise ConfigError([f"{python}: expected the program outside of {inside}, as in /opt/apartment: see docs/"])
    found, config = parts(apartment), SYSTEM / apartment.file.name
    texts = {part.unit: units.service(part, python, config, SECRETS) for part in found}
    texts |= {TARGET: units.target(found), **units.renewal(python, SECRETS)}
    texts |= {"mosquitto.service.d/apartment.conf": units.broker()}
    return [
        *(Step(UNITS / name, text) for name, text in texts.items()),
        Step(Path("/etc/sysusers.d/apartment.conf"), units.users(found)),
        Step(Path("/etc/tmpfiles.d/apartment.conf"), units.folders(found)),
    ]


def gone(wanted: Iterable[Step], root: Path) -> Iterator[Step]:
    """What an earlier configuration had and this one has not: its units are stopped and removed."""
    kept = {step.path for step in wanted}
    for file in sorted((root / UNITS.relative_to("/")).glob("apartment-*.service")):
        if UNITS / file.name not in kept:
            yield Step(command=("systemctl", "stop", file.name))
            yield Step(UNITS / file.name, removed=True)


ACCOUNTS = Step(command=("systemd-sysusers",))  # before files are given to them


def commands() -> list[Step]:
    """What makes systemd know them."""
    wanted = (
        ("systemd-tmpfiles", "--create", "apartment.conf"),
        ("systemctl", "daemon-reload"),
        ("systemctl", "enable", TARGET, "apartment-renew.timer"),
        ("systemctl", "start", "apartment-renew.timer"),
        ("systemctl", "restart", "mosquitto.service"),
        *((("systemctl", "restart", "mariadb.service"),) if _is_user("mysql") else ()),
    )
    return [Step(command=command) for command in wanted]


def filled(config: Path, root: Path) -> Iterator[Step]:
    """The files with passwords and certificates, to be shown; `fill_secrets` makes them, what follows from them."""
    for path in files_of(_secrets(root), config):
        follows = path.parent.name == "broker" and path.stem != "server"
        yield Step(Path("/") / path.relative_to(root), mode=0o600, once=not follows)


def fill_secrets(config: Path, hosts: Sequence[str], root: Path) -> Iterator[str]:
    """Passwords and certificates where there are none; a line for each thing done."""
    yield from fill(_secrets(root), config, hosts, datetime.now(UTC))


def handed_out(root: Path) -> Iterator[Step]:
    """What others than root need of them: a copy for the broker, the database, the dashboard and everybody."""
    folder = _secrets(root).path
    for name in BROKER_FILES:
        yield Step(BROKER / name, mode=0o600, owner="mosquitto", source=folder / "broker" / name)
    started_with = access.broker_conf(BROKER, Path("/var/lib/mosquitto"))
    yield Step(BROKER / "mosquitto.conf", started_with, mode=0o600, owner="mosquitto")
    if root != Path("/") or _is_user("mysql"):
        for name in ("server.crt", "server.key"):
            yield Step(DATABASE / name, mode=0o600, owner="mysql", source=folder / "database" / name)
        yield Step(Path("/etc/mysql/mariadb.conf.d/60-apartment.cnf"), units.database())
    yield Step(SYSTEM / "ca.crt", source=_secrets(root).authority)
    yield Step(SYSTEM / "dashboard.crt", source=folder / "dashboard" / "server.crt")
    yield Step(SYSTEM / "dashboard.key", mode=0o640, owner=f":{GROUP}", source=folder / "dashboard" / "server.key")


def _secrets(root: Path) -> Folder:
    return Folder(root / SECRETS.relative_to("/"))


def _is_user(name: str) -> bool:
    return any(one.pw_name == name for one in pwd.getpwall())


def do(step: Step, root: Path) -> None:
    """Writes or runs; NotDone when a command fails. What a command would do to this machine is left out elsewhere."""
    if step.path is None:
        if root == Path("/"):
            _run(step.command)
        return
    file = root / step.path.relative_to("/")
    if step.removed:
        file.unlink(missing_ok=True)
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    if step.path.parent in (BROKER, DATABASE):
        file.parent.chmod(0o700)
    write_private(file, step.text if step.source is None else step.source.read_bytes())
    if step.owner and root == Path("/") and os.geteuid() == 0:
        user, _, group = step.owner.partition(":")
        if user and not _is_user(user):
            raise NotDone(f"no user {user}: apt-get install {user}")
        for path in (file.parent, file) if user else (file,):
            if user:
                shutil.chown(path, user)
            if group:
                shutil.chown(path, group=group)
    file.chmod(step.mode)


def _run(command: Sequence[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise NotDone(f"{command[0]} is not installed: this machine has no systemd") from error
    if done.returncode:
        raise NotDone(f"{' '.join(command)}: {done.stderr.strip() or done.returncode}")


def next_words() -> Iterator[str]:
    """What is left for people."""
    yield "Then:  apartment secrets set CAMERA_IP1_PASSWORD   (each camera's, as in docs/camera-account.md)"
    yield f"       apartment db init --config {SYSTEM / 'apartment.yaml'}"
    yield f"       systemctl start {TARGET}"
    yield f"Watch: journalctl -f -u 'apartment-*'; what is kept is in {STATE}"
