"""What systemd makes of the installation's folders, tried with the real systemd-sysusers and systemd-tmpfiles below
another root: who may write what, and that it stays so when the configuration changes."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.installation.test_install import install, needs

pytestmark = [
    pytest.mark.systemd,
    pytest.mark.skipif(os.geteuid() != 0, reason="nobody else may make users and give them folders"),
]


class Machine:
    """Another root; its users are in its own files."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.state = root / "var/lib/apartment"
        self.config = root / "etc/apartment/apartment.yaml"
        (root / "etc").mkdir()
        for name in ("passwd", "group"):
            shutil.copy(Path("/etc") / name, root / "etc" / name)

    def install(self) -> None:
        """Again and again, as the page says: and what systemd does with it."""
        done = install("--systemd", "--root", str(self.root))
        assert done.returncode == 0, done.stderr
        self.tell("systemd-sysusers", "apartment.conf")
        self.tell("systemd-tmpfiles", "--create", "apartment.conf")

    def tell(self, name: str, *words: str) -> None:
        command = [needs(name, "systemd"), f"--root={self.root}", *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr

    def user(self, name: str) -> int:
        return next(int(line.split(":")[2]) for line in self._lines("passwd") if line.startswith(f"{name}:"))

    def name(self, user: int) -> str:
        return next(line.split(":")[0] for line in self._lines("passwd") if line.split(":")[2] == str(user))

    @property
    def group(self) -> int:
        return next(int(line.split(":")[2]) for line in self._lines("group") if line.startswith("apartment:"))

    def _lines(self, name: str) -> list[str]:
        return (self.root / "etc" / name).read_text().splitlines()


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    made = Machine(tmp_path)
    made.install()
    return made


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o7777


def test_a_database_of_sqlite_from_before_is_for_all_services(machine: Machine) -> None:
    file = machine.state / "bus.db"
    file.touch(0o640)
    os.chown(file, machine.user("apartment-persistence"), 0)
    machine.install()
    assert (mode(file), file.stat().st_gid) == (0o660, machine.group)
    assert file.stat().st_uid == machine.user("apartment-persistence")


def test_services_that_come_to_share_a_process_or_leave_it_still_read_what_is_theirs_alone(machine: Machine) -> None:
    alone = machine.config.read_text()
    kept = {name: machine.state / name / "client" for name in ("persistence", "history", "camera-ip1")}
    for name, file in kept.items():
        file.parent.mkdir()
        file.write_text(name)
        file.chmod(0o600)
        for path in (file.parent, file):
            os.chown(path, machine.user(f"apartment-{name}"), machine.group)

    def owners() -> set[str]:
        assert {mode(file) for file in kept.values()} == {0o600}
        found = {name: {file.stat().st_uid, file.parent.stat().st_uid} for name, file in kept.items()}
        return {f"{name}: {machine.name(one)}" for name, those in found.items() for one in those}

    separate = {"persistence: apartment-persistence", "history: apartment-history", "camera-ip1: apartment-camera-ip1"}
    assert owners() == separate
    machine.config.write_text(f"grouped: true\n{alone}")
    machine.install()
    assert owners() == {"persistence: apartment-light", "history: apartment-light", "camera-ip1: apartment-camera-ip1"}
    machine.config.write_text(alone)
    machine.install()
    assert owners() == separate
