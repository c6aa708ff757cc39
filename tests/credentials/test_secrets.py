"""What `apartment secrets` leaves in its folder, and that it keeps it to itself."""

from __future__ import annotations

import hashlib
import os
import shutil
import ssl
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from services import secret_store
from services.config import load
from services.credentials import certificates, passwords, strength
from services.credentials.folder import Folder, fill, renew
from services.errors import ConfigError
from services.peers import program

CONFIG = Path(__file__).parents[2] / "config" / "apartment.yaml"
NOW = datetime(2026, 1, 31, 7, 5, tzinfo=UTC)
HOSTS = ["apartment.lan", "127.0.0.1"]


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    made = Folder(tmp_path / "secrets")
    list(fill(made, CONFIG, HOSTS, NOW))
    return made


def test_every_account_of_the_broker_has_a_random_password(folder: Folder) -> None:
    secrets = folder.secrets()
    for account in ("camera-ip1", "bridge", "persistence", "operator", "dashboard", "mission", "hubs", "robot"):
        assert len(secrets[passwords.name_of(account)]) == 32
    assert len(secrets["DATABASE_PASSWORD"]) == 32
    assert len(set(secrets.values())) == len(secrets)
    assert "CAMERA_IP1_PASSWORD" not in secrets, "that one is made in the camera"


def test_nobody_else_can_read_anything(folder: Folder) -> None:
    for path in (folder.path, *folder.path.rglob("*")):
        assert path.stat().st_mode & 0o777 == (0o700 if path.is_dir() else 0o600), path


def test_a_service_finds_them_by_file_and_by_systemds_credentials(folder: Folder) -> None:
    by_file = secret_store.lookup({"APARTMENT_SECRETS": str(folder.path / "secrets.yaml")})
    by_systemd = secret_store.lookup(
        {"CREDENTIALS_DIRECTORY": str(folder.path / "credentials"), "APARTMENT_SECRETS": "/nowhere"}
    )
    for name, value in folder.secrets().items():
        assert by_file(name) == by_systemd(name) == value


def test_a_second_time_nothing_changes_but_what_was_missing_is_made(folder: Folder) -> None:
    before, signer = folder.secrets(), folder.pair("authority")
    kept = {name: value for name, value in before.items() if name != "BUS_MISSION_PASSWORD"}
    folder.keep({**kept, "CAMERA_IP1_PASSWORD": 'it\'s: "mine" #1'})
    with (folder.path / "broker/passwords").open("a") as file:
        file.write("phone:$7$101$c2FsdA==$aGFzaA==\n")
    list(fill(folder, CONFIG, HOSTS, NOW))
    after = folder.secrets()
    assert {name for name in after if after[name] != before.get(name)} == {
        "BUS_MISSION_PASSWORD",
        "CAMERA_IP1_PASSWORD",
    }
    assert after["CAMERA_IP1_PASSWORD"] == 'it\'s: "mine" #1'
    assert folder.pair("authority") == signer
    assert "\nphone:" in (folder.path / "broker/passwords").read_text()


def test_force_makes_all_anew_but_what_was_brought(folder: Folder) -> None:
    folder.keep({**folder.secrets(), "CAMERA_IP1_PASSWORD": "of the camera"})
    before, signer, server = folder.secrets(), folder.pair("authority"), folder.pair("broker")
    list(fill(folder, CONFIG, HOSTS, NOW, force=True))
    after = folder.secrets()
    assert {name for name in after if after[name] == before[name]} == {"CAMERA_IP1_PASSWORD"}
    assert folder.pair("authority") != signer
    fresh = folder.pair("broker")
    assert server is not None
    assert fresh is not None
    assert fresh.key != server.key


def test_a_name_more_is_added_to_the_certificates_and_nothing_else_is_new(folder: Folder) -> None:
    def told() -> tuple[object, ...]:
        return folder.secrets(), folder.pair("authority")

    def named() -> list[list[str]]:
        pairs = [folder.pair(name) for name in ("broker", "dashboard", "database")]
        return [certificates.hosts(pair.certificate) for pair in pairs if pair is not None]

    before, old = told(), folder.pair("broker")
    list(fill(folder, CONFIG, ["127.0.0.1"], NOW))
    assert folder.pair("broker") == old, "every name is there already"
    said = list(fill(folder, CONFIG, ["new.lan", "0:0::1", "apartment.lan"], NOW))
    assert [line for line in said if "a new certificate for apartment.lan, 127.0.0.1, new.lan, ::1" in line]
    assert named() == [[*HOSTS, "new.lan", "::1"]] * 3
    assert told() == before
    new = folder.pair("broker")
    list(fill(folder, CONFIG, ["0:0::1"], NOW))
    assert folder.pair("broker") == new
    list(fill(folder, CONFIG, HOSTS, NOW, force=True))
    assert named() == [[*HOSTS, "new.lan", "::1"]] * 3
    assert folder.pair("broker") != new


def test_a_certificate_is_renewed_when_it_ends_soon_and_the_authority_stays(folder: Folder) -> None:
    signer, old = folder.pair("authority"), folder.pair("broker")
    assert old is not None
    month = timedelta(days=30)
    assert list(renew(folder, month, NOW)) == []
    later = certificates.ends(old.certificate) - timedelta(days=29)
    assert len(list(renew(folder, month, later))) == 3
    fresh = folder.pair("broker")
    assert fresh is not None
    assert (fresh.key, certificates.pin(fresh.certificate)) == (old.key, certificates.pin(old.certificate))
    assert fresh.certificate != old.certificate
    assert certificates.ends(fresh.certificate) > later + 20 * month
    assert certificates.hosts(fresh.certificate) == HOSTS
    assert folder.pair("authority") == signer
    assert any("init --force" in line for line in renew(folder, timedelta(days=9999), NOW))


