"""Topics of the home, and of every service: states, commands, who is there and how it fares."""

from __future__ import annotations

from services import payloads as p
from services.topic import Kind, Topic
from services.topics.roles import ALL, SHOWN, STEERS

HOME_STATE = Topic(
    "home/<item>/state",
    Kind.STATE,
    str,
    ("openhab", "persistence"),
    (*SHOWN, "camera-<cam>", "hubs"),
    "the state of an item in OpenHAB's string form (`ON`, `21.5 °C`, `UNDEF`)",
    stored=True,
)
HOME_COMMAND = Topic(
    "home/<item>/command",
    Kind.COMMAND,
    str,
    (*STEERS, "camera-<cam>", "hubs"),
    ("openhab", "dashboard", "operator"),
    "sendCommand",
)
HOME_SET = Topic(
    "home/<item>/set", Kind.COMMAND, str, (*STEERS, "camera-<cam>"), ("openhab", "dashboard", "operator"), "postUpdate"
)
SERVICE_STATUS = Topic(
    "service/<service>/status",
    Kind.STATE,
    str,
    ("<service>",),
    (*ALL, "metrics"),
    "`online` or `offline`, the latter as last will",
)
SERVICE_INFO = Topic(
    "service/<service>/info",
    Kind.STATE,
    p.ServiceInfo,
    ("<service>",),
    (*SHOWN, "metrics"),
    "version, start and counters",
)
SERVICE_LOG_LEVEL = Topic(
    "service/<service>/log_level/set",
    Kind.COMMAND,
    str,
    ("operator",),
    ("<service>",),
    "`debug`, `info`, `warning` or `error`, until it ends; its `info` tells the level among the counters",
)
SERVICE_RELOAD = Topic(
    "service/<service>/reload/set",
    Kind.COMMAND,
    str,
    ("operator",),
    ("<service>",),
    "end in good order, to be started again with the configuration as it is then",
)
DIAGNOSTICS = Topic(
    "diagnostics/<component>",
    Kind.STATE,
    p.Diagnostic,
    ALL,
    (*SHOWN, "openhab", "metrics"),
    "health of a component, about once a second",
    stored=True,
)
