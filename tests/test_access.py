"""Who may do what at the broker, shown on a real mosquitto, and the generated files."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from services import access, topics
from services.apartment.home import Home
from services.bus import Message
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.client import Client
from services.config import home_in
from services.peers import mosquitto, program
from services.topics import page

ROOT = Path(__file__).parents[1]


def test_the_written_files_equal_what_the_code_generates() -> None:
    assert (ROOT / "bus_topics.md").read_text(encoding="utf-8") == page.markdown()
    home, _ = home_in(ROOT / "config/home.yaml")
    assert (ROOT / "mosquitto/acl").read_text(encoding="utf-8") == access.acl(["ip1"], home)


def test_every_role_of_the_table_has_an_account() -> None:
    known = {*access.accounts(["ip1"]), "camera-<cam>", "<service>"}
    for row in topics.TABLE:
        assert {*row.writers, *row.readers} <= known, row.pattern


@pytest.mark.parametrize(
    ("state", "command", "granted"),
    [
        ("dev/lamp", "dev/lamp/set", {"dev/lamp", "dev/lamp/set"}),
        ("dev/+/lamp", None, {"dev/+/lamp"}),
        ("dev/lamp", "dev/lamp", {"dev/lamp"}),
        ("camera/ip1/position", "camera/ip1/order/Goto", set()),
        ("home/Lamp/state", "home/Lamp/command", set()),
        ("+/ip1/position", "service/bridge/reload/set", set()),
        ("#", None, set()),
        ("$SYS/broker/uptime", "dev/lamp/set", {"dev/lamp/set"}),
    ],
)
def test_no_topic_of_the_table_is_opened_for_a_plain_device(state: str, command: str | None, granted: set[str]) -> None:
    lamp = {"type": "Switch", "label": "x", "thing": "lamp", "mqtt": {"state": state, "command": command}}
    thing = {"label": "x", "kind": "mqtt"}
    home = Home.model_validate({"things": {"lamp": thing}, "items": {"Lamp": lamp}})

    def lists(home: Home | None) -> dict[str, set[str]]:
        blocks = [part.splitlines() for part in access.acl(["ip1"], home).split("\nuser ")[1:]]
        return {name: {line.split(" ", 2)[2] for line in lines if line} for name, *lines in blocks}

    before, after = lists(None), lists(home)
    assert after["devices"] == granted
    assert {name for name in after if after[name] != before[name]} == ({"openhab", "devices"} if granted else set())
    assert after["openhab"] - before["openhab"] == granted


def test_a_shutter_may_hear_its_stop_on_a_topic_of_its_own() -> None:
    topics = {"state": "dev/s", "command": "dev/s/set", "settings": {"stopCommandTopic": "dev/s/stop"}}
    shutter = {"type": "Rollershutter", "label": "x", "thing": "s", "mqtt": topics}
    home = Home.model_validate({"things": {"s": {"label": "x", "kind": "mqtt"}}, "items": {"Shutter": shutter}})
    own = {part.partition("\n")[0]: part for part in access.acl([], home).split("\nuser ")}
    assert "\ntopic write dev/s/stop\n" in own["openhab"]
    assert "\ntopic read dev/s/stop\n" in own["devices"]


@pytest.mark.mosquitto
def test_our_password_lines_are_those_of_mosquitto_passwd(tmp_path: Path) -> None:
    tool = program("mosquitto_passwd", "mosquitto")
    plain = tmp_path / "theirs"
    plain.write_text("bridge:invented\n")
    subprocess.run([tool, "-U", str(plain)], check=True, timeout=30)
    theirs, ours = plain.read_text().split("$"), access.password_line("bridge", "invented").split("$")
    assert ours[:3] == theirs[:3]
    assert [len(part) for part in ours] == [len(part.rstrip("\n")) for part in theirs]


def test_the_command_line_writes_both_files_from_the_accounts_of_the_configuration(tmp_path: Path) -> None:
    files = ["--acl", str(tmp_path / "acl"), "--passwords", str(tmp_path / "passwords")]
    words = [sys.executable, "-m", "services", "topics", *files, "--config", "config/simulated.yaml"]
    environment = {**os.environ, "BUS_BRIDGE_PASSWORD": "invented", "BUS_OPERATOR_PASSWORD": "invented too"}
    subprocess.run(words, env=environment, cwd=ROOT, check=True, timeout=60)
    assert (tmp_path / "acl").read_text() == (ROOT / "mosquitto/acl").read_text()
    lines = (tmp_path / "passwords").read_text().splitlines()
    assert sorted(line.partition(":")[0] for line in lines) == ["bridge", "operator"]
    assert "invented" not in "".join(lines)
    assert (tmp_path / "passwords").stat().st_mode & 0o777 == 0o600


@pytest.mark.mosquitto
def test_a_service_can_say_what_is_its_own_and_nothing_else(tmp_path: Path) -> None:
    said = {
        "camera-ip1": ("camera/ip1/scan/result", "camera/ip2/scan/result", "home/Lamp/state", "service/bridge/status"),
        "bridge": ("home/Lamp/command", "home/Lamp/state", "camera/ip1/scan/result", "service/bridge/info"),
        "openhab": ("home/Lamp/state", "home/Lamp/command", "camera/ip1/position"),
    }
    allowed = {"camera/ip1/scan/result", "home/Lamp/command", "service/bridge/info", "home/Lamp/state"}
    with mosquitto.private(tmp_path, cameras=["ip1", "ip2"]) as broker:
        ear = _client(broker, "operator")
        ear.subscribe("camera/#", "home/#", "service/bridge/#")
        for account, texts in said.items():
            mouth = _client(broker, account)
            for topic in texts:
                mouth.say(topic, f"{account} {topic}")
            mouth.say("service/" + account + "/status", "done")
            mouth.bus.close()
        ear.say("home/Lamp/command", "last")
        ear.until(lambda m: m.payload == b"last")
        heard = {m.payload.decode() for m in ear.seen}
        ear.bus.close()
    assert "openhab home/Lamp/state" in heard
    assert "bridge home/Lamp/command" in heard
    assert "camera-ip1 camera/ip1/scan/result" in heard
    for text in heard:
        account, _, topic = text.partition(" ")
        assert not topic or topic in allowed, text
        assert (account, topic) not in {("bridge", "home/Lamp/state"), ("openhab", "home/Lamp/command")}


@pytest.mark.mosquitto
def test_who_has_no_account_is_refused(tmp_path: Path) -> None:
    with mosquitto.private(tmp_path) as broker:
        stranger = MqttBus(Address("stranger", port=broker.port))
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            stranger.publish(Message("home/Lamp/command", b"ON"))
            stranger.receive(0.05)
            assert not stranger.connected
        stranger.close()


def _client(broker: mosquitto.Broker, account: str) -> Client:
    bus = MqttBus(Address(f"{account}-test", port=broker.port, user=account, password=broker.passwords[account]))
    end = time.monotonic() + 5.0
    while not bus.connected:
        assert time.monotonic() < end, f"{account} is not let in"
        bus.receive(0.02)
    return Client(bus)
