"""The model of the home: rooms, things and items, as `config/home.yaml` describes them.

Everything that concerns an item comes from here: topics, persistence, bridge, simulators, OpenHAB's files.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Literal
from zoneinfo import ZoneInfo

from pydantic import Field, field_validator, model_validator

from services.apartment import forms
from services.section import Section
from services.states import ITEM_TYPES, base_type

NAME = r"[A-Za-z_][A-Za-z0-9_]*"
NOT_A_NAME = "expected a name of letters, digits and _ that does not begin with a digit"
NO_MQTT = ("Player", "Call")  # OpenHAB's MQTT binding has no channel whose states and commands are theirs
GROUP_ROS = "ROS"  # the group whose members go to the robot, as in the report
Strategy = Literal["everyChange", "everyUpdate", "restoreOnStartup"]  # when a state is stored, in OpenHAB's words
Value = bool | int | float | str  # of a setting in OpenHAB's files
Fault = tuple[tuple[str, ...], str]  # where (keys from the top of the file), and what is wrong


class Range(Section):
    """What a number may be, in the item's unit."""

    min: float
    max: float
    step: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def is_a_range(self) -> Range:
        if self.min >= self.max:
            raise ValueError(f"expected min below max, got {self.min} and {self.max}")
        return self


class Alexa(Section):
    """That Alexa may use it. What is not said follows from the item: `alexa: {}` is enough."""

    name: str | None = None  # what people call it; None: its label
    device: str | None = None  # the skill's words, such as `Light` or `Thermostat.TargetTemperature`
    settings: dict[str, Value] = Field(default={})  # parameters of the skill


class Metadata(Section):
    """Any other metadata of OpenHAB, as it is there: a value, and settings."""

    value: str = ""
    settings: dict[str, Value] = Field(default={})


class Room(Section):
    """A room; its walls are in `world.yaml`, its name here is what people read."""

    label: str
    tag: str | None = None  # the class in OpenHAB's semantic model, such as LivingRoom; None: Room


class MqttDevice(Section):
    """Where a plain MQTT device says that it is there, and in which words; OpenHAB's own are ON and OFF."""

    availability: str
    online: str = "ON"
    offline: str = "OFF"


class Thing(Section):
    """A device; its items are what can be seen and steered of it."""

    label: str
    room: str | None = None
    kind: Literal["zwave", "mqtt", "virtual"] = "zwave"
    tag: str | None = None  # the class in OpenHAB's semantic model, such as Lightbulb; None: Equipment
    alexa: Alexa | None = None  # one device for Alexa, of all its items that she may use
    mqtt: MqttDevice | None = None


class Group(Section):
    """A group of OpenHAB; with a type it has a state, of its members by `function` (such as OR of ON and OFF)."""

    label: str
    type: str | None = None
    function: str | None = None
    arguments: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    icon: str | None = None
    tags: tuple[str, ...] = ()
    metadata: dict[str, Metadata] = Field(default={})


class MqttTopics(Section):
    """The topics of an item whose thing is a plain MQTT device, and how its payloads read."""

    state: str | None = None
    command: str | None = None  # None: it takes no commands
    transform: str | None = None  # such as `JSONPATH:$.t`; of what comes
    transform_out: str | None = None  # of commands
    on: str | None = None  # the device's words for ON or OPEN or UP, and the others
    off: str | None = None
    stop: str | None = None
    settings: dict[str, Value] = Field(default={})  # any other of the binding's channel, such as `min` or `colorMode`


