"""docs/raspberry-pi.md, followed line by line on a Debian 12 that was made a minute ago: `make soak PART=install`.

mmdebstrap makes its root, systemd-nspawn boots it with the real systemd and a network of its own (loopback alone, so
that the usual ports are free). The commands are the page's own blocks; what a person would fill in is in `FILLED`.
Needs root, `apt-get install mmdebstrap systemd-container`, and a way to Debian's packages and the Python packages.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random

from services.peers import end, program, wait_until
from tests.small_flat import family

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "raspberry-pi.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```sh\n(.*?)^```", PAGE, re.M | re.S)
BEYOND = ("systemd", "systemd-sysv", "dbus", "sudo", "ca-certificates", "tzdata")  # of any Raspberry Pi OS
PASSWORD = "Xk4-frog-Lamp"
KEPT = "/var/backups/apartment.zip"
BOOT_S, LINE_S = 180.0, 600.0
CONFIG = "/etc/apartment/apartment.yaml"
APARTMENT = f"/opt/apartment/.venv/bin/apartment --config {CONFIG}"
CAMERA = """\
sed -i 's#http://192.0.2.9#http://127.0.0.1:8941#' {config}
sed -i '/^bridge:/,/^$/d' {config}
"""  # the camera's address; and ROS is on another machine
FILLED = (
    ("<this repository>", "/srv/apartment.git"),
    (r"sudo nano \S+.*", CAMERA.format(config=CONFIG)),
    (r"(secrets set CAMERA_IP1_PASSWORD).*", rf"\1 <<< {PASSWORD}"),
    (r"\bFILE\b", KEPT),
)
SIMULATED = f"""\
mkdir -p /srv/camera && cp -r /opt/apartment/config/. /srv/camera && cd /srv/camera
sed -i 's/rtsp_port: .*null: no RTSP/rtsp_port: null/' simulated.yaml
systemd-run --quiet --unit=a-camera --setenv=CAMERA_IP1_PASSWORD={PASSWORD} \\
    --setenv=APARTMENT_STATE=/srv/camera/state \\
    /opt/apartment/.venv/bin/python -m services serve simulated-camera --config /srv/camera/simulated.yaml
"""


class Failed(AssertionError):
    """A line of the page did not do what it says; the message has what it printed."""


@dataclass
class Machine:
    """The new machine; `leader` is its first process, seen from outside."""

    root: Path
    leader: int = 0

    def run(self, lines: str, expected: int = 0) -> str:
        """Runs lines as its administrator would; what they print."""
        into = [
            "nsenter",
            "--target",
            str(self.leader),
            "--mount",
            "--uts",
            "--ipc",
            "--net",
            "--pid",
            "--root",
            "--wd",
        ]
        command = [*into, "env", "-i", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "HOME=/root", "LANG=C.UTF-8", "bash", "-e"]
        lines = f"cd /opt/apartment 2>/dev/null || cd /root\n{lines}\n"
        done = subprocess.run(command, input=lines, capture_output=True, text=True, timeout=LINE_S, check=False)
        if done.returncode != expected:
            raise Failed(f"{lines}ended with {done.returncode}:\n{done.stdout[-4000:]}{done.stderr[-4000:]}")
        return done.stdout


def filled(block: str) -> str:
    """A block of the page with what a person would write there."""
    for form, text in FILLED:
        block = re.sub(form, text, block)
    return block


def packages() -> list[str]:
    """What the page has installed."""
    named = re.search(r"apt-get install ([\w .-]+)", PAGE)
    assert named is not None
    return named[1].split()


def make(folder: Path) -> Machine:
    """A new Debian, our repository and the Python packages beside it: the machine itself has no way out."""
    root = folder / "debian"
    sources = Path("/etc/apt/sources.list.d/debian.sources")
    command = [program("mmdebstrap", "mmdebstrap"), "--quiet", "--variant=minbase"]
    command += [f"--include={','.join((*BEYOND, *packages()))}", "bookworm", str(root)]
    subprocess.run([*command, *([str(sources)] if sources.is_file() else [])], check=True)
    wheels = root / "srv" / "wheels"
    download = [sys.executable, "-m", "pip", "download", "--quiet", "--dest", str(wheels), str(ROOT)]
    subprocess.run([*download, "setuptools", "wheel"], check=True)
    subprocess.run(["git", "clone", "--quiet", "--bare", str(ROOT), str(root / "srv" / "apartment.git")], check=True)
    (root / "etc" / "hostname").write_text("fresh\n")
    (root / "etc" / "hosts").write_text("127.0.0.1 localhost\n127.0.1.1 fresh\n::1 localhost\n")
    (root / "etc" / "pip.conf").write_text("[global]\nno-index = true\nfind-links = /srv/wheels\n")
    return Machine(root)


@contextmanager
def booted(machine: Machine) -> Iterator[None]:
    """Switches it on, and off at the end of the block."""
    command = [program("systemd-nspawn", "systemd-container"), "--quiet", "--boot", "--private-network"]
    command += ["--directory", str(machine.root), "--console=pipe", "--register=no", "--keep-unit", "--machine=fresh"]
    nspawn = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: _first_of(nspawn.pid) != 0, "the machine's first process", BOOT_S)
        machine.leader = _first_of(nspawn.pid)
        wait_until(lambda: _is_up(machine), "the machine to be up", BOOT_S)
        yield
    finally:
        end(nspawn, grace_s=60.0)
        if machine.leader and Path(f"/proc/{machine.leader}").exists():
            os.kill(machine.leader, signal.SIGKILL)


def _first_of(pid: int) -> int:
    """The process that is number 1 in a namespace of its own."""
    for one in family(pid):
        try:
            numbers = re.search(r"^NSpid:\s+(.*)$", Path(f"/proc/{one}/status").read_text(), re.M)
        except OSError:
            continue
        if numbers and numbers[1].split()[1:] == ["1"]:
            return one
    return 0


def _is_up(machine: Machine) -> bool:
    try:
        return machine.run("systemctl is-system-running || true").strip() in ("running", "degraded")
    except Failed:
        return False


def well(machine: Machine) -> None:
    """Every unit runs and was never started again, and the doctor finds nothing; each within a while."""

    def healthy() -> bool:
        try:
            machine.run(f"{APARTMENT.replace(' --config', ' doctor --config')}")
        except Failed as failed:
            trouble[:] = [str(failed)]
            return False
        return True

    trouble: list[str] = []
    try:
        wait_until(healthy, "a doctor who finds nothing", 120.0)
    except TimeoutError as error:
        raise Failed(trouble[0] + machine.run("journalctl --no-pager -n 60 -u 'apartment-*'")) from error
    units = machine.run("systemctl list-dependencies --plain apartment.target | grep service").split()
    assert len(units) >= 4, units
    for unit in units:
        said = machine.run(f"systemctl show -p ActiveState -p NRestarts {unit}").split()
        if set(said) != {"ActiveState=active", "NRestarts=0"}:
            raise Failed(f"{unit}: {said}\n" + machine.run(f"journalctl --no-pager -n 80 -u {unit}"))


def used(machine: Machine) -> None:
    """A state of the home is stored, the camera goes to a place, a reader elsewhere and the renewal work."""
    machine.run(f"""\
