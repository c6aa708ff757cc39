"""The table of topics for machines: an AsyncAPI 3.0 document, with the JSON schema of every payload.

`send` is what the roles that write do, `receive` what those that read do; the roles stand as tags.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel

from services import __version__
from services.topic import LEVELS, Kind, Topic
from services.topics import HISTORY_GET, HISTORY_REPLY, MISSION_WHERE, MISSION_WHERE_REPLY, TABLE

MQTT = "0.2.0"  # of AsyncAPI's bindings for MQTT
REPLIES = {HISTORY_GET: HISTORY_REPLY, MISSION_WHERE: MISSION_WHERE_REPLY}
SERVERS = {
    "loopback": {"host": "127.0.0.1:1883", "protocol": "mqtt", "description": "for this machine"},
    "network": {"host": "apartment.lan:8883", "protocol": "mqtts", "description": "for others, encrypted"},
}
KINDS = {
    Kind.STATE: "retained, the latest wins",
    Kind.EVENT: "happened, never retained",
    Kind.COMMAND: "wanted; refused when retained or late",
    Kind.BLOB: "a picture, not repeated",
}

Json = dict[str, Any]


def document(rows: Iterable[Topic] = TABLE) -> Json:
    """The whole document as plain values."""
    rows = list(rows)
    schemas: Json = {}
    channels = {_name(row): _channel(row, schemas) for row in rows}
    return {
        "asyncapi": "3.0.0",
        "info": {
            "title": "Smart apartment",
            "version": __version__,
            "description": "Topics of the bus. Every account of the broker may do what the roles in the tags say.",
            "license": {"name": "Apache-2.0"},
        },
        "defaultContentType": "application/json",
        "servers": {name: {**one, "security": [{"$ref": ACCOUNT}]} for name, one in SERVERS.items()},
        "channels": channels,
        "operations": {name: one for row in rows for name, one in _operations(row)},
        "components": {
            "schemas": schemas,
            "securitySchemes": {"account": {"type": "userPassword", "description": "one for each service"}},
        },
    }


ACCOUNT = "#/components/securitySchemes/account"


def _name(row: Topic) -> str:
    """`camera/<cam>/scan/state` as `camera_scan_state`; what is alike then is told apart by its levels."""
    words = re.findall(r"[A-Za-z0-9_]+", re.sub(r"<\w+>", "", row.pattern))
    return "_".join(words) if _alone(row, words) else "_".join(re.findall(r"\w+", row.pattern))


def _alone(row: Topic, words: list[str]) -> bool:
    alike = [one for one in TABLE if re.findall(r"[A-Za-z0-9_]+", re.sub(r"<\w+>", "", one.pattern)) == words]
    return alike == [row]


def _channel(row: Topic, schemas: Json) -> Json:
    channel: Json = {
        "address": re.sub(r"<(\w+)>", r"{\1}", row.pattern),
        "description": f"{row.meaning} ({KINDS[row.kind]})",
        "messages": {"message": _message(row, schemas)},
    }
    if row.names:
        channel["parameters"] = {name: {"description": f"matches {LEVELS[name]}"} for name in row.names}
    return channel


def _message(row: Topic, schemas: Json) -> Json:
    if row.payload is bytes:
        return {"contentType": "image/jpeg", "payload": {"type": "string", "format": "binary"}}
    if row.payload is str:
        return {"contentType": "text/plain", "payload": {"type": "string"}}
    assert issubclass(row.payload, BaseModel)
    schema = row.payload.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas.update(schema.pop("$defs", {}))
    schemas[row.payload.__name__] = schema
    return {"contentType": "application/json", "payload": {"$ref": f"#/components/schemas/{row.payload.__name__}"}}


def _operations(row: Topic) -> Iterable[tuple[str, Json]]:
    name = _name(row)
    for action, roles in (("send", row.writers), ("receive", row.readers)):
        yield (
            f"{action}_{name}",
            {
                "action": action,
                "channel": {"$ref": f"#/channels/{name}"},
                "tags": [{"name": role} for role in dict.fromkeys(roles)],
                "bindings": {"mqtt": _binding(row, action)},
                **(_answer(row) if action == "send" else {}),
            },
        )


def _binding(row: Topic, action: str) -> Json:
    sent = row.message("", **dict.fromkeys(row.names, "a") | _legal(row))
    binding: Json = {"qos": sent.qos, "bindingVersion": MQTT}
    if action == "send":
        binding["retain"] = sent.retain
        if sent.expires_s is not None:
            binding["messageExpiryInterval"] = sent.expires_s
    return binding


def _legal(row: Topic) -> dict[str, str]:
    """Levels for which `a` is no name."""
    special = {"marker": "1", "attribute": "$name", "trait": "$name"}
    return {name: special[name] for name in row.names if name in special}


def _answer(row: Topic) -> Json:
    if row not in REPLIES:
        return {}
    return {"reply": {"channel": {"$ref": f"#/channels/{_name(REPLIES[row])}"}}}
