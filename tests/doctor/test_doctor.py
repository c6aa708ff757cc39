"""The doctor at broken set-ups, on real parts: each is found, and its mend is named."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from services import access
from services.client import connected
from services.config import BusSettings
from services.doctor import broker as at_broker
from services.doctor import machine, others
from services.doctor.examination import examine
from services.doctor.findings import Finding
from services.history import Config as History
from services.peers import Missing, embedded, free_port, mariadb, mosquitto, ros, wait_until
from services.simulators.camera.digest import Door
from services.simulators.camera.firmwares import PROFILES
from services.storage import open_storage, read_address, upkeep
from tests.camera.speaking import SpeakingCamera, speaking
from tests.databases import connected as let_in
from tests.databases import fresh_mariadb

ROOT = Path(__file__).parents[2]
PASSWORD = "of the hall's camera"
ACCOUNTS = ("operator", "persistence", "camera-ip1")

Change = Callable[[dict[str, Any]], None]


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[mosquitto.Broker]:
    """The one that all sound parts share."""
    try:
        with mosquitto.private(tmp_path_factory.mktemp("broker")) as running:
            yield running
    except Missing as missing:
        pytest.skip(str(missing))


@pytest.fixture(scope="module")
def camera() -> Iterator[SpeakingCamera]:
    with speaking() as running:
        running.door = Door("Login to AMC", "ros", PASSWORD, PROFILES["2020s-dahua"], Random(1))
        yield running


class Patient:
    """A sound configuration, and what the doctor says of it after a change."""

    def __init__(self, folder: Path, broker: mosquitto.Broker, camera: SpeakingCamera) -> None:
        self.folder = folder
        shutil.copy(ROOT / "config/home.yaml", folder)
        self.told: dict[str, Any] = {
            "home": "home.yaml",
            "state": str(folder / "state"),
            "bus": {"port": broker.port, "accounts": {name: broker.passwords[name] for name in ACCOUNTS}},
            "cameras": {"ip1": {"url": camera.url, "user": "ros", "password": PASSWORD}},
            "persistence": {"url": "sqlite:///bus.db"},
        }
        self.environment = {"APARTMENT_SECRETS": str(folder / "secrets.yaml")}

    def file(self) -> Path:
        file = self.folder / "apartment.yaml"
        file.write_text(json.dumps(self.told))
        return file

    def ill(self, **changed: Any) -> list[Finding]:
        for path, value in changed.items():
            *outer, last = path.split("__")
            inner = self.told
            for key in outer:
                inner = inner[key]
            inner[last] = value
        return [one for one in examine(self.file(), self.environment) if not one.good and "ms for" not in one.what]


@pytest.fixture
def patient(tmp_path: Path, broker: mosquitto.Broker, camera: SpeakingCamera) -> Patient:
    return Patient(tmp_path, broker, camera)


def only(found: list[Finding], part: str, what: str, mend: str) -> None:
    """Exactly this is ill, with that mend."""
    assert [one.part for one in found] == [part], found
    assert re.search(what, found[0].what), found
    assert mend in found[0].mend, found


@pytest.mark.mosquitto
def test_a_sound_apartment_is_well(patient: Patient) -> None:
    assert patient.ill() == []


@pytest.mark.mosquitto
def test_it_makes_and_changes_nothing(patient: Patient) -> None:
    file, state = patient.folder / "bus.db", patient.folder / "state"
    found = [one.what for one in examine(patient.file(), patient.environment)]
    assert f"no file {file} yet: the first who writes makes it" in found
    assert not file.exists()
    assert not state.exists()
    address = read_address(f"sqlite:///{file}")
    open_storage(address).close()
    upkeep.take_back(address, 3)
    before = file.read_bytes()
    assert "schema version 3, the writer makes it 4" in [one.what for one in others.database(address)]
    assert file.read_bytes() == before


@pytest.mark.mosquitto
def test_a_key_that_nobody_knows(patient: Patient) -> None:
    only(patient.ill(cameras__ip1__passwd="x"), "configuration", "apartment.yaml:1: .*passwd.*known key", "change that")


@pytest.mark.mosquitto
def test_a_secret_that_is_missing(patient: Patient) -> None:
    only(patient.ill(bus__accounts__operator="${BUS_OPERATOR_PASSWORD}"), "secrets", "got nothing", "secrets init")
    patient.told["bus"]["accounts"].pop("operator")
    found = patient.ill(cameras__ip1__password="${CAMERA_IP1_PASSWORD}")
    only(found, "secrets", "got nothing", "apartment secrets set CAMERA_IP1_PASSWORD")


@pytest.mark.mosquitto
def test_secrets_that_everybody_can_read(patient: Patient) -> None:
    file = patient.folder / "secrets.yaml"
    file.write_text("A: b\n")
    file.chmod(0o644)
    only(patient.ill(), "secrets", "can be read by others", f"chmod 600 {file}")


@pytest.mark.mosquitto
def test_a_folder_that_cannot_be_written(patient: Patient) -> None:
    (patient.folder / "file").write_text("")
    only(patient.ill(state=str(patient.folder / "file/state")), "machine", "cannot be written", "another folder")


@pytest.mark.mosquitto
def test_a_broker_that_is_not_there(patient: Patient) -> None:
    only(patient.ill(bus__port=free_port()), "broker", "nothing answers", "systemctl start mosquitto")


@pytest.mark.mosquitto
def test_a_broker_that_refuses_the_password(patient: Patient) -> None:
    found = patient.ill(bus__accounts__operator="another password")
    only(found, "broker", "refuses operator: Not authorized", "apartment secrets init")


@pytest.mark.mosquitto
def test_an_access_list_of_another_version(patient: Patient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(at_broker, "ANSWER_S", 2.0)
    found: list[Finding] = []

    def told() -> bool:
        found[:] = patient.ill()
        return any("may not say and hear" in one.what for one in found)

    with mosquitto.private(tmp_path / "old") as old:
        (tmp_path / "old/acl").write_text("user operator\ntopic read home/#\n")
        os.kill(old.pid, signal.SIGHUP)
        patient.told["bus"] = {"port": old.port, "accounts": old.passwords}
        wait_until(told, "the new list", 60.0)
    only(found, "broker", "may not say and hear", "access list is not of this version")


@pytest.mark.mosquitto
def test_a_broker_without_nodelay(patient: Patient, tmp_path: Path) -> None:
    conf = tmp_path / "slow.conf"
    conf.write_text(access.CONF.read_text().replace("set_tcp_nodelay true", ""))
    with mosquitto.private(tmp_path / "slow", conf=conf) as slow:
        patient.told["bus"] |= {"port": slow.port, "accounts": slow.passwords}
        findings = [one for one in examine(patient.file(), patient.environment) if not one.good]
    only(findings, "broker", "ms for 3 messages", "set_tcp_nodelay true")


@pytest.mark.mosquitto
def test_commands_that_the_broker_keeps(patient: Patient, broker: mosquitto.Broker) -> None:
    settings = BusSettings(port=broker.port, accounts={"operator": broker.passwords["operator"]})
    topics = [f"home/{item}/{verb}" for item in ("Blind of 'A'", "Lamp") for verb in ("command", "set")]
    with connected(settings, ("home/+/command", "home/+/set")) as client:

        def kept(payload: bytes) -> list[Finding]:
            for topic in topics:
                client.say(topic, payload, retain=True)
            client.until(lambda one: (one.topic, one.payload) == (topics[-1], payload))
            return patient.ill()

        found = kept(b"ON")
        assert kept(b"") == []
    assert {(one.part, "OpenHAB obeys" in one.what) for one in found} == {("broker", True)}
    assert sorted(one.what.rpartition(": ")[2] for one in found) == topics
    assert sorted(shlex.split(one.mend)[-4:] for one in found) == [["-r", "-n", "-t", topic] for topic in topics]


@pytest.mark.mosquitto
def test_a_broker_of_another_kind(patient: Patient) -> None:
    with embedded.broker() as port:
        found = [one for one in patient.ill(bus={"port": port}) if one.part == "broker"]
    assert "MQTT 3.1.1 only" in found[0].what
    assert "mosquitto 2" in found[0].mend


@pytest.mark.mosquitto
def test_a_certificate_that_is_not_there(patient: Patient) -> None:
    only(patient.ill(bus__tls={"ca": "/nowhere/ca.crt"}), "broker", "no file", "copy ca.crt")


@pytest.mark.mosquitto
def test_a_database_that_is_away(patient: Patient) -> None:
    url = f"mysql://apartment@127.0.0.1:{free_port()}/bus"
    only(patient.ill(persistence={"url": url, "password": "long enough"}), "database", "", "systemctl start mariadb")


@pytest.mark.mariadb
def test_a_database_that_refuses_the_password(mariadb_server: mariadb.Server) -> None:
    at = fresh_mariadb(mariadb_server).address
    wrong = read_address(f"mysql://{at.user}@localhost/{at.database}?socket={at.socket}", password="wrong")
    only(list(others.database(wrong)), "database", "cannot be used", "apartment db init")


@pytest.mark.mariadb
def test_a_reader_or_keeper_that_may_not_do_the_work_of_history(mariadb_server: mariadb.Server, tmp_path: Path) -> None:
    server, at = mariadb_server, fresh_mariadb(mariadb_server).address
    open_storage(at).close()
    told = {
        "url": f"mysql://doctors_reader@localhost/{at.database}?socket={at.socket}", "password": "reads",
        "keeper": {"user": "doctors_keeper", "password": "keeps"}, "keep": [{"items": ["Lab"], "raw": "7d"}],
        "home": {"items": {"Lab": {"type": "Number", "label": "Lab"}}},
    }  # fmt: skip
    config = History.model_validate(told)
    admin = upkeep.administrator(at, server.admin, None)
    try:
        assert [one.good for one in others.readers(config)] == [False, False]
        upkeep.make_account(config.address, admin, upkeep.READING)
        upkeep.make_account(config.keeping_address, admin, upkeep.READING)
        only([one for one in others.readers(config) if not one.good], "database", "doctors_keeper .* 1142", "db init")
        upkeep.make_account(config.keeping_address, admin, upkeep.KEEPING)
        assert [one.good for one in others.readers(config)] == [True, True]
        wrong = History.model_validate({**told, "password": "forgotten"})
        only([one for one in others.readers(wrong) if not one.good], "database", "doctors_reader .* 1045", "db init")
    finally:
        with let_in(server, server.admin, "", None) as root:
            root.query("DROP USER IF EXISTS doctors_reader@localhost, doctors_keeper@localhost")


@pytest.mark.mosquitto
def test_a_camera_that_is_off_and_one_with_another_password(patient: Patient) -> None:
    only(patient.ill(cameras__ip1__password="not the right one"), "camera ip1", "", "secrets set CAMERA_IP1_PASSWORD")
    only(patient.ill(cameras__ip1__url=f"http://127.0.0.1:{free_port()}"), "camera ip1", "", "power and network")


def test_a_full_disk_and_a_clock_in_the_past() -> None:
    assert "journalctl --vacuum-size" in machine.room(10 * 2**20, Path("/")).mend
    assert machine.room(10 * 2**30, Path("/")).good
    assert "timedatectl set-ntp true" in machine.clock(0.0, 1_769_839_200.0).mend
    assert machine.clock(1_769_839_200.0, 1_769_839_200.0).good


def test_no_ros_master() -> None:
    found = list(others.ros({"ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}"}))
    only(found, "ros", "no master", "ROS_MASTER_URI")


@pytest.mark.ros
def test_a_name_that_the_robot_cannot_resolve(tmp_path: Path) -> None:
    try:
        with ros.private(tmp_path / "ros") as master:
            found = list(others.ros({"ROS_MASTER_URI": master.uri, "ROS_HOSTNAME": "nobody.invalid"}))
            well = list(others.ros({"ROS_MASTER_URI": master.uri, "ROS_IP": "127.0.0.1"}))
    except Missing as missing:
        pytest.skip(str(missing))
    assert all(one.good for one in well), well
    only([one for one in found if not one.good], "ros", "nobody.invalid", "export ROS_IP=")


@pytest.fixture
def master() -> Iterator[str]:
    """The address of a ROS master that knows nobody."""
    with SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False) as server:
        server.register_function(lambda caller: [1, "", [[], [], []]], "getSystemState")
        serving = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        serving.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        serving.join()


class Systemd:
    """A `systemctl` that knows one unit, or none."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "systemctl"
        self.knows("not-found")

    def knows(self, load: str, environment: str = "") -> None:
        told = f"LoadState={load}\\nEnvironment={environment}\\n"
        answer = f'[ "$3" = apartment-bridge.service ] && printf "{told}"'
        self._file.write_text(f"#!/bin/sh\n{answer}\n")
        self._file.chmod(0o700)


