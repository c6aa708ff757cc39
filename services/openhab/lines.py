"""What stands in OpenHAB's files, as values: items, things, channels, properties; and their text. Pure.

The generator builds them, the checker and the import read them. Not here: what they mean for the home.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from services.openhab.words import ITEM_WORDS
from services.states import plain

Plain = bool | int | float | str
Setting = Plain | tuple[Plain, ...]
ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r", "\t": "\\t", "\b": "\\b", "\f": "\\f"}
SAFE_ID = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Metadata:
    """`namespace="value" [key=setting, ...]` behind an item; a channel link is one too."""

    namespace: str
    value: str
    settings: Mapping[str, Setting] = field(default_factory=dict)
    line: int = 0
    column: int = 0


@dataclass(frozen=True)
class ItemLine:
    """One item; `type` is `Number:Temperature`, `Group`, or `Group:Switch:OR`."""

    type: str
    name: str
    label: str | None = None
    icon: str | None = None
    groups: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    metadata: tuple[Metadata, ...] = ()
    arguments: tuple[str, ...] = ()
    line: int = 0
    column: int = 0


@dataclass(frozen=True)
class ChannelLine:
    """One channel of a thing: `Type switch : lamp`, or `State Number : temp`."""

    kind: str  # Type, State or Trigger
    type: str
    id: str
    label: str | None = None
    settings: Mapping[str, Setting] = field(default_factory=dict)
    line: int = 0
    column: int = 0


@dataclass(frozen=True)
class ThingLine:
    """A thing or a bridge with its full UID, whatever way it was written."""

    uid: str
    label: str | None = None
    is_bridge: bool = False
    bridge: str | None = None
    location: str | None = None
    settings: Mapping[str, Setting] = field(default_factory=dict)
    channels: tuple[ChannelLine, ...] = ()
    line: int = 0
    column: int = 0


def quoted(text: str) -> str:
    """A text as every grammar of OpenHAB's reads it: in double quotes, with the escapes that all of them know."""
    parts = (
        ESCAPES.get(char) or (f"\\u{ord(char):04x}" if ord(char) < 32 or char == "\x7f" else char) for char in text
    )
    return f'"{"".join(parts)}"'


def label(text: str) -> str:
    """A label without what OpenHAB takes for a pattern: brackets become round."""
    return text.replace("[", "(").replace("]", ")")


def name(text: str, words: frozenset[str]) -> str:
    """A name that may be a word of the grammar."""
    return f"^{text}" if text in words else text


def setting(value: Setting) -> str:
    """The value of a setting; negative numbers as texts, since the grammar of 2.5 knows none."""
    if isinstance(value, tuple):
        return ", ".join(setting(one) for one in value)
    if isinstance(value, bool):
        return "true" if value else "false"
    text = value if isinstance(value, str) else plain(float(value))
    return quoted(text) if isinstance(value, str) or value < 0 else text


def settings(values: Mapping[str, Setting]) -> str:
    """`[a="1", b=2]`, or nothing."""
    inner = ", ".join(f"{key}={setting(value)}" for key, value in values.items())
    return f" [{inner}]" if inner else ""


def item_text(item: ItemLine) -> str:
    """One item, its metadata on lines of their own."""
    words = [item.type + (f"({', '.join(_argument(one) for one in item.arguments)})" if item.arguments else "")]
    words.append(name(item.name, ITEM_WORDS))
    if item.label:
        words.append(quoted(item.label))
    if item.icon:
        words.append(f"<{item.icon}>")
    if item.groups:
        words.append(f"({', '.join(name(one, ITEM_WORDS) for one in item.groups)})")
    if item.tags:
        words.append(f"[{', '.join(map(quoted, item.tags))}]")
    if item.metadata:
        words.append("{\n    " + ",\n    ".join(map(_metadata_text, item.metadata)) + " }")
    return " ".join(words)


def _argument(text: str) -> str:
    return text if SAFE_ID.fullmatch(text) and text not in ITEM_WORDS else quoted(text)


def _metadata_text(one: Metadata) -> str:
    return f"{one.namespace}={quoted(one.value)}{settings(one.settings)}"


def thing_text(thing: ThingLine) -> str:
    """One thing or bridge with its channels."""
    words = ["Bridge" if thing.is_bridge else "Thing", thing.uid]
    if thing.label:
        words.append(quoted(thing.label))
    if thing.bridge:
        words.append(f"({thing.bridge})")
    if thing.location:
        words.append(f"@ {quoted(thing.location)}")
    head = " ".join(words) + _block(thing.settings)
    if not thing.channels:
        return head
    return "\n".join([f"{head} {{", "    Channels:", *(f"        {channel_text(one)}" for one in thing.channels), "}"])


def _block(values: Mapping[str, Setting]) -> str:
    if len(values) < 3:
        return settings(values)
    return " [\n    " + ",\n    ".join(f"{key}={setting(value)}" for key, value in values.items()) + "\n]"


def channel_text(channel: ChannelLine) -> str:
    """One channel."""
    shown = f" {quoted(channel.label)}" if channel.label else ""
    return f"{channel.kind} {channel.type} : {channel.id}{shown}{settings(channel.settings)}"


def unique(wanted: str, taken: Iterable[str]) -> str:
    """A name that nobody has: the wanted one, with underscores behind it where needed."""
    names = set(taken)
    while wanted in names:
        wanted += "_"
    return wanted


def identifier(text: str) -> str:
    """Any text as an id: letters, digits and _ stay, the rest becomes _."""
    return re.sub(r"[^A-Za-z0-9_]", "_", text) or "_"
