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
    ("camera-<cam>", "operator"),
    "`online` when Home Assistant (with the account of openHAB) has started and wants to hear its entities again",
)
