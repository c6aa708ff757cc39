"""A home of what stands in OpenHAB's files: items, groups, things, what is stored. Pure.

From files of ours it gives the very home that they were made of; from a lab's own, a beginning: rooms and devices are
known by their semantic tags and by the things that items are linked to. Not here: reading files (`folder.py`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from services.apartment.home import GROUP_ROS, NAME, Group, Home, Item
from services.openhab import importing_things, readback, semantics
from services.openhab.check import read_site
from services.openhab.check.across import Site as Read
from services.openhab.check.findings import Finding
from services.openhab.lines import ItemLine
from services.openhab.persist import strategies_of
from services.openhab.readback import data_of, item_of, metadata_of, role_of, split_label
from services.openhab.site import ALL
from services.openhab.versions import Version, parse
from services.states import ITEM_TYPES, base_type

NEWEST_FIRST = ("5", "4", "3", "2.5")
LOCATIONS = {*semantics.ROOM_WORDS.values(), "Room", "Location", "Indoor", "Outdoor", "Floor", "GroundFloor",
             "FirstFloor", "SecondFloor", "Apartment", "House", "Building", "Porch", "Driveway", "Carport", "Pool",
             "Patio", "GuestRoom", "FamilyRoom", "Veranda", "Shed", "Zone"}  # fmt: skip
EQUIPMENT = {*semantics.EQUIPMENT_ICONS.values(), "Equipment", "Camera", "FrontDoor", "LightStripe", "Lock", "Fan",
             "Battery", "Boiler", "SmokeDetector", "Siren", "Speaker", "Television", "Screen", "Valve", "WallSwitch",
             "WhiteGood", "WashingMachine", "Dishwasher", "Dryer", "Oven", "Refrigerator", "Freezer",
             "RadiatorControl", "WeatherService", "CleaningRobot", "Inverter", "Pump", "NetworkAppliance"}  # fmt: skip


def best_version(texts: Mapping[str, str]) -> Version:
    """The newest release whose grammars find the fewest faults."""
    versions = [parse(text) for text in NEWEST_FIRST]
    return min(versions, key=lambda version: sum(one.severity == "error" for one in read_site(texts, version)[1]))


def home_of(texts: Mapping[str, str], version: Version) -> tuple[Home, list[Finding]]:
    """The home, and what is wrong with the files: a file whose grammar is wrong gives nothing."""
    site, findings = read_site(texts, version)
    lines = [line for items, _ in site.items for line in items.lines if role_of(line) != "generated"]
    return _Import(site, lines).home(), findings


class _Import:
    """What is known while a home is put together."""

    def __init__(self, site: Read, lines: list[ItemLine]) -> None:
        self.site = site
        self.is_ours = any(role_of(line) == "home" for line in lines)
        self.groups = [line for line in lines if line.type.partition(":")[0] == "Group"]
        self.items = {line.name: line for line in lines if base_type(line.type) in ITEM_TYPES}
        self.rooms = {line.name: _key(line) for line in self.groups if _is(line, "room", LOCATIONS)}
        self.devices = {line.name: _key(line) for line in self.groups if _is(line, "thing", EQUIPMENT)}

    def home(self) -> Home:
        """The whole home."""
        found = {name: self.item(line) for name, line in self.items.items() if re.fullmatch(NAME, name)}
        things = {self.devices[line.name]: self.thing(line) for line in self.groups if line.name in self.devices}
        if not self.is_ours:
            things |= importing_things.assign(found, [one for own, _ in self.site.things for one in own])
        plain = {line.name: _group(line) for line in self.groups if self.is_plain(line)}
        wanted = {group for item in found.values() for group in item["groups"]} - {GROUP_ROS, *plain}
        return Home.model_validate(
            {
                **self.home_data(),
                "rooms": {self.rooms[line.name]: _room(line) for line in self.groups if line.name in self.rooms},
                "things": things,
                "groups": {**plain, **{name: name for name in sorted(wanted)}},
                "items": found,
            }
        )

    def home_data(self) -> dict[str, Any]:
        """What the note at the group of everything says of the home."""
        return next((data_of(line) for line in self.groups if role_of(line) == "home"), {})

    def is_plain(self, line: ItemLine) -> bool:
        """Whether a group is a group of the home, and neither a room nor a device nor one of the two we make."""
        if line.name in (*self.rooms, *self.devices) or not re.fullmatch(NAME, line.name):
            return False
        return line.name not in (ALL, GROUP_ROS) or role_of(line) == "group"

    def item(self, line: ItemLine) -> dict[str, Any]:
        """The fields of an item: of its line, of the persistence file, and of its note."""
        fields = item_of(line, self.rooms, self.devices)
        stored = strategies_of(line.name, line.groups, [one for one, _ in self.site.stored])
        if stored is not None:
            fields["persist"] = stored
        return {**fields, **{key: value for key, value in data_of(line).items() if key in Item.model_fields}}

    def thing(self, line: ItemLine) -> dict[str, Any]:
        """A device of the group that stands for it."""
        fields: dict[str, Any] = {"label": line.label or line.name}
        fields["room"] = next((self.rooms[one] for one in line.groups if one in self.rooms), None)
        if role_of(line) != "thing":
            fields["tag"] = next((tag for tag in line.tags if tag in EQUIPMENT), None)
            fields["alexa"] = readback.alexa_of(line)
        return {**fields, **data_of(line)}


def _is(line: ItemLine, role: str, tags: set[str]) -> bool:
    """Whether a group stands for a room or a device: its note says so, or without one its tags."""
    return role_of(line) == role or (metadata_of(line, readback.NOTE) is None and bool(tags & set(line.tags)))


def _key(line: ItemLine) -> str:
    noted = metadata_of(line, readback.NOTE)
    return str(noted.settings["key"]) if noted is not None and "key" in noted.settings else line.name


def _room(line: ItemLine) -> dict[str, Any]:
    tag = next((one for one in line.tags if one in LOCATIONS), None)
    own = {} if role_of(line) == "room" else {"tag": tag}
    return {"label": line.label or line.name, **own, **data_of(line)}


def _group(line: ItemLine) -> str | Group:
    """A group of the home: its label alone, where there is no more to say."""
    data = data_of(line)
    short = data.pop("short", False)
    if data:
        return str(data["label"]) if short else Group.model_validate(data)
    label, _ = split_label(line.label or line.name)
    if role_of(line) == "group":
        return label
    _, *rest = line.type.split(":")
    others = tuple(one for one in line.metadata if one.namespace != readback.NOTE)
    parents = tuple(one for one in line.groups if one != ALL)
    if not (rest or parents or line.icon or line.tags or others):
        return label
    kept = {one.namespace: readback.kept(one) for one in others}
    kind, function = _kind(rest)
    return Group(label=label, type=kind, function=function, arguments=line.arguments, groups=parents,
                 icon=line.icon, tags=line.tags, metadata=kept)  # fmt: skip


def _kind(rest: list[str]) -> tuple[str | None, str | None]:
    """The type of the members and the function, of `Number:Temperature:AVG` or `Switch:OR`."""
    if not rest:
        return None, None
    if rest[0] == "Number" and len(rest) > 1 and not rest[1].isupper():
        return f"Number:{rest[1]}", rest[2] if len(rest) > 2 else None
    return rest[0], rest[1] if len(rest) > 1 else None