class Item(Section):
    """One item of OpenHAB. `unit` is OpenHAB's symbol, `range` is in that unit.

    An item without a thing is OpenHAB's own: it holds what it is given. Without a room it is outside, or nowhere.
    """

    type: str
    label: str
    thing: str | None = None
    room: str | None = None
    groups: tuple[str, ...] = ()
    unit: str | None = None
    icon: str | None = None
    range: Range | None = None
    options: dict[str, str] = Field(default={})  # state -> what people read
    read_only: bool = False
    autoupdate: bool = True  # OpenHAB takes a command for the new state at once; else only the device's report counts
    ros: bool = True  # member of group ROS: on the robot's topics
    persist: tuple[Strategy, ...] = ("everyChange", "restoreOnStartup")  # empty: never stored
    channels: dict[str, dict[str, Value]] = Field(default={})  # OpenHAB's channels, each with settings such as profile
    mqtt: MqttTopics | None = None
    alexa: Alexa | None = None  # None: not for Alexa
    ga: str | None = None  # Google Assistant's device type
    expire: str | None = None  # such as `15m,UNDEF`: what OpenHAB makes of a state that nobody renews
    tags: tuple[str, ...] | None = None  # of OpenHAB's semantic model; None: what follows from the item
    metadata: dict[str, Metadata] = Field(default={})

    @field_validator("type")
    @classmethod
    def is_an_item_type(cls, text: str) -> str:
        if base_type(text) not in ITEM_TYPES:
            raise ValueError(f"expected one of {', '.join(ITEM_TYPES)} (or Number:<dimension>), got {text!r}")
        return text

    @property
    def only_told(self) -> bool:
        """Whether its state is all there is: it says so, or its device is given no topic of commands."""
        return self.read_only or (self.mqtt is not None and self.mqtt.command is None and not self.channels)

    @property
    def takes_commands(self) -> bool:
        """Whether a robot may command it at all."""
        return not self.only_told and base_type(self.type) not in ("Contact", "Call", "Image")


class Home(Section):
    """The whole home; names are OpenHAB item names and so the topics' `<item>`."""

    timezone: str = "UTC"  # of the IANA database, such as Europe/Madrid: the clock on the wall
    rooms: dict[str, Room] = Field(default={})
    things: dict[str, Thing] = Field(default={})
    groups: dict[str, str | Group] = Field(default={})  # name -> label, or more
    items: dict[str, Item]

    @field_validator("timezone")
    @classmethod
    def is_a_timezone(cls, text: str) -> str:
        try:
            ZoneInfo(text)
        except (KeyError, ValueError, OSError) as error:
            raise ValueError(f"expected a time zone such as Europe/Madrid, got {text!r}") from error
        return text

    @property
    def zone(self) -> ZoneInfo:
        """The time zone of the wall clock."""
        return ZoneInfo(self.timezone)

    def faults(self) -> Iterator[Fault]:
        """What refers to nothing, and what OpenHAB's files cannot say: where, and what is wrong."""
        for name, thing in self.things.items():
            if thing.room is not None and thing.room not in self.rooms:
                yield ("things", name, "room"), f"expected one of the rooms, got {thing.room!r}"
            if thing.mqtt is not None:
                if thing.kind != "mqtt":
                    yield ("things", name, "mqtt"), f"expected kind: mqtt beside it, got {thing.kind}"
                yield from _told(("things", name, "mqtt", "availability"), forms.mqtt_filter(thing.mqtt.availability))
            yield from _settings_faults(("things", name), thing.alexa, {})
        for name, group in self.groups.items():
            yield from self._group_faults(name, group if isinstance(group, Group) else Group(label=group))
        for name, item in self.items.items():
            yield from self._item_faults(name, item)
            yield from _form_faults(("items", name), item)

    def _group_faults(self, name: str, group: Group) -> Iterator[Fault]:
        if not re.fullmatch(NAME, name):
            yield ("groups", name), NOT_A_NAME
        for parent in group.groups:
            if parent not in self.groups and parent != GROUP_ROS:
                yield ("groups", name, "groups"), f"expected one of the groups, got {parent!r}"
        parts = [*(group.type.split(":") if group.type else []), *([group.function] if group.function else [])]
        yield from _told(("groups", name), forms.group_state(parts, len(group.arguments)))
        yield from _settings_faults(("groups", name), None, group.metadata)

    def _item_faults(self, name: str, item: Item) -> Iterator[Fault]:
        if not re.fullmatch(NAME, name):
            yield ("items", name), NOT_A_NAME
        if name in self.groups or name == GROUP_ROS:
            yield ("items", name), "expected a name that no group has"
        if item.thing is not None and item.thing not in self.things:
            yield ("items", name, "thing"), f"expected one of the things, got {item.thing!r}"
        if item.room is not None and item.room not in self.rooms:
            yield ("items", name, "room"), f"expected one of the rooms, got {item.room!r}"
        if item.mqtt is not None and base_type(item.type) in NO_MQTT:
            yield ("items", name, "mqtt"), f"expected none for a {item.type}, OpenHAB has no MQTT channel for it"
        for group in item.groups:
            if group not in self.groups and group != GROUP_ROS:
                yield ("items", name, "groups"), f"expected one of the groups, got {group!r}"
        device = self.things.get(item.thing or "")
        if item.mqtt is not None and (device is None or device.kind != "mqtt"):
            what = "none" if device is None else f"{item.thing!r} of kind {device.kind}"
            yield ("items", name, "mqtt"), f"expected a thing of kind mqtt for it, got {what}"

    @cached_property
    def ros_items(self) -> dict[str, Item]:
        """The members of group ROS."""
        return {name: item for name, item in self.items.items() if item.ros}

    def named(self, words: str) -> list[str] | None:
        """The items that `Name`, `Group*` (its members) or `*` (all) means; None when the home has no such one."""
        if words == "*":
            return list(self.items)
        if not words.endswith("*"):
            return [words] if words in self.items else None
        group = words[:-1]
        if group == GROUP_ROS:
            return list(self.ros_items)
        if group not in self.groups:
            return None
        return [name for name, item in self.items.items() if group in item.groups]

    def room_of(self, name: str) -> str | None:
        """The room of an item: its own, else its thing's."""
        item = self.items[name]
        if item.room is not None or item.thing is None:
            return item.room
        return self.things[item.thing].room


