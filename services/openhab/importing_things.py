"""The devices of a lab's own files: the things that its items are linked to. Pure.

Generic topic things become plain MQTT devices with their topics and settings. A link is kept as it is where the thing
is of another kind, or where the home could not say the same: then the thing has to stay in the lab's own file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from services.apartment.forms import TOPIC_SETTINGS
from services.apartment.home import MqttTopics
from services.openhab.lines import ChannelLine, Setting, ThingLine, identifier
from services.openhab.mqtt import CHANNEL_TYPES
from services.openhab.readback import values
from services.states import base_type

KINDS = {"zwave": "zwave", "mqtt": "mqtt"}  # others are virtual for us
GENERIC = "mqtt:topic:"
AVAILABILITY = {"availabilityTopic", "payloadAvailable", "payloadNotAvailable"}  # what the home can say of a thing


def assign(items: dict[str, dict[str, Any]], things: Iterable[ThingLine]) -> dict[str, dict[str, Any]]:
    """Gives every item that has links but no device the thing of its first link; the devices by key."""
    known = {thing.uid: thing for thing in things}
    found: dict[str, dict[str, Any]] = {}
    for fields in items.values():
        uid = next(iter(fields["channels"]), None)
        if uid is None or fields["thing"] is not None:
            continue
        owner, _, id = uid.rpartition(":")
        key = identifier(owner)
        found.setdefault(key, _device(owner, known.get(owner)))
        fields["thing"] = key
        channel = _channel(known.get(owner), id)
        if owner.startswith(GENERIC) and channel is not None and _is_sayable(known[owner], channel, fields, uid):
            fields["mqtt"] = _topics(channel)
            del fields["channels"][uid]
    return found


def _is_sayable(thing: ThingLine, channel: ChannelLine, fields: Mapping[str, Any], uid: str) -> bool:
    """Whether the home makes the same of it: channels are of the item's kind there, and links have no profile."""
    alike = channel.kind == "Type" and channel.type == CHANNEL_TYPES.get(base_type(fields["type"]))
    heard = {"stateTopic", "commandTopic"} & channel.settings.keys()
    return alike and bool(heard) and thing.settings.keys() <= AVAILABILITY and not fields["channels"][uid]


def _channel(thing: ThingLine | None, id: str) -> ChannelLine | None:
    return next((one for one in thing.channels if one.id == id), None) if thing is not None else None


def _device(uid: str, thing: ThingLine | None) -> dict[str, Any]:
    label = thing.label if thing is not None and thing.label else uid
    fields: dict[str, Any] = {"label": label, "kind": KINDS.get(uid.partition(":")[0], "virtual")}
    said = thing.settings if thing is not None else {}
    if "availabilityTopic" in said:
        words = {"online": said.get("payloadAvailable", "ON"), "offline": said.get("payloadNotAvailable", "OFF")}
        fields["mqtt"] = {
            "availability": str(said["availabilityTopic"]),
            **{key: _text(one) for key, one in words.items()},
        }
    return fields


def _topics(channel: ChannelLine) -> MqttTopics:
    said = dict(channel.settings)
    named = {field: _text(said.pop(name)) for field, name in TOPIC_SETTINGS.items() if name in said}
    return MqttTopics(**named, settings=values(said))


def _text(value: Setting) -> str:
    """A setting as one text; transformations in a row have a sign of their own between them."""
    if isinstance(value, tuple):
        return "∩".join(map(str, value))
    return str(value).lower() if isinstance(value, bool) else str(value)
