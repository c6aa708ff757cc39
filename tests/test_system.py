"""The whole apartment on real parts: mosquitto, MariaDB, ROS, one process per service; met only from outside.

What is done to it here is what people and accidents do: public clients, kill -9, a broker restart, and rubbish.
"""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from services import peers, persistence
from services.client import Client, connected
from services.config import BusSettings
from services.simulated import Parts, Simulated, parts_of, services_of
from services.simulators.world import load as load_world
from services.storage import open_storage
from services.supervisor import Supervisor, in_background
from tests import trials
from tests.trials import BUS_SERVICES

pytestmark = [pytest.mark.mosquitto, pytest.mark.mariadb, pytest.mark.ros]
TARGET = 582
KEPT = (  # who takes commands, and one of them
    ("camera-ip1", "camera/ip1/order/Flip", "ON"),
    ("simulated-home", "home/Bedroom_Mode/command", "eco"),
    ("history", "history/get", '{"id": "kept", "what": "last"}'),
    ("mission", "mission/tiago/where", '{"id": "kept", "marker": 582}'),
    ("bridge", "robot/tiago/goto", '{"id": "kept", "point": "Sofa"}'),
)


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Parts]:
    with parts_of(tmp_path_factory.mktemp("parts"), real=True) as parts:
        missing = [text for _, _, text in parts.used if text]
        if missing:
            pytest.skip("; ".join(missing))
        yield parts


@pytest.fixture(scope="module")
def flat(parts: Parts, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulated]:
    with services_of(tmp_path_factory.mktemp("flat"), parts) as running:
        yield running


@pytest.fixture
def bus(flat: Simulated) -> Iterator[Client]:
    with connected(flat.apartment.bus, ["#"]) as client:
        yield client


@pytest.fixture
def shell(parts: Parts, tmp_path: Path) -> Iterator[Shell]:
    made = Shell(parts, tmp_path)
    yield made
    made.close()


class Shell:
    """A person with the public clients."""

    def __init__(self, parts: Parts, folder: Path) -> None:
        self.parts, self.folder = parts, folder
        assert parts.ros is not None
        self.environment = {**os.environ, **parts.ros.env, "PYTHONUNBUFFERED": "1"}
        self.listening: list[subprocess.Popen[bytes]] = []

    def mosquitto_pub(self, *arguments: str) -> None:
        self._run(peers.program("mosquitto_pub", "mosquitto-clients"), "-p", str(self.parts.broker_port), *arguments)

    def rostopic_pub(self, topic: str, kind: str, yaml: str) -> None:
        self._run(peers.program("rostopic", "python3-rostopic"), "pub", "-1", topic, kind, yaml)

    def rostopic_echo(self, topic: str) -> Heard:
        return self._listen(peers.program("rostopic", "python3-rostopic"), "echo", topic)

    def mosquitto_sub(self, *arguments: str) -> Heard:
        command = peers.program("mosquitto_sub", "mosquitto-clients")
        return self._listen(command, "-p", str(self.parts.broker_port), "-v", *arguments)

    def sql(self, query: str) -> str:
        """What `mariadb` prints for the reader's account; the password goes by the environment."""
        server = self.parts.database
        assert server is not None
        environment = {**os.environ, "MYSQL_PWD": server.reader_password}
        command = [
            peers.program("mariadb", "mariadb-client"),
            "-h",
            server.host,
            "-P",
            str(server.port),
            "-u",
            server.reader,
        ]
        done = subprocess.run([*command, "-N", "-B", "-e", query, server.view_database], env=environment, timeout=30,
                              capture_output=True, text=True, check=True)  # fmt: skip
        return done.stdout.strip()

    def close(self) -> None:
        for process in self.listening:
            peers.end(process)

    def _run(self, *command: str) -> None:
        subprocess.run(command, env=self.environment, check=True, timeout=60, capture_output=True)

    def _listen(self, *command: str) -> Heard:
        file = self.folder / f"heard-{len(self.listening)}"
        with file.open("wb") as output:
            process = subprocess.Popen(command, env=self.environment, stdout=output, start_new_session=True)
        self.listening.append(process)
        return Heard(file)


