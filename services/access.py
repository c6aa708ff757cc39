"""Who may do what at the broker: mosquitto's ACL from the topic table, one account per service.

Not here: the passwords themselves (`apartment secrets`, environment or credential files).
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from services.registry import REGISTRY
from services.topics import TABLE, Topic
from services.whole_file import write_private

CONF = Path(__file__).parents[1] / "mosquitto" / "mosquitto.conf"
TLS_CONF = CONF.with_name("tls.conf")
PLAYS = {row.name: row.plays for row in REGISTRY if row.plays}
ITERATIONS = 101  # of PBKDF2, as mosquitto_passwd of Debian 12 writes


def accounts(cameras: Iterable[str]) -> list[str]:
    """Every account that a broker of ours knows: services, roles of the table, one per camera."""
    own = {row.name for row in REGISTRY if row.on_bus and "<cam>" not in row.name}
    roles = {role for row in TABLE for role in (*row.writers, *row.readers) if "<" not in role}
    return [*sorted(own | roles), *(f"camera-{camera}" for camera in cameras)]


def acl(cameras: Iterable[str], *, anonymous: bool = False) -> str:
    """mosquitto's acl_file: what each account may write and read.

    `anonymous`: a client without a name may do everything. For the demo and for tests on loopback, where a newcomer
    plays the home, the robot and the operator in turn; an installation has no such clients.
    """
    cameras = list(cameras)
    lines = ["# Written by `apartment topics --acl` from services/topics/; a test keeps them equal.", ""]
    if anonymous:
        lines += ["# whoever gives no name", "topic readwrite #", ""]
    for account in accounts(cameras):
        lines += [f"user {account}", *_rights(account, cameras), ""]
    return "\n".join(lines)


def _rights(account: str, cameras: list[str]) -> list[str]:
    rows: dict[str, str] = {}
    for topic in TABLE:
        writes, reads = _may(account, topic.writers), _may(account, topic.readers)
        if writes or reads or "<service>" in (*topic.writers, *topic.readers):
            _add(rows, account, topic, writes=writes, reads=reads)
    reply = f"topic {'readwrite' if account == 'operator' else 'write'} reply/#"
    own = ["topic read $SYS/broker/#"] if account == "persistence" else []  # whether the broker dropped something
    return [*own, *(f"topic {right} {topic_filter}" for topic_filter, right in rows.items()), reply]


def _add(rows: dict[str, str], account: str, topic: Topic, *, writes: bool, reads: bool) -> None:
    """A service's own topics carry its name in the level `<service>` or `<cam>`."""
    camera = account.removeprefix("camera-") if account.startswith("camera-") else None
    if "<service>" in topic.writers:
        rows[topic.filter_for(service=account)] = "write"
        if reads:
            rows[topic.filter] = "read"
        return
    if "<service>" in topic.readers:
        rows[topic.filter_for(service=account)] = "read"
        if not writes:
            return
    own = {"cam": camera} if camera and "cam" in topic.names else {}
    right = "readwrite" if writes and reads else "write" if writes else "read"
    rows.update(dict.fromkeys(topic.filters_for(**own), right))


def _may(account: str, roles: tuple[str, ...]) -> bool:
    return (
        account in roles or PLAYS.get(account) in roles or (account.startswith("camera-") and "camera-<cam>" in roles)
    )


def password_line(account: str, password: str) -> str:
    """One line of mosquitto's password file, `user:$7$iterations$salt$hash` (PBKDF2 with SHA-512).

    Source: mosquitto 2.0, `apps/mosquitto_passwd`; the test compares with the tool's own answer.
    """
    salt = os.urandom(12)
    digest = hashlib.pbkdf2_hmac("sha512", password.encode(), salt, ITERATIONS)
    return f"{account}:$7${ITERATIONS}${base64.b64encode(salt).decode()}${base64.b64encode(digest).decode()}"


def write_passwords(file: Path, passwords: Mapping[str, str]) -> None:
    """Writes mosquitto's password file, for nobody else to read."""
    write_private(file, "".join(f"{password_line(account, password)}\n" for account, password in passwords.items()))


def broker_conf(folder: Path, data: Path | None = None, *, encrypted: bool = True) -> str:
    """`mosquitto.conf` as the project has it, with its files in `folder` and its memory in `data` (else there too).

    `encrypted`: with the listener for other machines, whose certificate and key stand in `folder`.
    """
    text = CONF.read_text(encoding="utf-8") + ("\n" + TLS_CONF.read_text(encoding="utf-8") if encrypted else "")
    text = re.sub(r"(?m)^(password_file|acl_file|certfile|keyfile) ", rf"\1 {folder.absolute()}/", text)
    return re.sub(r"(?m)^persistence_location .*", f"persistence_location {(data or folder).absolute()}/", text)
