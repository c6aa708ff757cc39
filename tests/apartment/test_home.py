"""The model of the home, and the example that comes with the project."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from services.apartment.home import Home, Item, Range
from services.simulators.devices import first_state
from services.states import check_state

EXAMPLE = Path(__file__).parents[2] / "config" / "home.yaml"


@pytest.fixture(scope="module")
def example() -> Home:
    return Home.model_validate(yaml.safe_load(EXAMPLE.read_text(encoding="utf-8")))


ON_MQTT = {"things": {"a": {"label": "A", "kind": "mqtt"}}}
TOPICS = {"state": "dev/a", "command": "dev/a/set"}


def home(**changes: Any) -> Home:
    """A home of one lamp, with changes."""
    lamp = {"type": "Switch", "label": "Lamp", "thing": "lamp", "groups": ["gLights"]}
    data: dict[str, Any] = {
        "rooms": {"hall": {"label": "Hall"}},
        "things": {"lamp": {"label": "Lamp", "room": "hall"}},
        "groups": {"gLights": "Lights"},
        "items": {"Lamp": lamp},
    }
    return Home.model_validate(data | changes)


def item(**fields: Any) -> dict[str, Any]:
    """One item of a configuration."""
    return {"type": "Switch", "label": "x", **fields}


def test_the_example_has_no_faults(example: Home) -> None:
    assert list(example.faults()) == []


def test_the_example_has_what_the_report_and_the_robot_need(example: Home) -> None:
    wanted = {
        "Kitchen_Light": "Switch",
        "Hall_Dimmer": "Dimmer",
        "Front_Door": "Contact",
        "Front_Door_LastOpened": "DateTime",
        "Hall_Motion": "Switch",
        "Lab_Temp": "Number:Temperature",
        "Bedroom_Shutter": "Rollershutter",
        "Lamp_Color": "Color",
        "ROS_Status": "String",
    }
    assert {name: example.items[name].type for name in wanted} == wanted
    assert set(example.rooms) == {"kitchen", "living_room", "bedroom", "bathroom", "hall"}
    assert any(not one.ros for one in example.items.values())
    assert {"everyChange", "restoreOnStartup", "everyUpdate"} <= {
        s for one in example.items.values() for s in one.persist
    }
    assert any(one.persist == () for one in example.items.values())


def test_every_thing_and_group_of_the_example_is_used(example: Home) -> None:
    assert {one.thing for one in example.items.values()} - {None} == set(example.things)
    assert {group for one in example.items.values() for group in one.groups} == set(example.groups)


def test_every_device_of_the_example_begins_with_a_state_of_its_type(example: Home) -> None:
    for one in example.items.values():
        check_state(one.type, first_state(one))


def test_a_home_without_faults_has_none() -> None:
    assert list(home().faults()) == []


@pytest.mark.parametrize(
    ("changes", "where", "what"),
    [
        ({"things": {"lamp": {"label": "x", "room": "cellar"}}}, ("things", "lamp", "room"), "cellar"),
        ({"items": {"A": item(thing="toaster")}}, ("items", "A", "thing"), "toaster"),
        ({"items": {"A": item(room="attic")}}, ("items", "A", "room"), "attic"),
        ({"items": {"A": item(groups=["gLights", "gNone"])}}, ("items", "A", "groups"), "gNone"),
        ({"items": {"A": item(mqtt={"state": "a"})}}, ("items", "A", "mqtt"), "got none"),
        ({"items": {"A": item(thing="lamp", mqtt={"state": "a"})}}, ("items", "A", "mqtt"), "'lamp' of kind zwave"),
        ({"things": {"lamp": {"label": "x", "mqtt": {"availability": "a"}}}}, ("things", "lamp", "mqtt"), "got zwave"),
        (ON_MQTT | {"items": {"A": item(type="Player", thing="a", mqtt=TOPICS)}}, ("items", "A", "mqtt"), "a Player"),
        (ON_MQTT | {"items": {"A": item(type="Call", thing="a", mqtt=TOPICS)}}, ("items", "A", "mqtt"), "a Call"),
        ({"items": {"1A": item()}}, ("items", "1A"), "digit"),
        ({"items": {"A-B": item()}}, ("items", "A-B"), "digit"),
        ({"items": {"A\n": item()}}, ("items", "A\n"), "digit"),
        ({"items": {"gLights": item()}}, ("items", "gLights"), "no group has"),
        ({"items": {"ROS": item()}}, ("items", "ROS"), "no group has"),
        ({"groups": {"gLights": "x", "g Lights": "y"}}, ("groups", "g Lights"), "digit"),
    ],
)
def test_what_refers_to_nothing_is_told_with_its_place(
    changes: dict[str, Any], where: tuple[str, ...], what: str
) -> None:
    faults = list(home(**changes).faults())
    assert [place for place, _ in faults] == [where]
    assert what in faults[0][1]


MQTT = {"lamp": {"label": "Lamp", "kind": "mqtt"}}  # things


@pytest.mark.parametrize(
    ("changes", "where", "what"),
    [
        ({"items": {"A": item(type="Number:Powr")}}, ("items", "A", "type"), "'Powr'"),
        ({"items": {"A": item(type="Switch:Foo")}}, ("items", "A", "type"), "Switch alone"),
        ({"items": {"A": item(type="Number:Temperature:AVG")}}, ("items", "A", "type"), "Number:<dimension>"),
        ({"groups": {"gLights": {"label": "x", "type": "Swich"}}}, ("groups", "gLights"), "'Swich'"),
        ({"groups": {"gLights": {"label": "x", "function": "OR"}}}, ("groups", "gLights"), "type of the members"),
        ({"groups": {"gLights": {"label": "x", "type": "Switch", "function": "OR"}}}, ("groups", "gLights"), "2 argum"),
        ({"groups": {"gLights": {"label": "x", "metadata": {"my ns": {}}}}},
         ("groups", "gLights", "metadata", "my ns"), "'my ns'"),
        ({"things": MQTT, "items": {"A": item(thing="lamp", mqtt={})}}, ("items", "A", "mqtt"), "neither"),
        ({"things": MQTT, "items": {"A": item(thing="lamp", mqtt={"command": "dev/+/set"})}},
         ("items", "A", "mqtt", "command"), "dev/+/set"),
        ({"things": MQTT, "items": {"A": item(thing="lamp", mqtt={"state": "dev/#/x"})}},
         ("items", "A", "mqtt", "state"), "dev/#/x"),
        ({"things": MQTT, "items": {"A": item(thing="lamp", mqtt={"state": "a\nuser b"})}},
         ("items", "A", "mqtt", "state"), "one line"),
        ({"things": MQTT, "items": {"A": item(thing="lamp", mqtt={"state": "a", "settings": {"stateTopic": "b"}})}},
         ("items", "A", "mqtt", "settings", "stateTopic"), "expected state beside"),
        ({"things": MQTT, "items": {"A": item(thing="lamp", mqtt={"state": "a", "settings": {"a b": 1}})}},
         ("items", "A", "mqtt", "settings"), "'a b'"),
        ({"things": MQTT, "items": {"A": item(thing="lamp", mqtt={"state": "a",
                                                                  "settings": {"stopCommandTopic": "b\nuser c"}})}},
         ("items", "A", "mqtt", "settings", "stopCommandTopic"), "expected a topic"),
        ({"things": {"lamp": {**MQTT["lamp"], "mqtt": {"availability": "a+"}}}},
         ("things", "lamp", "mqtt", "availability"), "'a+'"),
        ({"items": {"A": item(channels={"not a uid": {}})}}, ("items", "A", "channels", "not a uid"), "UID"),
        ({"items": {"A": item(channels={"a:b:c:d": {"a b": 1}})}}, ("items", "A", "channels", "a:b:c:d"), "'a b'"),
        ({"items": {"A": item(metadata={"my ns": {}})}}, ("items", "A", "metadata", "my ns"), "'my ns'"),
        ({"items": {"A": item(metadata={"ns": {"settings": {"a b": 1}}})}}, ("items", "A", "metadata", "ns"), "'a b'"),
        ({"items": {"A": item(alexa={"settings": {"a b": 1}})}}, ("items", "A", "alexa", "settings"), "'a b'"),
        ({"items": {"A": item(persist=["restoreOnStartup"])}}, ("items", "A", "persist"), "beside restoreOnStartup"),
        ({"items": {"A": item(expire="soon")}}, ("items", "A", "expire"), "'soon'"),
    ],
)  # fmt: skip
def test_what_openhab_would_not_read_is_told_with_its_place(
    changes: dict[str, Any], where: tuple[str, ...], what: str
) -> None:
    ((place, text),) = home(**changes).faults()
    assert place == where
    assert what in text


def test_all_faults_are_told_at_once() -> None:
    items = {"A": item(thing="x", room="y", groups=["z"]), "2": item(thing="w")}
    assert [place for place, _ in home(items=items).faults()] == [
        ("items", "A", "thing"),
        ("items", "A", "room"),
        ("items", "A", "groups"),
        ("items", "2"),
        ("items", "2", "thing"),
    ]


def test_ros_is_a_group_that_is_always_there() -> None:
    assert list(home(items={"A": item(groups=["ROS"])}).faults()) == []


@pytest.mark.parametrize(
    "changes",
    [
        {"items": {"A": item(type="Toaster")}},
        {"items": {"A": item(colour="red")}},
        {"items": {"A": item(range={"min": 5, "max": 5})}},
        {"items": {"A": item(range={"min": 0, "max": 5, "step": 0})}},
        {"items": {"A": item(range={"min": float("nan"), "max": 5})}},
        {"timezone": "Atlantis/City"},
        {"timezone": "../etc/passwd"},
        {"rooms": {"hall": {}}},
    ],
)
def test_what_cannot_be_used_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        home(**changes)


def test_an_item_is_in_its_own_room_or_in_its_things() -> None:
    rooms = {"hall": {"label": "Hall"}, "attic": {"label": "Attic"}}
    items = {"A": item(thing="lamp"), "B": item(thing="lamp", room="attic"), "C": item()}
    one = home(rooms=rooms, items=items)
    assert [one.room_of(name) for name in "ABC"] == ["hall", "attic", None]


@pytest.mark.parametrize(
    ("fields", "takes"),
    [
        ({}, True),
        ({"read_only": True}, False),
        ({"type": "Contact"}, False),
        ({"type": "Image"}, False),
        ({"type": "Number:Power"}, True),
        ({"mqtt": {"state": "dev/lamp"}}, False),
        ({"mqtt": {"state": "dev/lamp", "command": "dev/lamp/set"}}, True),
        ({"mqtt": {"state": "dev/lamp"}, "channels": {"zwave:device:c:switch": {}}}, True),
    ],
)
def test_who_takes_commands(fields: dict[str, Any], takes: bool) -> None:
    assert Item.model_validate(item(**fields)).takes_commands is takes


def test_members_of_ros_are_those_that_say_so(example: Home) -> None:
    assert "Kitchen_Light" in example.ros_items
    assert "Outdoor_Temp" not in example.ros_items


def test_a_range_keeps_its_step() -> None:
    assert Range(min=5, max=30, step=0.5).step == 0.5