class Heard:
    """The growing output of a listening client."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def until(self, pattern: str, timeout_s: float = 20.0) -> re.Match[str]:
        """Waits until the output matches; what came until then is in the failure."""
        found: re.Match[str] | None = None

        def matches() -> bool:
            nonlocal found
            found = re.search(pattern, self.file.read_text(errors="replace"))
            return found is not None

        try:
            peers.wait_until(matches, f"output like {pattern!r}", timeout_s)
        except TimeoutError as error:
            raise AssertionError(f"{error}; it was:\n{self.file.read_text(errors='replace')[-3000:]}") from error
        assert found is not None
        return found


def eventually(what: Callable[[], Any], timeout_s: float = 15.0) -> Any:
    found: list[Any] = []

    def ready() -> bool:
        found[:] = [what()]
        return bool(found[0])

    peers.wait_until(ready, "what was expected", timeout_s)
    return found[0]


def test_a_home_state_reaches_the_robot_and_the_database(flat: Simulated, shell: Shell) -> None:
    robot = shell.rostopic_echo("/iot_updates")
    robot.until(r'key: "?ROS_Status')  # the snapshot that every new subscriber gets
    shell.mosquitto_pub("-t", "home/Kitchen_Light/state", "-m", "OFF", "-r")
    robot.until(r'key: "Kitchen_Light"\nvalue: "OFF"')
    shell.mosquitto_pub("-t", "home/Kitchen_Light/state", "-m", "ON", "-r")
    robot.until(r'key: "Kitchen_Light"\nvalue: "OFF"(.|\n)*key: "Kitchen_Light"\nvalue: "ON"')
    number = eventually(lambda: shell.sql("SELECT ItemId FROM Items WHERE ItemName='Kitchen_Light'"))
    eventually(lambda: shell.sql(f"SELECT Value FROM Item{number} ORDER BY Time DESC LIMIT 2").split() == ["ON", "OFF"])


def test_a_command_of_the_robot_is_carried_out_by_the_home(flat: Simulated, shell: Shell, bus: Client) -> None:
    bus.say("home/Kitchen_Light/command", "ON")
    bus.payload("home/Kitchen_Light/state", lambda text: text == "ON")
    house = shell.mosquitto_sub("-t", "home/Kitchen_Light/#")
    house.until(r"home/Kitchen_Light/state ON")
    shell.rostopic_pub("/iot_command", "diagnostic_msgs/KeyValue", '{key: "Kitchen_Light", value: "OFF"}')
    house.until(r"home/Kitchen_Light/command OFF\n(.|\n)*home/Kitchen_Light/state OFF")


def test_a_command_that_is_said_to_be_kept_is_refused_and_counted_by_who_is_there(
    flat: Simulated, shell: Shell, bus: Client
) -> None:
    bad = {service: trials.counters(bus, service, 0)["bad"] for service, _, _ in KEPT}
    bus.forget()
    for _, topic, payload in KEPT:
        shell.mosquitto_pub("-r", "-t", topic, "-m", payload)
        shell.mosquitto_pub("-r", "-t", topic, "-n")  # taken away again: that is no command either
    for service, topic, _ in KEPT:
        assert trials.counters(bus, service, bad[service] + 2)["bad"] == bad[service] + 2, topic
    told = [m for m in bus.seen if re.search("reply|result|Bedroom_Mode/state", m.topic)]
    answers = {topic: [json.loads(m.payload) for m in told if m.topic == topic] for topic in {m.topic for m in told}}
    assert set(answers) == {"camera/ip1/order_result", "history/reply/kept"}
    assert {(end["key"], end["state"]) for end in answers["camera/ip1/order_result"]} == {("Flip", "refused")}
    assert all("retained" in answer[0]["error"] for answer in answers.values())
    assert answers["history/reply/kept"][0]["samples"] == []


def test_a_scan_finds_the_marker_where_it_really_is_and_everyone_learns_it(flat: Simulated, shell: Shell) -> None:
    truth = next(marker for marker in load_world(flat.config.with_name("world.yaml")).markers if marker.id == TARGET)
    place, point = (
        shell.rostopic_echo("/ip_camera_scan/result/place"),
        shell.rostopic_echo("/ip_camera_scan/result/position"),
    )
    house = shell.mosquitto_sub("-t", "camera/ip1/scan/#", "-t", "camera/ip1/order_result", "-t", "camera/ip1/status")
    house.until(r'camera/ip1/status \{"state":"online"')
    shell.mosquitto_pub("-t", "camera/ip1/order/Scan", "-m", "ON")
    result = json.loads(house.until(r"camera/ip1/scan/result (\{.*\})", 180.0)[1])
    assert (result["marker"], result["place"], result["frame"]) == (TARGET, truth.place, "apartment")
    found = [result["position"][axis] for axis in "xyz"]
    assert math.dist(found, truth.position) <= 0.10
    house.until(r'"key":"Scan".*"state":"done"', 60.0)
    place.until(rf'key: "{TARGET}"\nvalue: "{truth.place}"')
    said = point.until(r"x: (\S+)\ny: (\S+)\nz: (\S+)")
    assert [float(number) for number in said.groups()] == pytest.approx(found, abs=1e-6)
    row = eventually(lambda: _sighting(flat, result["scan"]))
    assert (row.marker, row.place) == (TARGET, truth.place)
    assert [row.x, row.y, row.z] == pytest.approx(found, abs=1e-6)


def _sighting(flat: Simulated, scan: str) -> Any:
    config = flat.apartment.instances["persistence"].config
    assert isinstance(config, persistence.Config)
    with closing(open_storage(config.address)) as storage:
        return next((row for row in storage.sightings(TARGET, limit=10) if row.scan == scan), None)


@pytest.mark.parametrize("name", BUS_SERVICES)
def test_a_killed_service_is_back_within_three_seconds_and_nobody_else_notices(flat: Simulated, name: str) -> None:
    assert trials.kill(flat, name) < 3.0


def test_after_the_camera_was_away_orders_are_carried_out_again(flat: Simulated) -> None:
    trials.kill_camera(flat)


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_after_a_restart_of_the_broker_every_service_works_again_within_two_seconds(
    flat: Simulated, how: signal.Signals
) -> None:
    assert trials.restart_broker(flat, how) < 2.0


def test_ten_thousand_messages_of_rubbish_stop_nobody_and_are_counted(flat: Simulated) -> None:
    bad = trials.rubbish(flat, 10_000, seed=1)
    assert all(count > 0 for count in bad.values()), bad


def test_a_message_that_crashes_a_service_is_put_aside_and_the_service_goes_on(parts: Parts, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.crashing", str(parts.broker_port), str(tmp_path)]
    filters = ["home/Quotient/set", "service/operator/+"]
    with (
        in_background(Supervisor({"operator": command})),
        connected(BusSettings(port=parts.broker_port), filters) as bus,
    ):
        bus.say("home/Divisor/state", "4")
        bus.payload("home/Quotient/set", lambda text: text == "25")
        bus.say("home/Divisor/state", "0", retain=True)  # it comes again at every start
        bus.payload("service/operator/status", lambda text: text == "offline")
        info = bus.payload("service/operator/info", lambda info: info.counters.get("aside") == 1, 20.0)
        bus.say("home/Divisor/state", "8")
        bus.payload("home/Quotient/set", lambda text: text == "12.5")
        bus.say("home/Divisor/state", "", retain=True)
    file = tmp_path / "operator" / "aside" / info.aside[0]
    record = json.loads(file.read_text())
    assert (record["topic"], record["crashes"]) == ("home/Divisor/state", 2)
    assert "ZeroDivisionError" in record["traceback"]


def test_sigterm_ends_every_process_within_five_seconds(tmp_path: Path) -> None:
    with parts_of(tmp_path / "parts", real=False) as parts:
        with services_of(tmp_path / "services", parts) as running:
            processes = [child.process for child in running.supervisor.children.values() if child.process]
            asked = time.monotonic()
        assert time.monotonic() - asked < 5.0
    assert [process.poll() for process in processes] == [0] * len(processes)
