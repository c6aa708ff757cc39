"""A home made of a lab's own files."""

from __future__ import annotations

from services.apartment.home import Group
from services.openhab.check import check
from services.openhab.generate import files
from services.openhab.importing import best_version, home_of
from services.openhab.site import Site
from services.openhab.versions import parse

ITEMS = """
Group All
Group ROS (All)
Group gGround "Ground floor" (All) ["GroundFloor"]
Group Kitchen "Kitchen" (gGround) ["Kitchen"]
Group gLights "Lights [%d]" (All)
Group:Switch:OR(ON,OFF) gAny "Any light" <light> (gLights)
Switch Kitchen_Light "Kitchen light [%s]" <light> (Kitchen, gLights, ROS) {
  channel="zwave:device:ctrl:node2:switch_binary" }
Number:Temperature Lab_Temp "Lab [%.1f °C]" (ROS) {
  channel="zwave:device:ctrl:node3:sensor_temperature" [profile="offset", offset="1"] }
Number Lab_Humidity "Lab humidity [%.0f %%]" { channel="zwave:device:ctrl:node3:sensor_humidity" }
Switch Lamp "Lamp" { channel="mqtt:topic:lab:hall:lamp", alexa="Light" [name="Hall"] }
String Mode "Mode" { stateDescription=" " [options="a=As wanted,b=Better"], autoupdate="false", homekit="x" [y=1] }
"""
THINGS = """
Bridge mqtt:broker:lab [ host="192.0.2.1" ]
Thing mqtt:topic:lab:hall "Hall lamp" (mqtt:broker:lab) [ availabilityTopic="dev/hall/s", payloadAvailable="on" ] {
  Channels:
    Type switch : lamp [ stateTopic="dev/hall/lamp", commandTopic="dev/hall/lamp/set", on="1", off="0" ]
}
"""
STORED = """
Strategies {
  everyHour : "0 0 * * * ?"
}
Items {
  ROS* : strategy = everyChange, restoreOnStartup
  Lamp : strategy = everyUpdate, everyHour
}
"""
LAB = {"a.items": ITEMS, "a.things": THINGS, "jdbc.persist": STORED}


def test_a_lab_comes_with_rooms_devices_groups_and_what_is_stored() -> None:
    home, found = home_of(LAB, parse("5"))
    assert found == [one for one in found if one.severity == "warning"]
    assert list(home.faults()) == []
    assert home.rooms["Kitchen"].label == "Kitchen"
    light = home.items["Kitchen_Light"]
    assert (light.label, light.icon, light.ros, light.room) == ("Kitchen light", "light", True, "Kitchen")
    assert light.persist == ("everyChange", "restoreOnStartup")
    assert list(light.channels) == ["zwave:device:ctrl:node2:switch_binary"]
    assert home.items["Lab_Temp"].unit == "°C"
    assert home.items["Lab_Temp"].thing == home.items["Lab_Humidity"].thing
    assert home.items["Lab_Humidity"].persist == ()
    assert home.items["Mode"].options == {"a": "As wanted", "b": "Better"}
    assert home.items["Mode"].metadata["homekit"].settings == {"y": 1}
    assert home.groups["gAny"] == Group(
        label="Any light", type="Switch", function="OR", arguments=("ON", "OFF"), groups=("gLights",), icon="light"
    )


def test_a_generic_thing_becomes_a_plain_mqtt_device() -> None:
    home, _ = home_of(LAB, parse("5"))
    lamp = home.items["Lamp"]
    assert lamp.mqtt is not None
    assert (lamp.mqtt.state, lamp.mqtt.command, lamp.mqtt.on) == ("dev/hall/lamp", "dev/hall/lamp/set", "1")
    thing = home.things[str(lamp.thing)]
    assert thing.mqtt is not None
    assert (thing.label, thing.kind, thing.mqtt.online, thing.mqtt.offline) == ("Hall lamp", "mqtt", "on", "OFF")
    assert lamp.alexa is not None
    assert (lamp.alexa.name, lamp.alexa.device) == ("Hall", "Light")


def test_a_player_on_mqtt_keeps_its_link_which_is_told() -> None:
    things = THINGS.replace("switch", "string").replace(', on="1", off="0"', "")
    items = 'Player Lamp { channel="mqtt:topic:lab:hall:lamp" }'
    home, found = home_of({"a.items": items, "a.things": things}, parse("5"))
    assert [one.text for one in found] == ["expected an item that fits a string channel, got a Player"]
    assert list(home.faults()) == []
    assert list(home.items["Lamp"].channels) == ["mqtt:topic:lab:hall:lamp"]


def test_what_was_imported_can_be_generated_and_imported_again() -> None:
    home, _ = home_of(LAB, parse("5"))
    written = files(Site(home, parse("5")))
    assert [one for one in check(written, parse("5")) if one.severity == "error"] == []
    assert home_of(written, parse("5"))[0] == home


def test_the_release_whose_grammar_fits_best_is_taken() -> None:
    assert best_version(LAB) == parse("5")
    assert best_version({"a.items": 'Switch Color "x" <f7:house>'}) == parse("5")
    assert best_version({"a.items": 'Switch Lamp "x" <"light">'}).major in (2, 3)


def test_a_file_with_a_fault_gives_nothing_and_is_told() -> None:
    home, found = home_of({"a.items": "Switch A", "b.items": "Switch B {"}, parse("5"))
    assert list(home.items) == ["A"]
    assert [one.file for one in found] == ["b.items"]
