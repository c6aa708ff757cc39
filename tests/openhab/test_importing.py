"""A home made of a lab's own files."""

from __future__ import annotations

from services.apartment.home import Group
from services.openhab.check import check, read_site
from services.openhab.generate import files
from services.openhab.importing import best_version, home_of
from services.openhab.lines import Setting, ThingLine
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
  Mode : strategy = everyHour, restoreOnStartup
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
    assert home.items["Mode"].persist == ("everyChange", "restoreOnStartup")
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


PLAIN_ITEMS = """
Dimmer Dim "Dim" { channel="mqtt:topic:lab:plain:dim" }
Color Led "Led" { channel="mqtt:topic:lab:plain:led" }
Number:Temperature Heat "Heat [%.1f °C]" { channel="mqtt:topic:lab:plain:heat" }
Rollershutter Blind "Blind" { channel="mqtt:topic:lab:plain:blind" }
Switch Plug "Plug" { channel="mqtt:topic:lab:plain:plug" }
String Text "Text" { channel="mqtt:topic:lab:plain:text" }
Switch Lit "Lit" { channel="mqtt:topic:lab:plain:dim" }
Switch Far "Far" { channel="mqtt:topic:lab:odd:far" }
"""
PLAIN = {
    "dim": ("dimmer", 'stateTopic="d/dim", commandTopic="d/dim/set", min=0, max=254'),
    "led": ("color", 'stateTopic="d/led", commandTopic="d/led/set", colorMode="RGB"'),
    "heat": ("number", 'stateTopic="d/heat", transformationPattern="JSONPATH:$.t", unit="°F"'),
    "blind": ("rollershutter", 'stateTopic="d/b", commandTopic="d/b/set", stopCommandTopic="d/b/stop", invert=true'),
    "plug": ("switch", 'commandTopic="d/plug/set", on=1, off=0, formatBeforePublish="<%s>", retained=true, qos=2'),
    "text": ("string", 'stateTopic="d/text", transformationPattern="REGEX:(.*)", "MAP:a.map"'),
}
PLAIN_THINGS = (
    'Bridge mqtt:broker:lab [ host="192.0.2.1" ]\n'
    'Thing mqtt:topic:lab:plain "Plain" (mqtt:broker:lab) [ availabilityTopic="d/s", payloadAvailable=true ] {\n'
    "  Channels:\n" + "".join(f"    Type {kind} : {id} [ {said} ]\n" for id, (kind, said) in PLAIN.items()) + "}\n"
    'Thing mqtt:topic:lab:odd "Odd" (mqtt:broker:lab) [ availabilityTopic="d/t", transformationPattern="MAP:t" ] {\n'
    "  Channels:\n"
    '    Type switch : far [ stateTopic="d/far" ]\n'
    "}\n"
)


def test_an_imported_channel_is_generated_with_the_settings_that_it_had() -> None:
    lab = {"a.items": PLAIN_ITEMS, "a.things": PLAIN_THINGS}
    home, found = home_of(lab, parse("5"))
    assert found == []
    assert list(home.faults()) == []
    written = files(Site(home, parse("5")))
    (before, _), (after, _) = (read_site(texts, parse("5"))[0].things[0] for texts in (lab, written))

    def channels(things: tuple[ThingLine, ...]) -> dict[str, tuple[str, dict[str, Setting]]]:
        return {one.id.lower(): (one.type, dict(one.settings)) for thing in things for one in thing.channels}

    wanted = {id: one for id, one in channels(before).items() if id in PLAIN}
    wanted["plug"][1].update({"on": "1", "off": "0"})
    wanted["text"][1]["transformationPattern"] = "REGEX:(.*)∩MAP:a.map"
    assert {id: one for id, one in channels(after).items() if id in PLAIN} == wanted
    (device,) = (thing for thing in after if thing.uid.startswith("mqtt:topic:"))
    assert device.settings["payloadAvailable"] == "true"
    assert home_of(written, parse("5"))[0] == home


def test_what_a_home_could_not_say_of_a_channel_stays_a_link() -> None:
    home, _ = home_of({"a.items": PLAIN_ITEMS, "a.things": PLAIN_THINGS}, parse("5"))
    for name, uid in (("Lit", "mqtt:topic:lab:plain:dim"), ("Far", "mqtt:topic:lab:odd:far")):
        assert (home.items[name].mqtt, list(home.items[name].channels)) == (None, [uid])


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
