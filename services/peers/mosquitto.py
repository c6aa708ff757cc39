"""A private mosquitto, started with the project's own `mosquitto.conf` and the generated ACL."""

from __future__ import annotations

import getpass
import json
import re
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from services import access
from services.peers import answers, free_port, program, running
from services.whole_file import write_private

CONF = access.CONF


@dataclass
class Broker:
    """A running broker; `passwords` by account."""

    port: int
    folder: Path
    passwords: dict[str, str] = field(repr=False)
    host: str = "127.0.0.1"
    pid: int = 0


@contextmanager
def private(
    folder: Path, cameras: Iterable[str] = ("ip1",), port: int = 0, *, anonymous: bool = False, conf: Path = CONF
) -> Iterator[Broker]:
    """Runs a broker in `folder` until the end of the block; Missing where mosquitto is not installed.

    `anonymous`: whether clients without a name are let in (see `access.acl`). Started again on the same folder and
    port it has its passwords, retained messages and sessions back.
    """
    command = program("mosquitto", "mosquitto")
    cameras = list(cameras)
    port = port or free_port()
    folder.mkdir(parents=True, exist_ok=True)
    passwords = _passwords(folder, cameras)
    (folder / "acl").write_text(access.acl(cameras, anonymous=anonymous), encoding="utf-8")
    (folder / "mosquitto.conf").write_text(_here(conf.read_text(encoding="utf-8"), folder, port, anonymous))
    arguments = [command, "-c", str(folder / "mosquitto.conf")]
    with running(arguments, folder / "mosquitto.log", lambda: answers(port)) as process:
        yield Broker(port, folder, passwords, pid=process.pid)


def _passwords(folder: Path, cameras: list[str]) -> dict[str, str]:
    """Random ones for every account, made once: hashed for the broker, plain for whoever started it."""
    plain = folder / "plain-passwords.json"
    if plain.exists():
        kept: dict[str, str] = json.loads(plain.read_text(encoding="utf-8"))
        return kept
    passwords = {account: secrets.token_urlsafe(16) for account in access.accounts(cameras)}
    access.write_passwords(folder / "passwords", passwords)
    write_private(plain, json.dumps(passwords))
    return passwords


def _here(conf: str, folder: Path, port: int, anonymous: bool) -> str:
    """The project's file with this folder and port; nothing else changes but who may come without a name."""
    conf = re.sub(r"(?m)^listener 1883 ", f"listener {port} ", conf)
    conf = re.sub(r"(?m)^(password_file|acl_file) ", rf"\1 {folder}/", conf)
    conf = re.sub(r"(?m)^persistence_location .*", f"persistence_location {folder}/", conf)
    if anonymous:
        conf = conf.replace("allow_anonymous false", "allow_anonymous true")
    return f"user {_user()}\n{conf}"


def _user() -> str:
    """mosquitto started as root would become another user, who cannot read a temporary folder."""
    return getpass.getuser()