word=$(cat /etc/apartment/secrets/credentials/BUS_OPENHAB_PASSWORD)
mosquitto_pub -u openhab -P "$word" -q 1 -r -t home/Kitchen_Light/state -m ON
{_called("order ip1 Goto Kitchen")}
until {_called("history Kitchen_Light")} | grep ON; do :; done
READER_PASSWORD={PASSWORD} {_called("db grant grafana --host 192.0.2.%")}
systemctl start apartment-renew.service
test $(systemctl show -p Result --value apartment-renew.service) = success
word=$(cat /etc/apartment/secrets/credentials/BUS_OPERATOR_PASSWORD)
timeout 60 mosquitto_sub -u operator -P "$word" -h localhost -p 8883 --cafile /etc/apartment/ca.crt -C 1 \\
    -t home/Kitchen_Light/state | grep ON
test -z "$(find /etc/apartment/secrets /etc/apartment/broker -perm /077)"
""")


def restored(machine: Machine, backup: str) -> None:
    """What the page says of backup and restore, after everything was lost: history, places and configuration."""
    look = f"""\
{_called("history Kitchen_Light --json")}
{_called("history --what changes --json")}
sha256sum $(find /etc/apartment -name '*.yaml' -not -path '*/secrets/*' | sort)
"""
    machine.run(f"mkdir -p /var/backups; {_called(f'backup {KEPT}')}; systemctl stop apartment.target")
    before = machine.run(look)
    machine.run(
        "mariadb -e 'DROP DATABASE bus; DROP DATABASE OpenHAB'; rm -r /etc/apartment/ip1 /etc/apartment/home.yaml"
    )
    machine.run(filled(backup))
    assert machine.run(look) == before
    assert "ON" in before
    machine.run(f"""\
until {_called("order ip1 SaveAs Here")}; do sleep 1; done
grep Here $(grep -rl Here /etc/apartment/ip1)
""")


def _called(words: str) -> str:
    return f"/opt/apartment/.venv/bin/apartment {words} --config {CONFIG}"


def container_image(machine: Machine) -> None:
    """The steps of `Containerfile` in this root: there is no engine for containers here."""
    text = (ROOT / "Containerfile").read_text()
    copied = [line.split()[1:-1] for line in text.splitlines() if line.startswith("COPY ")]
    (told,) = re.findall(r"^RUN (.*)$", text, re.M)
    names = " ".join(name for line in copied for name in line)
    machine.run(f"""\
mkdir /srv/image && cp -r {names} /srv/image && cd /srv/image
python3 -m venv /srv/image-venv && PATH=/srv/image-venv/bin:$PATH
{told}
python -m services check --config /opt/apartment/config/simulated.yaml
""")


def follow(_: Random) -> float:
    """All of it; the minutes that it took."""
    began = time.monotonic()
    install, units, own, backup, upgrade = BLOCKS
    with tempfile.TemporaryDirectory(prefix="fresh-") as name:
        machine = make(Path(name))
        with booted(machine):
            machine.run(filled(install))
            machine.run(filled(units))
            container_image(machine)
            machine.run(SIMULATED)
            machine.run(filled(own))
            well(machine)
            used(machine)
            restored(machine, backup)
            well(machine)
            machine.run(filled(upgrade))
            well(machine)
        with booted(machine):  # after the power was away
            machine.run(SIMULATED)
            well(machine)
    return (time.monotonic() - began) / 60
