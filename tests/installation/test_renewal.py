"""The unit that renews certificates: its own lines, run with a shell, on files elsewhere. systemctl only writes down
what it was told; the MariaDB is a real one."""

from __future__ import annotations

import os
import shlex
import ssl
import subprocess
from collections.abc import Callable, Iterator
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pymysql
import pytest

from services.credentials.folder import Folder, fill, renew
from services.installation import units
from services.peers import Missing, answers, free_port, mariadb, program, running

CONFIG = Path(__file__).parents[2] / "config" / "apartment.yaml"
CERTIFICATE = (("cert", "crt"), ("key", "key"))  # of MariaDB's options, and the ends of our files' names
OWNERS = ("-o mosquitto ", "-o mysql ", "-g apartment ")  # the users of an installed machine
RELOAD, RESTART = "reload-or-restart mosquitto.service", "try-restart apartment-dashboard.service"


class Machine:
    """What is in /etc/apartment, and who was told something."""

    def __init__(self, folder: Path) -> None:
        self.etc, self.programs, self.told = folder / "etc", folder / "programs", folder / "told"
        self.secrets = Folder(self.etc / "secrets")
        list(fill(self.secrets, CONFIG, ["127.0.0.1"], datetime.now(UTC)))
        (self.etc / "database").mkdir()
        self.programs.mkdir()
        self.told.touch()
        self.program("systemctl", f'echo "$@" >> {self.told}')
        self.program("mariadb", f'echo "$@" >> {self.told}')

    def program(self, name: str, line: str) -> None:
        file = self.programs / name
        file.write_text(f"#!/bin/sh\n{line}\n")
        file.chmod(0o700)

    def week(self) -> list[str]:
        """What the unit does after `secrets renew`; who was told what."""
        text = units.renewal(Path("/python"), Path("/etc/apartment/secrets"))["apartment-renew.service"]
        for owner in OWNERS:
            text = text.replace(owner, "")
        text = text.replace("/etc/apartment/", f"{self.etc}/").replace(f"{self.etc}/broker/", f"{self.etc}/of_broker/")
        text = text.replace(f"{self.etc}/secrets", str(self.secrets.path))
        (self.etc / "of_broker").mkdir(exist_ok=True)
        lines = [line.partition("=")[2] for line in text.splitlines() if line.startswith("ExecStart=")]
        assert "secrets renew" in lines[0]
        self.told.write_text("")
        for line in lines[1:]:
            path = {"PATH": f"{self.programs}:{os.environ['PATH']}"}
            subprocess.run(shlex.split(line.removeprefix("-")), check=True, timeout=60, env=path)
        return [line.removeprefix("--no-block ") for line in self.told.read_text().splitlines()]

    def used(self, name: str) -> tuple[str, str]:
        """The certificate and key that a server was given."""
        stem = {"broker": "of_broker/server", "database": "database/server", "dashboard": "dashboard"}[name]
        return (self.etc / f"{stem}.crt").read_text(), (self.etc / f"{stem}.key").read_text()

    def made(self, name: str) -> tuple[str, str]:
        pair = self.secrets.pair(name)
        assert pair is not None
        return pair.certificate, pair.key


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_who_has_a_new_certificate_is_told_and_nobody_is_disturbed_without_one(machine: Machine) -> None:
    servers = ("broker", "database", "dashboard")
    assert machine.week() == [RELOAD, "-e FLUSH SSL", RESTART]
    assert [machine.used(name) for name in servers] == [machine.made(name) for name in servers]
    assert machine.week() == []
    list(renew(machine.secrets, timedelta(days=9999), datetime.now(UTC)))
    assert machine.week() == [RELOAD, "-e FLUSH SSL", RESTART]
    assert [machine.used(name) for name in servers] == [machine.made(name) for name in servers]
    assert machine.week() == []
    assert (machine.etc / "dashboard.key").stat().st_mode & 0o777 == 0o640
    assert (machine.etc / "of_broker/server.key").stat().st_mode & 0o777 == 0o600


def test_one_that_is_away_does_not_keep_the_others_from_theirs(machine: Machine) -> None:
    machine.program("mariadb", "exit 1")
    assert machine.week() == [RELOAD, RESTART]
    assert machine.used("database") == machine.made("database")


@pytest.fixture
def shown(machine: Machine, tmp_path: Path) -> Iterator[Callable[[], str]]:
    """The certificate that a MariaDB shows, which was started with that of the machine; its client is the real one."""
    machine.week()
    try:
        with mariadb.private(tmp_path / "m") as server:
            user, password = server.user, server.password
        command = [program("mariadbd", mariadb.PACKAGE), "--no-defaults", f"--datadir={tmp_path / 'm/data'}"]
        command += ["--user=root"] if os.geteuid() == 0 else []
        port, at = free_port(), tmp_path / "m/s"
        command += [f"--port={port}", f"--socket={at}", "--bind-address=127.0.0.1", *mariadb.SMALL]
        command += [f"--ssl-{name}={machine.etc / 'database' / f'server.{end}'}" for name, end in CERTIFICATE]
        machine.program("mariadb", f'exec {program("mariadb", "mariadb-client")} --no-defaults --socket={at} "$@"')
    except Missing as missing:
        pytest.skip(str(missing))

    def certificate() -> str:
        trust = ssl.create_default_context(cafile=str(machine.secrets.authority))
        made: Any = pymysql.connect(host="127.0.0.1", port=port, user=user, password=password, ssl=trust)
        with closing(made) as connection:
            assert isinstance(connection._sock, ssl.SSLSocket)
            return str(connection._sock.getpeercert())

    with running(command, tmp_path / "m/log", lambda: answers(port)):
        yield certificate


@pytest.mark.mariadb
def test_mariadb_shows_the_renewed_certificate_without_a_restart(machine: Machine, shown: Callable[[], str]) -> None:
    before = shown()
    list(renew(machine.secrets, timedelta(days=9999), datetime.now(UTC)))
    assert shown() == before
    machine.week()
    assert shown() != before
