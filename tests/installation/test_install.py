"""What `apartment install` writes below another root: units that systemd accepts and finds hard, files that nobody else
reads. Nothing is run here."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from services.peers import Missing, program

ROOT = Path(__file__).parents[2]
SECTIONS = "\nmission:\n  robots:\n    tiago: {places: tiago/robot_places.yaml}\nhubs: {}\n"
EXPOSURE = 30  # tenths: 3.0 of 10


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The root of a machine on which it was installed."""
    root = tmp_path_factory.mktemp("machine")
    config = Path(shutil.copytree(ROOT / "config", tmp_path_factory.mktemp("config"), dirs_exist_ok=True))
    file = config / "apartment.yaml"
    file.write_text(file.read_text().replace("# hubs:", "#hubs:") + SECTIONS)
    done = install("--systemd", "--root", str(root), "--config", str(file))
    assert done.returncode == 0, done.stderr
    return root


def install(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "services", "install", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=ROOT, check=False)


def units(machine: Path) -> list[Path]:
    return sorted((machine / "etc/systemd/system").glob("apartment-*.service"))


def needs(name: str, package: str) -> str:
    try:
        return program(name, package)
    except Missing as missing:
        pytest.skip(str(missing))


def test_there_is_a_unit_for_every_service_with_its_own_user_and_its_own_secrets_only(machine: Path) -> None:
    named = {unit.stem.removeprefix("apartment-"): unit.read_text() for unit in units(machine)}
    assert set(named) == {"persistence", "history", "camera-ip1", "bridge", "mission", "hubs", "dashboard", "renew"}
    secrets = {name: set(re.findall(r"LoadCredential=(\w+):", text)) for name, text in named.items()}
    assert secrets["camera-ip1"] == {"BUS_CAMERA_IP1_PASSWORD", "CAMERA_IP1_PASSWORD"}
    assert secrets["persistence"] == {"BUS_PERSISTENCE_PASSWORD", "DATABASE_PASSWORD"}
    assert secrets["mission"] == {"BUS_MISSION_PASSWORD"}
    users = (machine / "etc/sysusers.d/apartment.conf").read_text()
    for name, text in named.items():
        if name != "renew":
            assert f"User=apartment-{name}\n" in text
            assert f"u apartment-{name} " in users
            assert "ExecStart=" + sys.executable in text
    wanted = (machine / "etc/systemd/system/apartment.target").read_text()
    assert all(f"apartment-{name}.service" in wanted for name in named if name != "renew")


@pytest.mark.systemd
def test_systemd_accepts_the_units(machine: Path) -> None:
    analyze = needs("systemd-analyze", "systemd")
    names = [*map(str, units(machine)), *map(str, (machine / "etc/systemd/system").glob("apartment*.t*"))]
    environment = {**os.environ, "SYSTEMD_UNIT_PATH": f"{machine / 'etc/systemd/system'}:"}
    command = [analyze, "verify", "--man=no", "--generators=no", *names]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, check=False)
    ours = [line for line in done.stderr.splitlines() if "apartment" in line and "mosquitto.service" not in line]
    assert ours == []
    assert done.returncode == 0, done.stderr