def test_openssl_accepts_the_certificates_for_these_names_and_no_others(folder: Folder) -> None:
    openssl = program("openssl", "openssl")

    def verify(*words: str) -> bool:
        now = str(int((NOW + timedelta(days=1)).timestamp()))
        command = [openssl, "verify", "-x509_strict", "-purpose", "sslserver", "-attime", now, "-CAfile"]
        given = [*command, str(folder.authority), *words, str(folder.path / "broker/server.crt")]
        return subprocess.run(given, capture_output=True, timeout=60, check=False).returncode == 0

    assert verify("-verify_hostname", "apartment.lan")
    assert verify("-verify_ip", "127.0.0.1")
    assert not verify("-verify_hostname", "elsewhere.lan")
    context = ssl.create_default_context(cafile=str(folder.authority))
    context.verify_flags |= ssl.VERIFY_X509_STRICT
    context.load_cert_chain(folder.path / "dashboard/server.crt", folder.path / "dashboard/server.key")


def test_a_key_is_known_by_the_hash_that_openssl_makes_of_it(folder: Folder) -> None:
    openssl = program("openssl", "openssl")
    file = str(folder.path / "broker/server.crt")
    key = subprocess.run([openssl, "x509", "-in", file, "-pubkey", "-noout"], capture_output=True, check=True).stdout
    plain = [openssl, "pkey", "-pubin", "-outform", "der"]
    der = subprocess.run(plain, input=key, capture_output=True, check=True).stdout
    pair = folder.pair("broker")
    assert pair is not None
    assert certificates.pin(pair.certificate) == "SHA-256:" + hashlib.sha256(der).hexdigest().upper()


def test_a_repository_is_no_place_for_secrets(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    with pytest.raises(ConfigError, match="outside of"):
        list(fill(Folder(tmp_path / "config/secrets"), CONFIG, HOSTS, NOW))
    assert not (tmp_path / "config").exists()


def test_a_fault_of_the_home_is_told_before_anything_is_made(tmp_path: Path) -> None:
    config = Path(shutil.copytree(CONFIG.parent, tmp_path / "config")) / CONFIG.name
    home = config.with_name("home.yaml")
    home.write_text(home.read_text(encoding="utf-8").replace("dev/lamp/color/set", "dev/+/set"), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"home\.yaml:\d+: items\.Lamp_Color\.mqtt\.command: expected a topic"):
        list(fill(Folder(tmp_path / "secrets"), config, HOSTS, NOW))
    assert not (tmp_path / "secrets").exists()


def test_the_command_makes_them_and_takes_one_that_is_brought(tmp_path: Path) -> None:
    def run(*words: str, given: str = "") -> str:
        command = [sys.executable, "-m", "services", "secrets", *words, "--out", str(tmp_path / "s")]
        done = subprocess.run(command, input=given, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr

    said = run("init", "--config", str(CONFIG), "--host", "apartment.lan")
    assert "missing: CAMERA_IP1_PASSWORD" in said
    said += run("set", "CAMERA_IP1_PASSWORD", given="of the camera\n") + run("renew", "--within", "9999")
    kept = Folder(tmp_path / "s").secrets()
    assert kept["CAMERA_IP1_PASSWORD"] == "of the camera"
    assert "renewed until" in said
    assert not [name for name, value in kept.items() if value in said]


@pytest.mark.parametrize(
    "password", ["", "short", "aaaaaaaaaaaa", "Password1!", "only-simulated", "camera12", "invented"]
)
def test_a_password_that_anybody_would_guess_is_weak(password: str) -> None:
    why = passwords.weakness(password, user="camera")
    assert why
    assert not password or password not in why


def test_a_random_password_is_not_weak() -> None:
    (made,) = passwords.made(["A"]).values()
    assert passwords.weakness(made, user="persistence") is None
    assert passwords.weakness("a sentence of my own", user="ros") is None


def test_weak_passwords_are_faults_outside_of_the_demo(folder: Folder) -> None:
    def told(file: str, **environment: str) -> list[str]:
        return strength.faults(load(CONFIG.with_name(file), environment={**folder.secrets(), **environment}))

    lines = CONFIG.read_text().splitlines()
    camera = lines.index("    password: ${CAMERA_IP1_PASSWORD}") + 1
    bridge = lines.index("    bridge: ${BUS_BRIDGE_PASSWORD}") + 1
    weak = told("apartment.yaml", CAMERA_IP1_PASSWORD="camera1234", BUS_BRIDGE_PASSWORD="")
    expected = "expected a password that nobody guesses, got "
    assert f"{CONFIG}:{bridge}: bus.accounts.bridge: {expected}none" in weak
    (other,) = told("apartment.yaml", CAMERA_IP1_PASSWORD="changeme")
    assert other.startswith(f"{CONFIG}:{camera}: cameras.ip1.password: {expected}")
    assert not [line for line in weak if "camera1234" in line]
    assert told("apartment.yaml", CAMERA_IP1_PASSWORD="of the hall's camera") == []
    assert told("simulated.yaml") == [], "the demo's own are no secret"


def test_check_refuses_them(folder: Folder) -> None:
    command = [sys.executable, "-m", "services", "check", "--config", str(CONFIG)]
    given = {**os.environ, **folder.secrets(), "CAMERA_IP1_PASSWORD": "changeme"}
    done = subprocess.run(command, env=given, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2
    assert "cameras.ip1.password: expected a password that nobody guesses" in done.stderr
    assert "changeme" not in done.stderr
