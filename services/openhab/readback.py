"""What one item of OpenHAB's says about an item of the home; and a note for what it cannot say. Pure.

The generator reads back what it is about to write and puts into the metadata `apartment` what would be lost; so an
import of generated files gives the same home, and an import of a lab's own files uses the same reading.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

from services.apartment.home import GROUP_ROS, Alexa, Item, Range
from services.apartment.home import Metadata as Kept
from services.openhab.lines import ItemLine, Metadata, Setting
from services.openhab.semantics import point_tags
from services.openhab.skill import OLD_TAGS
from services.openhab.state_description import NAMESPACE, options_of, unit_of
from services.states import plain

NOTE = "apartment"
READ = ("channel", "autoupdate", NAMESPACE, "unit", "alexa", "ga", "expire", NOTE)
ITEM_FIELDS = tuple(Item.model_fields)
_PATTERN = re.compile(r"\s*\[([^\]]*)\]\s*$")


def generated() -> Metadata:
    """Marks what the home does not describe, such as a camera's items: an import leaves it out."""
    return Metadata(NOTE, "generated")


def note(role: str, key: str | None = None, data: Mapping[str, Any] | None = None) -> Metadata:
    """What an item stands for in the home, and what its line cannot say."""
    settings: dict[str, Setting] = {}
    if key is not None:
        settings["key"] = key
    if data:
        settings["data"] = json.dumps(data, ensure_ascii=False)
    return Metadata(NOTE, role, settings)


def metadata_of(line: ItemLine, namespace: str) -> Metadata | None:
    """The metadata of that namespace."""
    return next((one for one in line.metadata if one.namespace == namespace), None)


def role_of(line: ItemLine) -> str:
    """What its note says that it stands for; empty without one."""
    found = metadata_of(line, NOTE)
    return found.value if found is not None else ""


def data_of(line: ItemLine) -> dict[str, Any]:
    """What its note says beside the line; nothing when it was edited into something else."""
    found = metadata_of(line, NOTE)
    try:
        data = json.loads(str(found.settings.get("data", "{}"))) if found is not None else {}
    except json.JSONDecodeError:
        return {}
    return data if isinstance(data, dict) else {}


def item_of(line: ItemLine, rooms: Mapping[str, str], things: Mapping[str, str]) -> dict[str, Any]:
    """An item of the home as far as its line tells; `rooms` and `things`: the groups that stand for them, with keys."""
    label, pattern = split_label(line.label or line.name)
    shown = metadata_of(line, NAMESPACE)
    said = {key: str(value) for key, value in shown.settings.items()} if shown is not None else {}
    found: dict[str, Any] = {"type": line.type, "label": label}
    found["thing"] = next((things[one] for one in line.groups if one in things), None)
    found["room"] = next((rooms[one] for one in line.groups if one in rooms), None)
    found["groups"] = tuple(one for one in line.groups if one not in (*rooms, *things, GROUP_ROS))
    found["ros"] = GROUP_ROS in line.groups
    found["unit"] = _unit(line, said.get("pattern", pattern))
    found["icon"] = line.icon
    found["range"] = _range(said)
    found["options"] = options_of(said.get("options", ""))
    found["read_only"] = said.get("readOnly", "").lower() == "true"
    automatic = metadata_of(line, "autoupdate")
    found["autoupdate"] = automatic is None or automatic.value != "false"
    found["channels"] = {one.value: values(one.settings) for one in line.metadata if one.namespace == "channel"}
    found["alexa"] = alexa_of(line)
    for field in ("ga", "expire"):
        value = metadata_of(line, field)
        found[field] = value.value if value is not None else None
    found["tags"] = _tags(line, found)
    others = [one for one in line.metadata if one.namespace not in READ]
    found["metadata"] = {one.namespace: kept(one) for one in others}
    return found


def _tags(line: ItemLine, found: Mapping[str, Any]) -> tuple[str, ...] | None:
    """None where the tags are those that follow from the item, or Alexa's old ones."""
    if set(line.tags) <= set(OLD_TAGS):
        return None
    derived = point_tags(Item.model_validate({**found, "tags": None}))
    return None if derived == line.tags else line.tags


def kept(one: Metadata) -> Kept:
    """Metadata that nothing of the home stands for, as the home keeps it."""
    return Kept(value=one.value, settings=values(one.settings))


def split_label(text: str) -> tuple[str, str]:
    """A label and the pattern in brackets behind it."""
    match = _PATTERN.search(text)
    return (text[: match.start()].strip(), match[1]) if match else (text, "")


def values(settings: Mapping[str, Setting]) -> dict[str, Any]:
    """Settings as the home keeps them: a list is one text, and so is a negative number, as it is written."""
    return {key: _value(value) for key, value in settings.items()}


def _value(value: Setting) -> Any:
    if isinstance(value, tuple):
        return ",".join(map(str, value))
    return plain(float(value)) if not isinstance(value, str) and value < 0 else value


def _unit(line: ItemLine, pattern: str) -> str | None:
    if not line.type.startswith("Number"):
        return None
    found = metadata_of(line, "unit")
    return found.value if found is not None else unit_of(pattern)


def _range(said: Mapping[str, str]) -> Range | None:
    try:
        low, high = float(said["min"]), float(said["max"])
        step = float(said["step"]) if "step" in said else None
    except (KeyError, ValueError):
        return None
    return Range(min=low, max=high, step=step) if low < high and (step is None or step > 0) else None


def alexa_of(line: ItemLine) -> Alexa | None:
    """What its metadata says for Alexa."""
    found = metadata_of(line, "alexa")
    if found is None:
        return None
    settings = values(found.settings)
    name = settings.pop("name", None)
    return Alexa(name=None if name is None else str(name), device=found.value, settings=settings)


def lost(item: Item, read: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of an item that reading its line does not give back, as plain values."""
    back = Item.model_validate(read)
    short, full = item.model_dump(mode="json", exclude_defaults=True), item.model_dump(mode="json")
    return {key: short.get(key, full[key]) for key in ITEM_FIELDS if getattr(back, key) != getattr(item, key)}