def _form_faults(place: tuple[str, ...], item: Item) -> Iterator[Fault]:
    """What of an item OpenHAB would not read."""
    yield from _told((*place, "type"), forms.item_type(item.type))
    if item.mqtt is not None:
        yield from _topic_faults((*place, "mqtt"), item.mqtt)
    for uid, settings in item.channels.items():
        yield from _told((*place, "channels", uid), forms.channel(uid), *map(forms.key, settings))
    if set(item.persist) == {"restoreOnStartup"}:
        yield (*place, "persist"), "expected everyChange or everyUpdate beside restoreOnStartup, which stores nothing"
    if item.expire is not None:
        yield from _told((*place, "expire"), forms.expire(item.expire))
    yield from _settings_faults(place, item.alexa, item.metadata)


def _topic_faults(place: tuple[str, ...], said: MqttTopics) -> Iterator[Fault]:
    if said.state is None and said.command is None:
        yield place, "expected a state or a command, got neither"
    if said.state is not None:
        yield from _told((*place, "state"), forms.mqtt_filter(said.state))
    if said.command is not None:
        yield from _told((*place, "command"), forms.mqtt_topic(said.command))
    if forms.STOP_TOPIC in said.settings:
        stop = (*place, "settings", forms.STOP_TOPIC)
        yield from _told(stop, forms.mqtt_topic(str(said.settings[forms.STOP_TOPIC])))
    yield from _told((*place, "settings"), *map(forms.key, said.settings))
    for field, setting in forms.TOPIC_SETTINGS.items():
        if setting in said.settings:
            yield (*place, "settings", setting), f"expected {field} beside settings, got {setting!r}"


def _settings_faults(place: tuple[str, ...], alexa: Alexa | None, others: dict[str, Metadata]) -> Iterator[Fault]:
    if alexa is not None:
        yield from _told((*place, "alexa", "settings"), *map(forms.key, alexa.settings))
    for namespace, one in others.items():
        yield from _told((*place, "metadata", namespace), forms.key(namespace), *map(forms.key, one.settings))


def _told(place: tuple[str, ...], *found: str | None) -> Iterable[Fault]:
    return ((place, text) for text in found if text is not None)
