"""The folder of an installation's secrets: what is in it, how it is filled, completed and renewed.

    secrets.yaml           every password by its name, for people and for the command line
    credentials/NAME       the same, one file each, for systemd's LoadCredential
    authority/             the key and certificate of our own certificate authority
    broker/                what mosquitto is started with: passwords, acl, certificate, key, mosquitto.conf
    dashboard/, database/  their certificate and key

Files are 0600 in folders of 0700; whoever reads meanwhile sees the old file or the new one. Not here: the services'
reading, `secret_store.py`.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from services import access, document
from services.apartment.home import Home
from services.config import home_in
from services.credentials import certificates, passwords
from services.credentials.certificates import Pair
from services.errors import ConfigError
from services.whole_file import write_private

SERVERS = ("broker", "dashboard", "database")
AUTHORITY = "authority"
PRIVATE = 0o700


@dataclass(frozen=True)
class Folder:
    """Where one installation's secrets are."""

    path: Path

    @property
    def authority(self) -> Path:
        """The certificate that clients check servers with."""
        return self.path / AUTHORITY / "ca.crt"

    def secrets(self) -> dict[str, str]:
        """Every password by its name; empty when there are none yet."""
        file = self.path / "secrets.yaml"
        if not file.exists():
            return {}
        return {str(name): str(value) for name, value in (document.must(document.read(file)) or {}).items()}

    def keep(self, secrets: dict[str, str]) -> None:
        """Writes all passwords, in both forms."""
        self.make("credentials")
        for name, value in secrets.items():
            write_private(self.path / "credentials" / name, value)
        write_private(self.path / "secrets.yaml", "".join(f"{name}: {_text(secrets[name])}\n" for name in secrets))

    def make(self, name: str = "") -> Path:
        """A folder in it (or itself) that only its owner can open."""
        folder = self.path / name
        folder.mkdir(parents=True, exist_ok=True, mode=PRIVATE)
        folder.chmod(PRIVATE)
        return folder

    def pair(self, name: str) -> Pair | None:
        """The certificate and key in one of its folders; None when they are not there."""
        certificate, key = self._files(name)
        if not (certificate.is_file() and key.is_file()):
            return None
        return Pair(certificate.read_text(encoding="ascii"), key.read_text(encoding="ascii"))

    def keep_pair(self, name: str, pair: Pair) -> None:
        """Writes a certificate and its key, the key first: nobody may find a certificate that has none."""
        certificate, key = self._files(name)
        self.make(name)
        write_private(key, pair.key)
        write_private(certificate, pair.certificate)

    def _files(self, name: str) -> tuple[Path, Path]:
        stem = "ca" if name == AUTHORITY else "server"
        return self.path / name / f"{stem}.crt", self.path / name / f"{stem}.key"


def _text(value: str) -> str:
    """A text in YAML, whatever is in it."""
    return "'" + value.replace("'", "''") + "'"


def fill(folder: Folder, config: Path, hosts: Sequence[str], now: datetime, *, force: bool = False) -> Iterator[str]:
    """Makes what is missing (with `force` all, but not what people brought); yields a line for each thing done.

    Certificates that lack one of `hosts` are made again for that one too, by the same authority; no name is ever lost.
    """
    _outside_a_repository(folder.path)
    source = document.read(config)
    if source.value is None:
        raise ConfigError(source.faults)
    home = _home(config, source.value)
    folder.make()
    yield from _fill_passwords(folder, config, force=force)
    yield from _fill_certificates(folder, hosts, now, force=force)
    write_broker(folder, passwords.cameras(source.value), home)
    yield f"{folder.path / 'broker'}: password file, access list and mosquitto.conf"


def _home(config: Path, value: Any) -> Home:
    """The home of a configuration as it was read; ConfigError with its faults."""
    named = value.get("home") if isinstance(value, dict) else None
    if not isinstance(named, str):
        raise ConfigError([f"{config}:1: home: expected a file, got {named!r}"])
    home, faults = home_in(config.parent / named)
    if home is None or faults:
        raise ConfigError(faults)
    return home


