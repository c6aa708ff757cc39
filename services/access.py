"""Who may do what at the broker: mosquitto's ACL from the topic table, one account per service.

The topics of the home's plain MQTT devices are in no table: they come from the home, for OpenHAB and for the devices.
Not here: the passwords themselves (`apartment secrets`, environment or credential files).
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from services.apartment.forms import STOP_TOPIC
from services.apartment.home import Home
from services.registry import REGISTRY
from services.topics import TABLE, Topic
from services.whole_file import write_private

CONF = Path(__file__).parents[1] / "mosquitto" / "mosquitto.conf"
TLS_CONF = CONF.with_name("tls.conf")
PLAYS = {row.name: row.plays for row in REGISTRY if row.plays}
OPENHAB, DEVICES = "openhab", "devices"  # who hears the plain MQTT devices, and they themselves
ITERATIONS = 101  # of PBKDF2, as mosquitto_passwd of Debian 12 writes


def accounts(cameras: Iterable[str]) -> list[str]:
    """Every account that a broker of ours knows: services, roles of the table, plain devices, one per camera."""
    own = {row.name for row in REGISTRY if row.on_bus and "<cam>" not in row.name}
    roles = {role for row in TABLE for role in (*row.writers, *row.readers) if "<" not in role}
    return [*sorted(own | roles | {DEVICES}), *(f"camera-{camera}" for camera in cameras)]


def acl(cameras: Iterable[str], home: Home | None = None, *, anonymous: bool = False) -> str:
    """mosquitto's acl_file: what each account may write and read; of the devices of `home` too.

    `anonymous`: a client without a name may do everything. For the demo and for tests on loopback, where a newcomer
    plays the home, the robot and the operator in turn; an installation has no such clients.
    """
    cameras = list(cameras)
    lines = ["# Written by `apartment topics --acl` from services/topics/ and the home; a test keeps them equal.", ""]
    if anonymous:
        lines += ["# whoever gives no name", "topic readwrite #", ""]
    for account in accounts(cameras):
        own = [] if account == DEVICES else _rights(account)
        lines += [f"user {account}", *own, *_rights_of_devices(account, home), ""]
    return "\n".join(lines)


def _rights(account: str) -> list[str]:
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


def _rights_of_devices(account: str, home: Home | None) -> list[str]:
    """What OpenHAB and the plain devices may beside the table; a topic that a row of it means is left to that row."""
    if home is None or account not in (OPENHAB, DEVICES):
        return []
    topics = (one.mqtt for one in home.items.values() if one.mqtt is not None)
    told = [one.mqtt.availability for one in home.things.values() if one.mqtt is not None]
    wanted: list[str] = []
    for one in topics:
        told += [one.state] if one.state is not None else []
        wanted += [one.command] if one.command is not None else []
        wanted += [str(one.settings[STOP_TOPIC])] if STOP_TOPIC in one.settings else []
    rows: dict[str, str] = {}
    for topic in sorted({*told, *wanted}):
        heard, said = (told, wanted) if account == OPENHAB else (wanted, told)
        if not _is_ours(topic):
            rows[topic] = "readwrite" if topic in heard and topic in said else "read" if topic in heard else "write"
    return [f"topic {right} {topic}" for topic, right in rows.items()]


def _is_ours(topic: str) -> bool:
    return topic.startswith("$") or any(_meet(topic.split("/"), row.filter.split("/")) for row in TABLE)


def _meet(one: list[str], other: list[str]) -> bool:
    """Whether there is a topic that both filters mean."""
    for here, there in zip(one, other, strict=False):
        if "#" in (here, there):
            return True
        if here != there and "+" not in (here, there):
            return False
    rest = one[len(other) :] or other[len(one) :]
    return rest in ([], ["#"])


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
