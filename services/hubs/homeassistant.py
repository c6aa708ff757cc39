"""Home Assistant's MQTT discovery for the home's items on the bus: which entity each is, with the bus' topics. Pure.

The keys are those of Home Assistant's MQTT integration. States keep OpenHAB's forms; templates take units off, and
`None` is what an unknown state becomes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from services import __version__, topics
from services.apartment.home import Home, Item
from services.states import base_type

Fields = dict[str, Any]
KNOWN = "value not in ('NULL', 'UNDEF')"
PLAIN = f"{{{{ value if {KNOWN} else 'None' }}}}"
WORDS = f"{{{{ value if {KNOWN} else 'unknown' }}}}"  # of a sensor that is no number, `None` would be a word too
EMPTY = f"{{{{ value if {KNOWN} else '' }}}}"
NUMBER = f"{{{{ value.split(' ')[0] if {KNOWN} else 'None' }}}}"
LIT = "{{ 'ON' if value == 'ON' or value.split(',')[-1] | float(0) > 0 else 'OFF' }}"
BRIGHTNESS = "{{ value.split(',')[-1] | float(0) | round | int }}"
HUE = "{{ value.split(',')[:2] | join(',') if value.count(',') == 2 else '0,0' }}"
FULL = "{{ hue | round | int }},{{ sat | round | int }},100"
CLASSES = {"Temperature": "temperature", "Power": "power", "Energy": "energy", "Pressure": "pressure",
           "Illuminance": "illuminance"}  # fmt: skip
CONTACTS = {"door": "door", "window": "window"}
WIDEST = {"min": -1_000_000, "max": 1_000_000}  # of a number whose range nobody said
COMMANDS = ("PLAY", "PAUSE", "NEXT", "PREVIOUS", "REWIND", "FASTFORWARD")


def entities(home: Home, home_service: str) -> dict[tuple[str, str], str]:
    """Every entity by platform and item, as Home Assistant is told it; `home_service` says whether it can be used."""
    status = topics.SERVICE_STATUS.name(service=home_service)
    found = {}
    for name, item in home.ros_items.items():
        platform, own = _entity(item)
        if platform:
            topics_ = _topics(platform, name, own)
            shared = {"unique_id": f"apartment_home_{name}", "name": item.label or name, "availability_topic": status}
            content = {**shared, **own, **topics_, "device": _device(home, name), "origin": _origin()}
            found[platform, name] = json.dumps(content, ensure_ascii=False)
    return found


def _topics(platform: str, name: str, own: Fields) -> Fields:
    """Where the state is and where commands go, under the platform's names for that."""
    state, command = topics.HOME_STATE.name(item=name), topics.HOME_COMMAND.name(item=name)
    found = {"state_topic": state, "command_topic": command}
    if platform in ("sensor", "binary_sensor"):
        del found["command_topic"]
    if platform == "cover":
        found |= {"position_topic": state, "set_position_topic": command}
        del found["state_topic"]
    if "brightness_scale" in own:
        found |= {"brightness_state_topic": state, "brightness_command_topic": command}
    if "hs_value_template" in own:
        found |= {"hs_state_topic": state, "hs_command_topic": command}
    return found


def _entity(item: Item) -> tuple[str, Fields]:
    """The platform of an item and what is special to it; an empty platform for what has none there."""
    kind = base_type(item.type)
    if kind == "Contact":
        return "binary_sensor", {"payload_on": "OPEN", "payload_off": "CLOSED",
                                 "device_class": CONTACTS.get(item.icon or "", "opening")}  # fmt: skip
    if kind == "Switch" and item.only_told:
        return "binary_sensor", {"device_class": "motion"} if item.icon == "motion" else {}
    if kind in ("Image", "Call", "Location"):
        return "", {}
    if not item.takes_commands or kind == "DateTime":
        return "sensor", _measured(item)
    return WRITABLE[kind](item)


def _measured(item: Item) -> Fields:
    if base_type(item.type) != "Number":
        return {"value_template": WORDS}
    dimension = item.type.partition(":")[2]
    found: Fields = {"value_template": NUMBER, "state_class": "measurement"}
    if item.unit:
        found["unit_of_measurement"] = item.unit
    device_class = "humidity" if item.icon == "humidity" and item.unit == "%" else CLASSES.get(dimension)
    return {**found, **({"device_class": device_class} if device_class and item.unit else {})}


def _switch(item: Item) -> tuple[str, Fields]:
    return "light" if item.icon == "light" else "switch", {"payload_on": "ON", "payload_off": "OFF"}


def _dimmer(item: Item) -> tuple[str, Fields]:
    if item.icon != "light":
        return "number", {"min": 0, "max": 100, "value_template": NUMBER, "unit_of_measurement": "%"}
    return "light", _bright()


def _bright() -> Fields:
    return {
        "payload_on": "ON",
        "payload_off": "OFF",
        "state_value_template": LIT,
        "brightness_scale": 100,
        "brightness_value_template": BRIGHTNESS,
        "on_command_type": "brightness",
    }


def _color(_: Item) -> tuple[str, Fields]:
    """Choosing a colour makes it bright: a colour of OpenHAB's has a brightness, Home Assistant's has none."""
    return "light", {**_bright(), "hs_value_template": HUE, "hs_command_template": FULL}


def _cover(_: Item) -> tuple[str, Fields]:
    return "cover", {
        "payload_open": "UP",
        "payload_close": "DOWN",
        "payload_stop": "STOP",
        "position_open": 0,
        "position_closed": 100,
        "position_template": NUMBER,
    }


def _number(item: Item) -> tuple[str, Fields]:
    found: Fields = {**WIDEST, "mode": "box", "value_template": NUMBER}
    if item.range is not None:
        found |= {"min": item.range.min, "max": item.range.max, "step": item.range.step or 1}
    if item.unit:
        found["unit_of_measurement"] = item.unit
    return "number", found


def _text(item: Item) -> tuple[str, Fields]:
    if not item.options:
        return "text", {"value_template": EMPTY}
    words = {state: shown or state for state, shown in item.options.items()}
    if len(set(words.values())) < len(words):
        words = {state: state for state in words}
    return "select", {
        "options": list(words.values()),
        "value_template": _looked_up(words),
        "command_template": _looked_up({shown: state for state, shown in words.items()}),
    }


def _looked_up(words: Mapping[str, str]) -> str:
    return f"{{{{ {json.dumps(words)}.get(value, 'None') }}}}"


def _player(_: Item) -> tuple[str, Fields]:
    return "select", {"options": list(COMMANDS), "value_template": PLAIN}


WRITABLE: dict[str, Callable[[Item], tuple[str, Fields]]] = {
    "Switch": _switch,
    "Dimmer": _dimmer,
    "Color": _color,
    "Rollershutter": _cover,
    "Number": _number,
    "String": _text,
    "Player": _player,
}


def _device(home: Home, name: str) -> Fields:
    """The device that an item is part of; those without one belong to the home."""
    key = home.items[name].thing
    room = home.room_of(name)
    area = {"suggested_area": home.rooms[room].label} if room is not None else {}
    if key is None:
        return {"identifiers": ["apartment_home"], "name": "Apartment"}
    return {"identifiers": [f"apartment_thing_{key}"], "name": home.things[key].label or key, **area}


def _origin() -> Fields:
    return {"name": "smart-apartment", "sw_version": __version__}
