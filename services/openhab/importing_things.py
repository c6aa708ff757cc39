"""The devices of a lab's own files: the things that its items are linked to. Pure.

Generic topic things become plain MQTT devices with their topics; of other things the links are kept as they are.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from services.apartment.home import NO_MQTT, MqttTopics
from services.openhab.lines import ChannelLine, ThingLine, identifier
from services.states import base_type

KINDS = {"zwave": "zwave", "mqtt": "mqtt"}  # others are virtual for us
GENERIC = "mqtt:topic:"


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
        fits = base_type(fields["type"]) not in NO_MQTT
        if owner.startswith(GENERIC) and channel is not None and not fields["channels"][uid] and fits:
            fields["mqtt"] = _topics(channel)
            del fields["channels"][uid]
    return found


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
            **{key: str(one) for key, one in words.items()},
        }
    return fields


def _topics(channel: ChannelLine) -> MqttTopics:
    names = {"state": "stateTopic", "command": "commandTopic", "transform": "transformationPattern",
             "transform_out": "transformationPatternOut", "on": "on", "off": "off", "stop": "stop"}  # fmt: skip
    return MqttTopics(**{key: str(channel.settings[name]) for key, name in names.items() if name in channel.settings})
