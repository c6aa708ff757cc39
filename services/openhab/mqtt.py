"""Plain MQTT devices of the home as generic topic things, and the bus without rules: two channels per item. Pure.

Without rules OpenHAB cannot say states of contacts, calls, players and pictures: the binding never publishes them. For
players and calls it has no channel at all: OpenHAB takes PLAY for no text, and drops it on a channel of texts.
"""

from __future__ import annotations

from collections.abc import Iterator

from services import topics
from services.apartment.forms import TOPIC_SETTINGS
from services.apartment.home import Home, Item
from services.openhab.lines import ChannelLine, Metadata, Setting, ThingLine
from services.openhab.site import BUS, Site
from services.openhab.versions import Version
from services.openhab.words import THING_WORDS
from services.states import base_type

CHANNEL_TYPES = {
    "Switch": "switch",
    "Contact": "contact",
    "Number": "number",
    "String": "string",
    "Dimmer": "dimmer",
    "Rollershutter": "rollershutter",
    "Color": "color",
    "DateTime": "datetime",
    "Location": "location",
    "Image": "image",
}
COLOR_MODES = ("colorMode", "color_mode")  # the second is 2.x's word
SILENT = ("Contact", "Call", "Image")  # what the binding never publishes


def is_mqtt(home: Home, item: Item) -> bool:
    """Whether we write the channel that the item is linked to."""
    return item.mqtt is not None and item.thing is not None and home.things[item.thing].kind == "mqtt"


def device_uid(site: Site, key: str) -> str:
    """The thing of a plain MQTT device."""
    return f"mqtt:topic:{site.broker.id}:{site.names.devices[key]}"


def channel_uid(site: Site, name: str, item: Item) -> str:
    """The channel of an item of such a device."""
    return f"{device_uid(site, str(item.thing))}:{channel_id(name)}"


def channel_id(name: str) -> str:
    """An item's name as the id of a channel."""
    return f"{name}-item" if name in THING_WORDS else name


def devices(site: Site) -> Iterator[ThingLine]:
    """A generic topic thing for each plain MQTT device that has topics."""
    for key, thing in site.home.things.items():
        own = {name: item for name, item in site.home.items.items() if item.thing == key and is_mqtt(site.home, item)}
        if not own:
            continue
        available: dict[str, Setting] = {}
        if thing.mqtt is not None:
            available["availabilityTopic"] = thing.mqtt.availability
            available["payloadAvailable"] = thing.mqtt.online
            available["payloadNotAvailable"] = thing.mqtt.offline
        channels = tuple(_channel(site.version, name, item) for name, item in own.items())
        uid = device_uid(site, key)
        yield ThingLine(uid, thing.label or None, bridge=site.broker.uid, settings=available, channels=channels)


def _channel(version: Version, name: str, item: Item) -> ChannelLine:
    assert item.mqtt is not None
    kind = CHANNEL_TYPES[base_type(item.type)]
    said = item.mqtt
    named = {setting: getattr(said, field) for field, setting in TOPIC_SETTINGS.items()}
    if kind in ("contact", "image"):
        del named["commandTopic"]
    own: dict[str, Setting | None] = {**named, "unit": item.unit if kind == "number" else None, **said.settings}
    if kind == "color":
        modes = [own.pop(key) for key in COLOR_MODES if key in own]
        own[COLOR_MODES[version.major == 2]] = modes[0] if modes else "HSB"
    settings = {key: value for key, value in own.items() if value is not None}
    return ChannelLine("Type", kind, channel_id(name), None, settings)


def bus_thing(site: Site) -> ThingLine:
    """The bus without rules: what comes as a command goes to the item, what the item says goes out, kept."""
    channels: list[ChannelLine] = []
    for name, item in site.home.ros_items.items():
        kind = CHANNEL_TYPES.get(base_type(item.type))
        if kind is None:
            continue
        state: dict[str, Setting] = {"stateTopic": topics.HOME_SET.name(item=name)}
        if kind == "color":
            state["color_mode" if site.version.major == 2 else "colorMode"] = "HSB"
        if base_type(item.type) not in SILENT:
            both = {**state, "stateTopic": topics.HOME_COMMAND.name(item=name), "postCommand": True,
                    "commandTopic": topics.HOME_STATE.name(item=name), "retained": True, "qos": 1}  # fmt: skip
            channels.append(ChannelLine("Type", kind, channel_id(name), None, both))
        if base_type(item.type) != "Image":
            channels.append(ChannelLine("Type", kind, f"{name}-set", None, state))
    uid = f"mqtt:topic:{site.broker.id}:{BUS}"
    return ThingLine(uid, "Event bus", bridge=site.broker.uid, channels=tuple(channels))


def link_uids(site: Site, name: str, item: Item) -> Iterator[Metadata]:
    """The two links of an item to the bus without rules."""
    uid = f"mqtt:topic:{site.broker.id}:{BUS}"
    if base_type(item.type) not in CHANNEL_TYPES:
        return
    if base_type(item.type) not in SILENT:
        yield Metadata("channel", f"{uid}:{channel_id(name)}", {"profile": "follow"})
    if base_type(item.type) != "Image":
        yield Metadata("channel", f"{uid}:{name}-set")
