"""The home's items file: groups, rooms, devices and items with their metadata. Pure.

Not here: a camera's items, those are in `cameras.py`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from services.apartment.home import GROUP_ROS, Group, Home, Item
from services.apartment.home import Metadata as Kept
from services.openhab import alexa, semantics
from services.openhab.lines import ItemLine, Metadata, label
from services.openhab.mqtt import channel_uid, is_mqtt, link_uids
from services.openhab.readback import generated, item_of, lost, note, split_label
from services.openhab.site import ALL, STATUS_ITEM, Site
from services.openhab.state_description import of_item
from services.openhab.words import ITEM_WORDS

ICON = re.compile(r"[a-z0-9_][a-z0-9_-]*")
SET_ICON = re.compile(r"[a-z0-9]+:([a-z0-9]+:)?[a-z0-9_][a-z0-9_-]*")  # of another collection, from 4.0 on
OLD_DAYS = re.compile(r"([0-9]+)d(,.*)?")


def lines(site: Site) -> list[ItemLine]:
    """Every item of the home's file."""
    return [*_groups(site), *_rooms(site), *_things(site), *_items(site)]


def _groups(site: Site) -> Iterator[ItemLine]:
    home = site.home
    has_all = ALL not in home.items
    if has_all and ALL not in home.groups:
        yield ItemLine("Group", ALL, "Everything", metadata=(note("home", data=_home_data(home)),))
    if GROUP_ROS not in home.groups:
        marked = note("home", data=_home_data(home)) if not has_all or ALL in home.groups else generated()
        yield ItemLine("Group", GROUP_ROS, "ROS", groups=(ALL,) if has_all else (), metadata=(marked,))
    for name, group in home.groups.items():
        yield _group(
            site, name, group if isinstance(group, Group) else Group(label=group), short=isinstance(group, str)
        )
    if STATUS_ITEM not in home.items and STATUS_ITEM not in home.groups:
        yield ItemLine("String", STATUS_ITEM, "ROS", "network", (GROUP_ROS,), metadata=(generated(),))


def _home_data(home: Home) -> dict[str, object]:
    return {"timezone": home.timezone}


def _group(site: Site, name: str, group: Group, *, short: bool) -> ItemLine:
    type_ = ":".join(["Group", *([group.type] if group.type else []), *([group.function] if group.function else [])])
    data = {} if short and label(group.label) == group.label and group.label else group.model_dump(mode="json")
    others = tuple(_kept(key, one) for key, one in group.metadata.items())
    return ItemLine(
        type_,
        name,
        label(group.label),
        icon(site, group.icon),
        group.groups,
        group.tags if site.version.has_semantics else (),
        (*others, note("group", data={**data, **({"short": True} if short and data else {})})),
        group.arguments,
    )


def _rooms(site: Site) -> Iterator[ItemLine]:
    for key, room in site.home.rooms.items():
        tags = (semantics.room_tag(key, room),) if site.version.has_semantics else ()
        data = room.model_dump(mode="json", exclude_defaults=True, exclude=_readable(room.label))
        yield ItemLine(
            "Group", site.names.rooms[key], label(room.label), tags=tags, metadata=(note("room", key, data),)
        )


def _readable(text: str) -> set[str]:
    """The label, where a line gives it back as it is."""
    return {"label"} if text and split_label(label(text)) == (text, "") else set()


def _things(site: Site) -> Iterator[ItemLine]:
    for key, thing in site.home.things.items():
        tag = semantics.equipment_tag(site.home, key, thing)
        device = alexa.thing_device(site.home, key, tag)
        voice = (alexa.group_metadata(thing.alexa, device),) if thing.alexa is not None else ()
        tags: tuple[str, ...] = (tag,) if site.version.has_semantics else ()
        if thing.alexa is not None and not site.version.has_semantics:
            tags = alexa.old_tags(thing.alexa.device or device)
        rooms = (site.names.rooms[thing.room],) if thing.room is not None else ()
        data = thing.model_dump(mode="json", exclude_defaults=True, exclude={"room"} | _readable(thing.label))
        name = site.names.things[key]
        yield ItemLine("Group", name, label(thing.label), None, rooms, tags, (*voice, note("thing", key, data)))


def _items(site: Site) -> Iterator[ItemLine]:
    rooms = {name: key for key, name in site.names.rooms.items()}
    things = {name: key for key, name in site.names.things.items()}
    for name, item in site.home.items.items():
        line = item_line(site, name, item)
        missing = lost(item, item_of(line, rooms, things))
        if missing:
            line = ItemLine(line.type, line.name, line.label, line.icon, line.groups, line.tags,
                            (*line.metadata, note("item", data=missing)))  # fmt: skip
        yield line


def item_line(site: Site, name: str, item: Item) -> ItemLine:
    """An item of the home, without the note of what its line cannot say."""
    return ItemLine(
        item.type,
        name,
        label(item.label),
        icon(site, item.icon),
        _groups_of(site, item),
        _tags(site, name, item),
        tuple(_metadata(site, name, item)),
    )


def _groups_of(site: Site, item: Item) -> tuple[str, ...]:
    """The device's group, else the room's, then the item's own, then ROS."""
    place = []
    if item.thing is not None:
        place.append(site.names.things[item.thing])
    if item.room is not None:
        place.append(site.names.rooms[item.room])
    ros = (GROUP_ROS,) if item.ros else ()
    return tuple(dict.fromkeys((*place, *(one for one in item.groups if one != GROUP_ROS), *ros)))


def _tags(site: Site, name: str, item: Item) -> tuple[str, ...]:
    if site.version.has_semantics:
        return semantics.point_tags(item)
    return alexa.old_tags(alexa.device(site.home, name))


def _metadata(site: Site, name: str, item: Item) -> Iterator[Metadata]:
    for uid, settings in item.channels.items():
        yield Metadata("channel", uid, settings)
    if is_mqtt(site.home, item):
        yield Metadata("channel", channel_uid(site, name, item))
    if site.bus == "links" and item.ros:
        yield from link_uids(site, name, item)
    yield from of_item(item)
    if item.unit and item.type.startswith("Number:") and site.version.has_unit_metadata:
        yield Metadata("unit", item.unit)
    if not item.autoupdate:
        yield Metadata("autoupdate", "false")
    voice = alexa.metadata(site.home, name)
    if voice is not None:
        yield voice
    if item.ga is not None:
        yield Metadata("ga", item.ga)
    if item.expire is not None:
        yield Metadata("expire", item.expire if site.version.major >= 5 else _in_hours(item.expire))
    for key, one in item.metadata.items():
        yield _kept(key, one)


def _kept(namespace: str, one: Kept) -> Metadata:
    return Metadata(namespace, one.value, one.settings)


def _in_hours(expire: str) -> str:
    """Days as hours: before 5.0 there were no days."""
    match = OLD_DAYS.fullmatch(expire)
    return f"{int(match[1]) * 24}h{match[2] or ''}" if match else expire


def icon(site: Site, text: str | None) -> str | None:
    """An icon that this release's grammar can read; None for any other."""
    if text is None or text in ITEM_WORDS:
        return None
    if ICON.fullmatch(text):
        return text
    return text if SET_ICON.fullmatch(text) and site.version.major >= 4 else None
