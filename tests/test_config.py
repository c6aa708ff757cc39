"""The configuration: every fault at once, with file and line; secrets from where they belong."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from services import peers, secret_store
from services.client import connected
from services.config import load
from services.document import dotted, read, write
from services.errors import ConfigError
from tests.bus.test_tls import certificates

CONFIG = Path(__file__).parents[1] / "config"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the example configuration, to be spoilt."""
    return Path(shutil.copytree(CONFIG, tmp_path / "config"))


def spoil(file: Path, old: str, new: str, *, first: bool = False) -> int:
    """Replaces a text that stands once (or its first); the line it stood in."""
    text = file.read_text(encoding="utf-8")
    assert text.count(old) == 1 or (first and old in text), f"{old!r} stands {text.count(old)} times"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    return text[: text.index(old)].count("\n") + 1


def faults(file: Path) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load(file, deep=True)
    return list(caught.value.faults)


def test_the_simulated_apartment_needs_nothing_from_outside() -> None:
    apartment = load(CONFIG / "simulated.yaml")
    assert apartment.cameras == ("ip1",)
    assert {"camera-ip1", "bridge", "persistence", "simulated-home", "simulated-camera"} <= set(apartment.instances)


def test_the_example_is_good_once_its_secrets_are_there(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = faults(CONFIG / "apartment.yaml")
    assert len(missing) == 11
    assert all("expected ${" in fault and "got nothing" in fault for fault in missing)
    for fault in missing:
        monkeypatch.setenv(fault.split("${")[1].split("}")[0], "invented")
    apartment = load(CONFIG / "apartment.yaml")
    assert "invented" not in repr(apartment)


def test_six_faults_of_six_kinds_are_all_told_with_file_and_line(folder: Path) -> None:
    file, home = folder / "simulated.yaml", folder / "home.yaml"
    lines = [
        spoil(file, "    user: ros\n    password: ${CAMERA", "    usr: ros\n    password: ${CAMERA", first=True),
        spoil(file, "  port: ${APARTMENT_BROKER_PORT:-1883}", "  port: many"),
        spoil(file, "    tilt_range: [-10, 108]", "    tilt_range: [-10]"),
        spoil(file, "default_camera: ip1", "default_camera: ip7"),
        spoil(file, "  rules: bridge.yaml", "  rules: ${NOT_ANYWHERE}"),
        spoil(home, "  Kitchen_Light:", "  Kitchen-Light:"),
    ]  # fmt: skip
    told = faults(file)
    places = [f"{file}:{line}: " for line in lines[:5]] + [f"{home}:{lines[5]}: "]
    for place in places:
        assert any(fault.startswith(place) for fault in told), f"{place} not in {told}"
    by_place = {place: next(fault for fault in told if fault.startswith(place)) for place in places}
    assert "did you mean 'user'?" in by_place[places[0]]
    assert "bus.port: expected a valid integer" in by_place[places[1]]
    assert "cameras.ip1.tilt_range" in by_place[places[2]]
    assert "default_camera: expected one of the cameras (ip1), got 'ip7'" in by_place[places[3]]
    assert "expected ${NOT_ANYWHERE} in the environment" in by_place[places[4]]
    assert "items.Kitchen-Light: expected a name of letters, digits and _" in by_place[places[5]]


def test_where_the_apartment_lies_is_not_said_to_the_bridge_any_more(folder: Path) -> None:
    file = folder / "simulated.yaml"
    line = spoil(file, "  rules: bridge.yaml", "  apartment: [1, 2, 3]\n  rules: bridge.yaml")
    (told,) = faults(file)
    assert told.startswith(f"{file}:{line}: bridge.apartment: expected places: FILE, whose apartment_to_map")


def test_several_cameras_are_simulated_from_one_file_each_in_a_service_of_its_own(folder: Path) -> None:
    file = folder / "simulated.yaml"
    spoil(file, "simulators:\n", "simulators:\n  cameras:\n    hall: {port: 8942}\n    attic: {profile: 2020s-dahua}\n")
    instances = load(file, deep=True).instances
    assert {"simulated-camera", "simulated-camera-hall", "simulated-camera-attic"} <= set(instances)
    assert instances["simulated-camera-hall"].config.model_dump()["port"] == 8942
    assert instances["simulated-camera-attic"].config.model_dump()["profile"] == "2020s-dahua"


def test_a_camera_whose_name_cannot_be_a_topic_is_a_fault(folder: Path) -> None:
    file = folder / "simulated.yaml"
    line = spoil(file, "simulators:\n", "simulators:\n  cameras:\n    Hall-1: {}\n") + 2
    assert f"{file}:{line}: simulators.cameras.Hall-1: expected a name of a-z" in faults(file)[0]


@pytest.mark.parametrize(
    ("there", "misnamed", "path"),
    [
        ("mission:\n  robots:\n    tiago:", "mission:\n  robots:\n    TIAGo:", "mission.robots.TIAGo"),
        ("    tiago:\n      kind: tiago", "    TIAGo:\n      kind: tiago", "bridge.robots.TIAGo"),
        ("  robot: tiago      ", "  robot: TIAGo      ", "bridge.robot"),
        ("    robot: tiago", "    robot: TIAGo", "simulators.robot.robot"),
    ],
)
def test_a_robot_whose_name_cannot_be_a_topic_is_a_fault(folder: Path, there: str, misnamed: str, path: str) -> None:
    file = folder / "simulated.yaml"
    line = spoil(file, there, misnamed, first=True) + misnamed[: misnamed.index("TIAGo")].count("\n")
    assert faults(file) == [
        f"{file}:{line}: {path}: expected a name of a-z, 0-9 and _ beginning with a letter, got 'TIAGo'"
    ]


def test_a_machine_that_runs_one_service_needs_that_services_secrets_only(folder: Path) -> None:
    file = folder / "simulated.yaml"
    spoil(file, "simulators:\n", "simulators:\n  cameras:\n    hall: {password: '${NOT_HERE}'}\n")
    load(file, ("simulated-camera",))
    with pytest.raises(ConfigError, match="NOT_HERE"):
        load(file, ("simulated-camera-hall",))


def test_the_files_that_services_name_are_checked_too(folder: Path) -> None:
    file = folder / "simulated.yaml"
    files = [folder / name for name in ("bridge.yaml", "ip1/ost.yaml", "ip1/preset_position.yaml", "world.yaml")]
    lines = [
        spoil(files[0], "direction: to_ros", "direction: up", first=True),
        spoil(files[1], "image_width: 1152", "image_width: wide"),
        spoil(files[2], "Kitchen: [", "Kitchen: [far, "),
        spoil(files[3], "resolution: 0.05", "resolution: -1"),
        spoil(file, "  port: ${APARTMENT_BROKER_PORT:-1883}", "  port: many"),
    ]
    told = faults(file)
    for spoilt, line in zip([*files, file], lines, strict=True):
        assert any(fault.startswith(f"{spoilt}:") for fault in told), f"{spoilt}:{line} not in {told}"


def test_a_strategy_that_nobody_knows_is_told_with_its_line(folder: Path) -> None:
    home = folder / "home.yaml"
    line = spoil(home, "[everyChange, restoreOnStartup]", "[everyChange, restorOnStartup]", first=True)
    (told,) = faults(folder / "simulated.yaml")
    assert told.startswith(f"{home}:{line}: items.Home_Location.persist[1]: expected 'everyChange', 'everyUpdate' or ")
    assert told.endswith(", got 'restorOnStartup'")


def test_what_cannot_be_dealt_out_to_writers_is_told_with_the_line_of_that_setting(folder: Path) -> None:
    file = folder / "simulated.yaml"
    line = spoil(file, "\npersistence:\n", "\npersistence:\n  writers:\n    count: 2\n    by: share\n") + 4
    (told,) = faults(file)
    assert told.startswith(
        f"{file}:{line}: persistence.writers.by: expected item, or everyUpdate alone without a filter"
    )
    assert told.endswith(", got share")


def test_a_colon_in_the_path_of_the_files_confuses_nothing(folder: Path) -> None:
    folder = folder.rename(folder.with_name("at: 10:30"))
    file = folder / "simulated.yaml"
    lines = [
        spoil(file, "  port: ${APARTMENT_BROKER_PORT:-1883}", "  port: many"),
        spoil(file, "default_camera: ip1", "default_camera: ip7"),
        spoil(file, "simulators:\n", "simulators:\n  cameras:\n    hall: {password: '${NOT_HERE}'}\n") + 2,
    ]
    told = faults(file)
    assert [one.startswith(f"{file}:{line}: ") for one, line in zip(told, sorted(lines), strict=True)] == [True] * 3
    with pytest.raises(ConfigError) as caught:
        load(file, ("bridge",))
    assert "NOT_HERE" not in str(caught.value)


def test_check_lists_every_fault_and_ends_with_two(folder: Path) -> None:
    file = folder / "simulated.yaml"
    spoil(file, "  port: ${APARTMENT_BROKER_PORT:-1883}", "  port: 99999")
    spoil(file, "default_camera: ip1", "default_camera: ip7")
    done = subprocess.run(
        [sys.executable, "-m", "services", "check", "--config", str(file)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 2
    assert all(line.startswith(f"{file}:") for line in done.stderr.splitlines())


def test_a_password_never_stands_in_a_fault(folder: Path) -> None:
    file = folder / "simulated.yaml"
    spoil(file, "  password: ${CAMERA_IP1_PASSWORD:-only-simulated}", "  password: [very-secret]", first=True)
    assert "very-secret" not in "\n".join(faults(file))


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate and its key."""
    try:
        _, cert, key = certificates(tmp_path_factory.mktemp("certificates") / "ours", "our CA")
    except peers.Missing as missing:
        pytest.skip(str(missing))
    return cert, key


BUS = "bus:\n  host", "bus:\n  tls: {ca: ca.crt}\n  host"
PAGE = "  plan: plan.yaml\n", "  tls:\n    cert: page.crt\n    key: page.key\n  plan: plan.yaml\n"


def test_certificates_are_looked_for_beside_the_configuration(folder: Path, pair: tuple[Path, Path]) -> None:
    file = folder / "simulated.yaml"
    spoil(file, *BUS)
    spoil(file, *PAGE)
    for name, source in (("ca.crt", pair[0]), ("page.crt", pair[0]), ("page.key", pair[1])):
        shutil.copy(source, folder / name)
    tls = load(file, deep=True).bus.tls
    assert tls is not None
    assert (tls.ca, tls.cert) == (folder / "ca.crt", None)


def test_every_certificate_that_cannot_be_used_is_told_with_its_line(folder: Path, pair: tuple[Path, Path]) -> None:
    file = folder / "simulated.yaml"
    line = spoil(file, *BUS) + 1
    assert faults(file) == [f"{file}:{line}: bus.tls.ca: expected a readable file, got no file {folder / 'ca.crt'}"]
    (folder / "ca.crt").write_text("no certificate")
    at = spoil(file, *PAGE) + 1
    (folder / "page.key").mkdir()
    assert faults(file) == [
        f"{file}:{line}: bus.tls.ca: expected certificates as PEM, got none in {folder / 'ca.crt'}",
        f"{file}:{at}: dashboard.tls.cert: expected a readable file, got no file {folder / 'page.crt'}",
        f"{file}:{at + 1}: dashboard.tls.key: expected a readable file, got Is a directory: {folder / 'page.key'}",
    ]
    shutil.copy(pair[0], folder / "ca.crt")
    shutil.copy(pair[0], folder / "page.crt")
    (folder / "page.key").rmdir()
    shutil.copy(pair[0], folder / "page.key")
    (told,) = faults(file)
    assert told.startswith(f"{file}:{at}: dashboard.tls.cert: expected a certificate as PEM and its own key")


def test_a_key_that_a_password_locks_is_told_and_no_password_asked_for(folder: Path, pair: tuple[Path, Path]) -> None:
    file = folder / "simulated.yaml"
    line = spoil(file, *PAGE) + 1
    shutil.copy(pair[0], folder / "page.crt")
    locked = ("pkey", "-in", pair[1], "-aes128", "-passout", "pass:secret", "-out", folder / "page.key")
    subprocess.run([peers.program("openssl", "openssl"), *locked], check=True, capture_output=True, timeout=60)
    (told,) = faults(file)
    assert told.startswith(f"{file}:{line}: dashboard.tls.cert: expected a certificate as PEM and its own key")


def test_a_machine_without_the_dashboard_needs_no_certificate_of_its_page(folder: Path) -> None:
    file = folder / "simulated.yaml"
    spoil(file, *PAGE)
    load(file, ("bridge",), deep=True)
    with pytest.raises(ConfigError, match=r"dashboard\.tls\.key"):
        load(file, ("dashboard",), deep=True)


def test_who_comes_to_the_broker_without_a_check_before_is_told_too(folder: Path) -> None:
    file = folder / "simulated.yaml"
    line = spoil(file, *BUS) + 1
    settings = load(file).bus  # what is installed first may come later: nothing here needs the broker
    with pytest.raises(ConfigError) as caught, connected(settings):
        pass
    assert caught.value.faults[0].startswith(f"{file}:{line}: bus.tls.ca: expected a readable file, got no file")


def test_a_service_that_is_started_without_a_check_before_ends_with_two(folder: Path) -> None:
    file = folder / "simulated.yaml"
    line = spoil(file, *PAGE) + 1
    command = [sys.executable, "-m", "services", "serve", "dashboard", "--config", str(file)]
    environment = {**os.environ, "APARTMENT_DASHBOARD_PORT": "0", "XDG_STATE_HOME": str(folder)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment)
    assert done.returncode == 2
    assert f"{file}:{line}: dashboard.tls.cert: expected a readable file, got no file" in done.stderr
    assert "Traceback" not in done.stderr
    assert "READY" not in done.stdout


def test_only_the_services_that_run_here_need_their_secrets(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BUS_BRIDGE_PASSWORD", "invented")
    assert "bridge" in load(CONFIG / "apartment.yaml", only=("bridge",)).instances


def test_a_document_knows_its_lines_and_tells_what_is_wrong_with_it(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text("a:\n  b: [1, 2]\n  ON: off\nc: 1\nc: 2\n")
    document = read(file)
    assert document.value == {"a": {"b": [1, 2], "ON": "off"}, "c": 1}
    assert document.where(("a", "b", 1)) == f"{file}:2"
    assert document.faults == [f"{file}:1: file: expected every key once, got 'c' again in line 5"]
    file.write_text("a: [1,\nb: 2")
    assert read(file).faults[0].startswith(f"{file}:2: file: expected YAML, got ")
    assert "expected a readable file" in read(tmp_path / "nowhere.yaml").faults[0]
    assert dotted(("cameras", "hall", "presets", 1)) == "cameras.hall.presets[1]"


def test_writing_comes_back_as_it_was(tmp_path: Path) -> None:
    places = {"Living room": [41.1, 34.5, 0], "Küche": [0.0, 1.5, 2]}
    write(tmp_path / "p.yaml", places)
    assert read(tmp_path / "p.yaml").value == places
    assert [file.name for file in tmp_path.iterdir()] == ["p.yaml"]


def test_secrets_come_from_environment_then_credential_then_file(tmp_path: Path) -> None:
    (tmp_path / "secrets.yaml").write_text("A: file\nB: file\nC: file\n")
    (tmp_path / "credentials").mkdir()
    for name in ("A", "B"):
        (tmp_path / "credentials" / name).write_text("credential\n")
    environment = {"A": "environment", "CREDENTIALS_DIRECTORY": str(tmp_path / "credentials"),
                   "APARTMENT_SECRETS": str(tmp_path / "secrets.yaml")}  # fmt: skip
    find = secret_store.lookup(environment)
    assert [find(name) for name in "ABCD"] == ["environment", "credential", "file", None]


def test_a_switch_of_the_simulated_firmware_can_be_set_and_a_wrong_one_is_told_with_its_line(folder: Path) -> None:
    file = folder / "simulated.yaml"
    line = spoil(file, "    camera: ip1\n", "    camera: ip1\n    switches:\n      nonce: flaky\n")
    assert load(file, deep=True).instances["simulated-camera"].config.model_dump()["switches"]["nonce"] == "flaky"
    spoil(file, "      nonce: flaky\n", "      nonces: flaky\n      status_form: d\n")
    told = faults(file)
    assert any(
        fault.startswith(f"{file}:{line + 2}: simulators.camera.switches.nonces: expected a known key")
        and "did you mean 'nonce'?" in fault
        for fault in told
    ), told
    assert any(f"{file}:{line + 3}: simulators.camera.switches.status_form: expected 'a'" in fault for fault in told)
