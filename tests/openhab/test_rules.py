"""The rules of the bus: the generated JavaScript in Node on a real broker, and OpenHAB's own language beside it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import pytest

from services import peers
from services.client import Client, connected
from services.config import BusSettings
from services.openhab.check.findings import Findings
from services.openhab.check.rules import read
from services.openhab.generate import files
from services.openhab.site import Site
from services.openhab.things import SEPARATOR
from services.openhab.versions import parse
from services.peers import mosquitto
from tests.openhab.homes import shipped
from tests.openhab.stand_in import StandIn, running

ITEMS: dict[str, dict[str, Any]] = {
    "ROS": {"type": "Group", "state": "NULL", "groups": [], "autoupdate": True},
    "Lamp": {"type": "Switch", "state": "OFF", "groups": ["ROS"], "autoupdate": True},
    "Text": {"type": "String", "state": "NULL", "groups": ["ROS"], "autoupdate": True},
    "Plug": {"type": "Switch", "state": "OFF", "groups": ["ROS"], "autoupdate": False},
    "Door": {"type": "Contact", "state": "CLOSED", "groups": ["ROS"], "autoupdate": True},
    "Temp": {"type": "Number:Temperature", "state": "21.5 °C", "groups": ["ROS"], "autoupdate": True},
    "Still": {"type": "Image", "state": "raw type (image/jpeg): 12 bytes", "groups": ["ROS"], "autoupdate": True},
    "Secret": {"type": "Switch", "state": "OFF", "groups": [], "autoupdate": True},
}
STATES = {name: one["state"] for name, one in ITEMS.items() if "ROS" in one["groups"] and one["type"] != "Image"}
LIMIT_S = 60.0
pytestmark = [pytest.mark.mosquitto, pytest.mark.node]


def script_runs(folder: Path, port: int, series: str = "5") -> AbstractContextManager[StandIn]:
    """The generated script, unchanged, with a binding on that port."""
    written = files(Site(shipped(), parse(series), bus="js"))
    script = folder / "apartment.js"
    script.write_text(written["automation/js/apartment.js"], encoding="utf-8")
    return running(script, written["things/apartment.things"], port, ITEMS, SEPARATOR)


def settled(openhab: StandIn) -> None:
    """Waits until it is connected and has done what follows."""
    assert openhab.online.wait(LIMIT_S)
    openhab.settle()


@pytest.fixture
def openhab(tmp_path: Path, mosquitto_broker: mosquitto.Broker) -> Iterator[StandIn]:
    """The rules, connected."""
    try:
        with script_runs(tmp_path, mosquitto_broker.port) as stand_in:
            settled(stand_in)
            yield stand_in
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.fixture
def bus(mosquitto_broker: mosquitto.Broker) -> Iterator[Client]:
    """Somebody else on the bus, who hears everything of the home."""
    with connected(BusSettings(port=mosquitto_broker.port), ("home/#",), timeout_s=LIMIT_S) as client:
        yield client


def state(bus: Client, item: str, wanted: str) -> None:
    """Waits for a state of an item."""
    bus.until(
        lambda one: (one.topic, one.payload.decode()) == (f"home/{item}/state", wanted), LIMIT_S, f"{item} {wanted}"
    )


def published(openhab: StandIn, item: str) -> list[str]:
    """Every state of an item that was said."""
    return [line["value"] for line in openhab.lines("publish") if line["publish"] == f"home/{item}/state"]


def test_a_connection_says_all_states_kept(openhab: StandIn, bus: Client) -> None:
    for item, text in STATES.items():
        state(bus, item, text)
    assert all(line["retained"] for line in openhab.lines("publish"))
    assert published(openhab, "Still") == published(openhab, "Secret") == []


def test_before_the_birth_message_the_rules_say_that_it_is_there_after_all_states(
    tmp_path: Path, mosquitto_broker: mosquitto.Broker, bus: Client
) -> None:
    bus.subscribe("service/openhab/status")
    try:
        with script_runs(tmp_path, mosquitto_broker.port, "3") as openhab:
            settled(openhab)
            bus.until(lambda one: (one.topic, one.payload) == ("service/openhab/status", b"online"), LIMIT_S, "online")
            *states, last = openhab.lines("publish")
    except peers.Missing as missing:
        pytest.skip(str(missing))
    assert last == {"publish": "service/openhab/status", "value": "online", "retained": True}
    assert {line["publish"] for line in states} == {f"home/{item}/state" for item in STATES}


def test_a_change_of_a_member_is_said_and_of_another_is_not(openhab: StandIn, bus: Client) -> None:
    for item, text in (
        ("Secret", "ON"),
        ("Still", "raw type (image/jpeg): 13 bytes"),
        ("Temp", "22 °C"),
        ("Door", "OPEN"),
    ):
        openhab.tell(kind="update", item=item, value=text)
    openhab.settle()
    state(bus, "Temp", "22 °C")
    state(bus, "Door", "OPEN")
    assert published(openhab, "Secret") == published(openhab, "Still") == []


def test_a_command_reaches_the_item_once_and_its_state_comes_back_once(openhab: StandIn, bus: Client) -> None:
    bus.say("home/Lamp/command", "ON")
    state(bus, "Lamp", "ON")
    bus.say("home/Text/command", "fence")
    state(bus, "Text", "fence")
    openhab.settle()
    assert [line for line in openhab.lines("command") if line["command"] == "Lamp"] == [
        {"command": "Lamp", "value": "ON"}
    ]
    assert published(openhab, "Lamp") == ["OFF", "ON"]


def test_an_update_is_no_command(openhab: StandIn, bus: Client) -> None:
    bus.say("home/Door/set", "OPEN")
    state(bus, "Door", "OPEN")
    assert openhab.lines("command") == []


def test_a_payload_may_have_the_separator_and_every_sign(openhab: StandIn, bus: Client) -> None:
    text = 'a#b/c # "Küche" \\ {}'
    bus.say("home/Text/command", text)
    state(bus, "Text", text)


def test_a_device_that_confirms_itself_is_said_when_it_did(openhab: StandIn, bus: Client) -> None:
    bus.say("home/Plug/command", "ON")
    peers.wait_until(lambda: {"command": "Plug", "value": "ON"} in openhab.said, "the command", LIMIT_S)
    openhab.settle()
    assert published(openhab, "Plug") == ["OFF"]
    openhab.tell(kind="update", item="Plug", value="ON")
    state(bus, "Plug", "ON")


@pytest.mark.parametrize(
    ("item", "why"),
    [
        ("Secret", "not a member of ROS"),
        ("Nobody", "not a member of ROS"),
        ("Door", "takes no commands"),
        ("ROS", "not a member"),
    ],
)
def test_who_is_no_member_or_takes_no_commands_is_refused(openhab: StandIn, bus: Client, item: str, why: str) -> None:
    bus.say(f"home/{item}/command", "ON")
    peers.wait_until(lambda: bool(openhab.lines("warn")), "a warning", LIMIT_S)
    assert f"{why}" in openhab.lines("warn")[0]["warn"]
    assert item in openhab.lines("warn")[0]["warn"]
    assert openhab.lines("command") == openhab.lines("update") == []


def test_a_broker_that_forgot_everything_is_told_all_states_again(tmp_path: Path) -> None:
    port = peers.free_port()
    with ExitStack() as stack:
        try:
            with mosquitto.private(tmp_path / "one", anonymous=True, port=port):
                openhab = stack.enter_context(script_runs(tmp_path, port))
                settled(openhab)
        except peers.Missing as missing:
            pytest.skip(str(missing))
        peers.wait_until(lambda: not openhab.online.is_set(), "the loss", LIMIT_S)
        openhab.tell(kind="update", item="Lamp", value="ON")
        openhab.settle()
        assert published(openhab, "Lamp") == ["OFF"]
        stack.enter_context(mosquitto.private(tmp_path / "two", anonymous=True, port=port))
        bus = stack.enter_context(connected(BusSettings(port=port), ("home/#",), timeout_s=LIMIT_S))
        for item, text in {**STATES, "Lamp": "ON"}.items():
            state(bus, item, text)


@pytest.mark.parametrize(("series", "count"), [("2.5", 1), ("3", 1), ("4", 0), ("5", 0)])
def test_its_own_language_says_that_it_is_there_where_the_binding_does_not(series: str, count: int) -> None:
    written = files(Site(shipped(), parse(series), bus="dsl"))
    said = 'bus.publishMQTT("service/openhab/status", "online", true)'
    assert written["rules/apartment.rules"].count(said) == count
    assert ('birthTopic="service/openhab/status"' in written["things/apartment.things"]) == (count == 0)


def spoken(trigger: dict[str, Any]) -> str:
    """A trigger of a script in the words of OpenHAB's own language."""
    kind = trigger["kind"]
    if kind == "changed":
        return f"Member of {trigger['group']} changed"
    if kind == "startlevel":
        return f"System reached start level {trigger['level']}"
    if kind == "thing":
        return f'Thing "{trigger["thing"]}" changed to {trigger["status"]}'
    return f'Channel "{trigger["channel"]}" triggered'


def test_both_languages_wait_for_the_same_events(openhab: StandIn) -> None:
    findings = Findings("apartment.rules")
    rules = read(files(Site(shipped(), parse("5"), bus="dsl"))["rules/apartment.rules"], parse("5"), findings)
    assert findings.found == []
    scripts = openhab.lines("rule")
    assert rules.names == tuple(line["rule"] for line in scripts)
    assert rules.triggers == tuple(spoken(trigger) for line in scripts for trigger in line["triggers"])
