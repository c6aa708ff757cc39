"""The Alexa metadata of an item or a device, as the skill reads it, and the tags of its old version. Pure.

An item of a device that is one for Alexa carries an attribute; any other is a device of its own and carries a type.
Not here: what the skill knows, that is `skill.py`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from services.apartment.home import Alexa, Home, Item
from services.openhab.lines import Metadata, Setting
from services.openhab.skill import MODES, attributes_of
from services.states import base_type, plain

HEATING = {  # the skill's word -> words of thermostats for it
    "OFF": ("off", "0"),
    "HEAT": ("heat", "manual", "1"),
    "COOL": ("cool", "2"),
    "AUTO": ("auto", "automatic", "3"),
    "ECO": ("eco", "economy", "4"),
}
BY_TAG = {  # class of the semantic model -> device type
    "HVAC": "Thermostat",
    "Lightbulb": "Light",
    "Blinds": "Blind",
    "Receiver": "StreamingDevice",
    "MotionDetector": "MotionSensor",
    "PowerOutlet": "Outlet",
}
ATTRIBUTE_OF = {"Contact": "ContactDetectionState", "Player": "Playback", "Color": "Color"}
OLD = {"Light": "Lighting", "Switch": "Switchable", "Outlet": "Switchable", "Blind": "WindowCovering"}


def device(home: Home, name: str) -> str | None:
    """What the skill is to take an item for; None where it knows nothing like it."""
    item = home.items[name]
    if item.alexa is None:
        return None
    if item.alexa.device is not None:
        return item.alexa.device
    group = home.things[item.thing].alexa if item.thing else None
    return _attribute(item) if group is not None else _single(item)


def _single(item: Item) -> str | None:
    """The type of an item that is a device of its own."""
    kind, light = base_type(item.type), "light" in (item.icon or "")
    if kind == "Switch" and item.only_told:
        return "MotionSensor"
    if kind == "Dimmer" and item.icon == "soundvolume":
        return "Speaker"
    if kind in ("Switch", "Dimmer"):
        return "Light" if light else "Outlet" if item.icon == "poweroutlet" else "Switch"
    found = {"Color": "Light", "Contact": "ContactSensor", "Rollershutter": "Blind", "Player": "StreamingDevice"}
    if kind in found:
        return found[kind]
    if item.type == "Number:Temperature":
        return "TemperatureSensor" if item.only_told else "Other.TargetTemperature"
    if item.icon == "humidity" and kind == "Number":
        return "Other.CurrentHumidity"
    return _generic(item, "Other.")


def _attribute(item: Item) -> str | None:
    """The attribute that an item is of its device."""
    kind = base_type(item.type)
    if kind == "Switch":
        return "MotionDetectionState" if item.only_told else "PowerState"
    if kind == "Dimmer":
        return "VolumeLevel" if item.icon == "soundvolume" else "PowerState,Brightness"
    if kind == "Rollershutter":
        return "PositionState"
    if item.type == "Number:Temperature":
        return "CurrentTemperature" if item.only_told else "TargetTemperature"
    if item.icon == "humidity" and kind == "Number":
        return "CurrentHumidity"
    if kind == "String" and len(heating_modes(item.options)) > 1:
        return "HeatingCoolingMode"
    return ATTRIBUTE_OF.get(kind) or _generic(item, "")


def _generic(item: Item, prefix: str) -> str | None:
    if base_type(item.type) == "Number":
        return f"{prefix}RangeValue"
    if base_type(item.type) == "String" and len(modes(item.options)) >= MODES[0]:
        return f"{prefix}Mode"
    return None


def heating_modes(options: Mapping[str, str]) -> dict[str, str]:
    """The skill's words for a heating's states, and those states."""
    return {word: state for word, known in HEATING.items() for state in options if state.lower() in known}


def modes(options: Mapping[str, str]) -> list[str]:
    """`state=words` of those options that the skill's own commas and colons leave whole."""
    spoken = {state: _speakable(words) or _speakable(state) for state, words in options.items()}
    listed = [f"{state}={words}" for state, words in spoken.items() if words and _is_plain(state)]
    return listed[: MODES[1]]


def _is_plain(state: str) -> bool:
    return bool(state) and state == state.strip() and not re.search(r"[,=:]", state)


def _speakable(words: str) -> str:
    return " ".join(re.sub(r"[,=:@]", " ", words).split())


def metadata(home: Home, name: str) -> Metadata | None:
    """`alexa="..." [...]` of an item; None when Alexa is not to use it, or cannot."""
    item, found = home.items[name], device(home, name)
    if item.alexa is None or found is None:
        return None
    return Metadata("alexa", found, {**_named(item.alexa), **_settings(item, found), **item.alexa.settings})


def group_metadata(alexa: Alexa, device: str) -> Metadata:
    """The same for a device that is one for Alexa."""
    return Metadata("alexa", alexa.device or device, {**_named(alexa), **alexa.settings})


def _named(alexa: Alexa) -> dict[str, Setting]:
    return {"name": alexa.name} if alexa.name is not None else {}


def _settings(item: Item, found: str) -> dict[str, Setting]:
    """What the skill cannot know by itself."""
    words: dict[str, Setting] = {}
    attribute = found.rpartition(".")[2]
    if attribute == "Mode":
        words["supportedModes"] = ",".join(modes(item.options))
    if attribute == "HeatingCoolingMode":
        words |= heating_modes(item.options)
    if attribute in ("RangeValue", "TargetTemperature") and item.range is not None:
        low, high = plain(item.range.min), plain(item.range.max)
        if attribute == "RangeValue":
            words["supportedRange"] = f"{low}:{high}:{plain(item.range.step or 1.0)}"
        else:
            words["setpointRange"] = f"{low}:{high}"
    if attribute in ("RangeValue", "Mode") and item.only_told:
        words["nonControllable"] = True
    return words


def old_tags(found: str | None) -> tuple[str, ...]:
    """The tags of the skill's version 2 that say the same, for OpenHAB 2.x."""
    kind, _, attribute = (found or "").partition(",")[0].partition(".")
    if attribute in ("CurrentTemperature", "CurrentHumidity", "TargetTemperature"):
        return (attribute,)
    if kind in ("CurrentTemperature", "CurrentHumidity", "TargetTemperature", "Thermostat", "ContactSensor"):
        return (kind,)
    if kind in ("TemperatureSensor", "HeatingCoolingMode"):
        return ("CurrentTemperature",) if kind == "TemperatureSensor" else ("homekit:HeatingCoolingMode",)
    return (OLD[kind],) if kind in OLD and not attribute else ()


def thing_device(home: Home, key: str, tag: str) -> str:
    """The device type of a device that is one for Alexa, where it does not say it: one that all its items fit."""
    own = [name for name, item in home.items.items() if item.thing == key and item.alexa is not None]
    attributes = {one for name in own for one in (device(home, name) or "").split(",") if one}
    by_tag = (BY_TAG[tag],) if tag in BY_TAG else ()
    fitting = (one for one in (*by_tag, "Thermostat", "Light") if attributes <= set(attributes_of(one)))
    return next(fitting, "Other") if attributes else next(iter(by_tag), "Other")