def files_of(folder: Folder, config: Path) -> Iterator[Path]:
    """The files that `fill` sees to, for who only looks: all but the passwords that people bring."""
    ours, _ = passwords.names(config)
    yield folder.path / "secrets.yaml"
    yield from (folder.path / "credentials" / name for name in ours)
    for name in (AUTHORITY, *SERVERS):
        yield from folder._files(name)
    yield from (folder.path / "broker" / name for name in ("passwords", "acl", "mosquitto.conf"))


def _fill_passwords(folder: Folder, config: Path, *, force: bool) -> Iterator[str]:
    known = folder.secrets()
    ours, peoples = passwords.names(config)
    fresh = [name for name in ours if force or name not in known]
    folder.keep({**known, **passwords.made(fresh)})
    yield f"{folder.path / 'secrets.yaml'}: {len(fresh)} new passwords, {len(ours) - len(fresh)} kept"
    for name in peoples:
        if name not in known:
            yield f"missing: {name}, which you chose elsewhere: apartment secrets set {name}"


def _fill_certificates(folder: Folder, hosts: Sequence[str], now: datetime, *, force: bool) -> Iterator[str]:
    signer = None if force else folder.pair(AUTHORITY)
    if signer is None:
        signer = certificates.authority("Smart apartment", now)
        folder.keep_pair(AUTHORITY, signer)
        yield f"{folder.authority}: a new authority, until {certificates.ends(signer.certificate):%Y-%m-%d}"
        force = True  # what another authority has signed is of no use
    for name in SERVERS:
        old = folder.pair(name)
        known = certificates.hosts(old.certificate) if old is not None else []
        wanted = list(dict.fromkeys([*known, *map(_plain, hosts)]))
        if force or wanted != known:
            folder.keep_pair(name, certificates.server(signer, name, wanted, now, None if force else old))
            yield f"{folder.path / name}: a new certificate for {', '.join(wanted)}"


def _plain(host: str) -> str:
    """An address as certificates tell it, a name as it is."""
    try:
        return str(ipaddress.ip_address(host))
    except ValueError:
        return host


def renew(folder: Folder, within: timedelta, now: datetime) -> Iterator[str]:
    """New certificates for the servers whose own ends within that time: same names and keys; the authority stays."""
    signer = folder.pair(AUTHORITY)
    if signer is None:
        raise ConfigError([f"{folder.authority}: expected a certificate, got nothing: apartment secrets init"])
    if certificates.ends(signer.certificate) < now + within:
        yield f"{folder.authority} itself ends on {certificates.ends(signer.certificate):%Y-%m-%d}: init --force"
    for name in SERVERS:
        old = folder.pair(name)
        if old is not None and certificates.ends(old.certificate) < now + within:
            fresh = certificates.server(signer, name, certificates.hosts(old.certificate), now, old)
            folder.keep_pair(name, fresh)
            yield f"{folder.path / name}: renewed until {certificates.ends(fresh.certificate):%Y-%m-%d}"


def write_broker(folder: Folder, cameras: Sequence[str], home: Home) -> None:
    """Writes what mosquitto is started with. Accounts that somebody added to the password file stay in it."""
    broker, secrets = folder.make("broker"), folder.secrets()
    ours = {account: secrets[passwords.name_of(account)] for account in access.accounts(cameras)}
    lines = [access.password_line(account, password) for account, password in ours.items()]
    write_private(broker / "passwords", "".join(f"{line}\n" for line in [*lines, *_others(broker, ours)]))
    write_private(broker / "acl", access.acl(cameras, home))
    write_private(broker / "mosquitto.conf", access.broker_conf(broker))


def _others(broker: Path, ours: dict[str, str]) -> list[str]:
    file = broker / "passwords"
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return [line for line in lines if line.partition(":")[0] not in ours and ":" in line]


def _outside_a_repository(path: Path) -> None:
    inside = next((one for one in (path.absolute(), *path.absolute().parents) if (one / ".git").exists()), None)
    if inside is not None:
        raise ConfigError([f"--out: expected a folder outside of {inside}, which is a repository, got {path}"])