@pytest.fixture
def systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Systemd:
    (tmp_path / "programs").mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path / 'programs'}:{os.environ['PATH']}")
    return Systemd(tmp_path / "programs")


@pytest.mark.mosquitto
def test_ros_is_looked_at_as_the_bridge_sees_it(patient: Patient, master: str, systemd: Systemd) -> None:
    patient.told["bus"]["accounts"]["bridge"] = "long enough a password"
    shutil.copy(ROOT / "config/bridge.yaml", patient.folder)
    patient.environment |= {"ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}", "ROS_IP": "127.0.0.1"}
    only(patient.ill(bridge={"rules": "bridge.yaml"}), "ros", "no master", "bridge.master_uri")
    assert patient.ill(bridge__master_uri=master) == [], "the setting goes before the environment"
    systemd.knows("loaded", "'A=b c' ROS_HOSTNAME=nobody.invalid")
    mend = "systemctl edit apartment-bridge.service: [Service] Environment=ROS_IP="
    only(patient.ill(), "ros", "itself nobody.invalid", mend)
    patient.environment["ROS_IP"] = "nobody.invalid"
    systemd.knows("loaded", "ROS_IP=127.0.0.1")
    assert patient.ill() == [], "what the shell says is nothing to the service"


@pytest.mark.mosquitto
def test_the_command_shows_the_mend_and_ends_with_one(patient: Patient) -> None:
    patient.told["bus"]["port"] = free_port()
    command = [sys.executable, "-m", "services", "doctor", "--config", str(patient.file())]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=ROOT, check=False)
    assert done.returncode == 1, done.stderr
    assert "mend: systemctl start mosquitto" in done.stdout
    assert not [one for one in patient.told["bus"]["accounts"].values() if one in done.stdout + done.stderr]


def test_a_mend_by_a_command_of_ours_is_for_the_same_configuration(tmp_path: Path) -> None:
    config = tmp_path / "apartment.yaml"
    config.write_text("bus: {accounts: {operator: '${BUS_OPERATOR_PASSWORD}'}}\n")
    command = [sys.executable, "-m", "services", "doctor", "--config", str(config)]
    nothing = {**os.environ, "APARTMENT_SECRETS": str(tmp_path / "none.yaml")}
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=ROOT, env=nothing, check=False)
    assert "mend: apartment secrets init\n" in done.stdout, done.stderr
    assert f"each `apartment ...` with --config {config}" in done.stdout