@pytest.mark.systemd
def test_systemd_finds_no_unit_more_exposed_than_3_of_10(machine: Path) -> None:
    analyze = needs("systemd-analyze", "systemd")
    for unit in units(machine):
        command = [analyze, "security", "--offline=true", "--no-pager", f"--threshold={EXPOSURE}", str(unit)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        exposure = re.search(r"exposure level for \S+: ([\d.]+)", done.stdout)
        assert exposure, done.stderr
        assert float(exposure[1]) <= EXPOSURE / 10, f"{unit.name}: {exposure[0]}\n{done.stdout}"
        assert done.returncode == 0


def test_what_is_secret_is_for_its_owner_only(machine: Path) -> None:
    for folder in ("etc/apartment/secrets", "etc/apartment/broker", "etc/apartment/database"):
        for path in (machine / folder, *(machine / folder).rglob("*")):
            assert path.stat().st_mode & 0o077 == 0, path
    texts = [path.read_text() for path in (machine / "etc/systemd").rglob("*") if path.is_file()]
    for secret in (machine / "etc/apartment/secrets/credentials").iterdir():
        assert not [text for text in texts if secret.read_text() in text]


@pytest.mark.mosquitto
def test_the_broker_of_the_installation_is_the_projects_with_its_paths(machine: Path) -> None:
    text = (machine / "etc/apartment/broker/mosquitto.conf").read_text()
    assert "password_file /etc/apartment/broker/passwords\n" in text
    assert "certfile /etc/apartment/broker/server.crt\n" in text
    assert "persistence_location /var/lib/mosquitto/\n" in text


def test_installing_again_keeps_what_people_changed(machine: Path) -> None:
    config = machine / "etc/apartment/apartment.yaml"
    config.write_text(config.read_text() + "# mine\n")
    before = (machine / "etc/apartment/secrets/secrets.yaml").read_text()
    assert install("--systemd", "--root", str(machine)).returncode == 0
    assert config.read_text().endswith("# mine\n")
    assert (machine / "etc/apartment/secrets/secrets.yaml").read_text() == before
    assert len(units(machine)) == 8


@pytest.mark.parametrize("named", ["apartment.yaml", "simulated.yaml"])
def test_files_of_peoples_own_stay_also_where_the_main_file_is_missing(tmp_path: Path, named: str) -> None:
    assert install("--systemd", "--root", str(tmp_path)).returncode == 0
    folder = tmp_path / "etc/apartment"
    (folder / "home.yaml").write_text((folder / "home.yaml").read_text() + "# mine\n")
    (folder / "ip1/preset_position.yaml").write_text("Mine: [1, 2, 0]\n")
    (folder / named).unlink()
    (folder / "bridge.yaml").unlink()
    done = install("--systemd", "--root", str(tmp_path), "--config", str(ROOT / "config" / named))
    assert done.returncode == 0, done.stderr
    assert (folder / "home.yaml").read_text().endswith("# mine\n")
    assert (folder / "ip1/preset_position.yaml").read_text() == "Mine: [1, 2, 0]\n"
    for name in (named, "bridge.yaml"):
        assert (folder / name).read_bytes() == (ROOT / "config" / name).read_bytes()


def test_a_service_that_the_configuration_has_no_more_loses_its_unit(tmp_path: Path) -> None:
    assert install("--systemd", "--root", str(tmp_path)).returncode == 0
    config = tmp_path / "etc/apartment/apartment.yaml"
    config.write_text(re.sub(r"^bridge:\n(?:  .*\n)*", "", config.read_text(), flags=re.M))
    assert (tmp_path / "etc/systemd/system/apartment-bridge.service").exists()
    done = install("--systemd", "--root", str(tmp_path))
    assert "run    systemctl stop apartment-bridge.service" in done.stdout
    assert "remove /etc/systemd/system/apartment-bridge.service" in done.stdout
    assert not (tmp_path / "etc/systemd/system/apartment-bridge.service").exists()
    assert "bridge" not in (tmp_path / "etc/systemd/system/apartment.target").read_text()


def test_a_dry_run_shows_the_steps_and_does_nothing(tmp_path: Path) -> None:
    done = install("--dry-run", "--root", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "write  /etc/systemd/system/apartment-camera-ip1.service" in done.stdout
    assert "run    systemctl daemon-reload" in done.stdout
    assert list(tmp_path.iterdir()) == []
    assert install("--root", str(tmp_path)).returncode == 2
    shown = set(re.findall(r"^(?:write|make ) +(/\S+)", done.stdout, re.M))
    assert install("--systemd", "--root", str(tmp_path)).returncode == 0
    made = {f"/{path.relative_to(tmp_path)}" for path in tmp_path.rglob("*") if path.is_file()}
    assert shown == made, "every file"
