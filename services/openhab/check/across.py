"""What only several files together show: names twice, and references to what is not there. Pure.

A reference is a fault only where the files are given that would have to define it: items for sitemaps, rules and
persistence, a thing for its channels. What OpenHAB's own pages define cannot be seen here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from services.openhab.check import mqtt_binding, voice
from services.openhab.check.findings import Findings, Place
from services.openhab.check.items import Items, Reference
from services.openhab.check.persist import Persisted
from services.openhab.check.rules import Rules
from services.openhab.check.sitemap import Shown
from services.openhab.lines import ChannelLine, ItemLine, ThingLine
from services.openhab.versions import Version

NOWHERE = "expected a thing that exists"  # it may, in OpenHAB's own pages


@dataclass
class Site:
    """The files that were given, read, each with its findings."""

    version: Version
    items: list[tuple[Items, Findings]] = field(default_factory=list)
    things: list[tuple[tuple[ThingLine, ...], Findings]] = field(default_factory=list)
    sitemaps: list[tuple[Shown, Findings]] = field(default_factory=list)
    stored: list[tuple[Persisted, Findings]] = field(default_factory=list)
    rules: list[tuple[Rules, Findings]] = field(default_factory=list)


def check(site: Site) -> None:
    """Everything; a file whose grammar is wrong defines nothing, so then references are not followed."""
    lines = _items(site)
    things = _things(site)
    broken = any(findings.found and not read.lines for read, findings in site.items)
    plain = {name: line for name, line in lines.items() if line.type == "Group"}
    for read, findings in site.items:
        for line in read.lines:
            voice.check(line, plain, findings)
            _links(line, things, findings)
    voice.check_all(((line, findings) for read, findings in site.items for line in read.lines), plain)
    if site.items and not broken:
        _references(site, lines)
    _rule_channels(site, things)


def _items(site: Site) -> dict[str, ItemLine]:
    """Every item by name; a name that comes again is a fault there."""
    found: dict[str, ItemLine] = {}
    where: dict[str, str] = {}
    for read, findings in site.items:
        for line in read.lines:
            if line.name in found:
                findings.error(line, f"expected every item once, got {line.name!r} again, as in {where[line.name]}")
                continue
            found[line.name] = line
            where[line.name] = f"{findings.file}:{line.line}"
    return found


def _things(site: Site) -> dict[str, ThingLine]:
    found: dict[str, ThingLine] = {}
    for things, findings in site.things:
        for thing in things:
            if thing.uid in found:
                findings.error(thing, f"expected every thing once, got {thing.uid!r} again")
            found.setdefault(thing.uid, thing)
    bridges = [thing.uid for thing in found.values() if thing.is_bridge]
    for things, findings in site.things:
        for thing in things:
            same = [uid for uid in bridges if thing.bridge and uid.split(":")[0] == thing.bridge.split(":")[0]]
            if thing.bridge is not None and thing.bridge not in found and same:
                findings.error(thing, f"expected a bridge that exists ({', '.join(same)}), got {thing.bridge!r}")
    return found


def _links(line: ItemLine, things: Mapping[str, ThingLine], findings: Findings) -> None:
    for one in line.metadata:
        if one.namespace != "channel":
            continue
        thing, channel = _channel(one.value, things)
        here = Place(one.line, one.column)
        if thing is None:
            if one.value.startswith("mqtt:topic:") and any(uid.startswith("mqtt:topic:") for uid in things):
                findings.error(here, f"{NOWHERE}, got the channel {one.value!r} of none")
        elif channel is None and (thing.channels or thing.uid.startswith("mqtt:")):
            listed = ", ".join(own.id for own in thing.channels) or "none"
            findings.error(here, f"expected a channel of {thing.uid} ({listed}), got {one.value.rpartition(':')[2]!r}")
        elif channel is not None and "profile" not in one.settings and not _fit(line, thing, channel):
            findings.error(here, f"expected an item that fits a {channel.type} channel, got a {line.type}")


def _channel(uid: str, things: Mapping[str, ThingLine]) -> tuple[ThingLine | None, ChannelLine | None]:
    thing = things.get(uid.rpartition(":")[0])
    id = uid.rpartition(":")[2]
    return thing, next((one for one in thing.channels if one.id == id), None) if thing is not None else None


def _fit(line: ItemLine, thing: ThingLine, channel: ChannelLine) -> bool:
    """Whether an item can hold what a channel says, as far as the binding is known."""
    parts = line.type.split(":")
    base = parts[0] if parts[0] != "Group" else (parts[1] if len(parts) > 1 else "")
    if channel.kind == "Type":
        if not thing.uid.startswith("mqtt:topic:") or channel.type not in mqtt_binding.ITEM_OF:
            return True
        return base == mqtt_binding.ITEM_OF[channel.type] or base in mqtt_binding.FITS.get(channel.type, ())
    return True


def _references(site: Site, lines: Mapping[str, ItemLine]) -> None:
    groups = {name for name, line in lines.items() if line.type.partition(":")[0] == "Group"}
    for read, findings in site.items:
        _missing(read.groups, groups, "group", findings)
    for shown, findings in site.sitemaps:
        _missing(shown.items, set(lines), "item", findings)
        _missing(shown.groups, groups, "group", findings)
    for stored, findings in site.stored:
        _missing(stored.items, set(lines), "item", findings)
        _missing(stored.groups, groups, "group", findings)
    for rules, findings in site.rules:
        _missing(rules.items, set(lines), "item", findings)
        _missing(rules.groups, groups, "group", findings)


def _missing(references: Iterable[Reference], known: set[str], what: str, findings: Findings) -> None:
    for one in references:
        if one.name not in known:
            findings.error(one, f"expected {'an' if what == 'item' else 'a'} {what} that exists, got {one.name!r}")


def _rule_channels(site: Site, things: Mapping[str, ThingLine]) -> None:
    for rules, findings in site.rules:
        for one in rules.channels:
            thing, channel = _channel(one.name, things)
            if thing is not None and channel is None and (thing.channels or thing.uid.startswith("mqtt:")):
                findings.error(one, f"expected a channel of {thing.uid}, got {one.name!r}")
