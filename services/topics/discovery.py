"""Topics by which hubs find what there is by themselves."""

from __future__ import annotations

from services.topic import Kind, Topic

HOMEASSISTANT_ENTITY = Topic(
    "homeassistant/<platform>/<cam>/<entity>/config",
    Kind.STATE,
    str,
    ("camera-<cam>",),
    ("openhab", "operator", "camera-<cam>"),
    "Home Assistant's discovery, for openHAB too: JSON of one entity, empty when there is none (any more)",
)
HOMEASSISTANT_STATUS = Topic(
    "homeassistant/status",
    Kind.STATE,
    str,
    ("openhab",),
    ("camera-<cam>", "operator", "hubs"),
    "`online` when Home Assistant (with the account of openHAB) has started and wants to hear its entities again",
)
HOMEASSISTANT_ITEM = Topic(
    "homeassistant/<platform>/<item>/config",
    Kind.STATE,
    str,
    ("hubs",),
    ("openhab", "operator", "hubs"),
    "the same for an item of the home",
)
HOMIE_SET = Topic(
    "homie/<device>/<node>/<property>/set",
    Kind.COMMAND,
    str,
    ("openhab", "operator"),
    ("hubs",),
    "Homie 4.0: a value that a hub wants",
)
HOMIE_DEVICE = Topic(
    "homie/<device>/<attribute>", Kind.STATE, str, ("hubs",), ("openhab", "operator"), "Homie 4.0: the home as a device"
)
HOMIE_NODE = Topic(
    "homie/<device>/<node>/<attribute>", Kind.STATE, str, ("hubs",), ("openhab", "operator"), "Homie 4.0: an item"
)
HOMIE_ATTRIBUTE = Topic(
    "homie/<device>/<node>/<property>/<trait>",
    Kind.STATE,
    str,
    ("hubs",),
    ("openhab", "operator"),
    "Homie 4.0: what values an item has",
)
HOMIE_VALUE = Topic(
    "homie/<device>/<node>/<property>",
    Kind.STATE,
    str,
    ("hubs",),
    ("openhab", "operator"),
    "Homie 4.0: the state of an item in Homie's form (`true`, `21.5`)",
)
