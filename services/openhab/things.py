"""The things file: the broker's bridge with the bus' two channels, and the plain MQTT devices. Pure.

Credentials are placeholders: who has an account puts it in once, in OpenHAB or in a copy of the file.
"""

from __future__ import annotations

from services import topics
from services.openhab import mqtt
from services.openhab.lines import ChannelLine, Setting, ThingLine
from services.openhab.site import Site

USER = "openhab"
PASSWORD = "CHANGE_ME"
RECONNECT_MS = 5000  # the binding's own minute would leave the bus deaf that long
SEPARATOR = "#"  # never part of a topic's name, so the first one ends the topic
STATUS = topics.SERVICE_STATUS.name(service="openhab")
COMMANDS, UPDATES = "busCommand", "busSet"


def lines(site: Site) -> list[ThingLine]:
    """Every thing of the home's file."""
    return [bridge(site), *mqtt.devices(site), *([mqtt.bus_thing(site)] if site.bus == "links" else [])]


def bridge(site: Site) -> ThingLine:
    """The broker; its status on the bus is OpenHAB's. Where it cannot say `online` the rules do."""
    settings: dict[str, Setting] = {
        "host": site.broker.host,
        "port": site.broker.port,
        "secure": site.broker.secure,
        "clientID": "openhab",
        "qos": 1,
        "keepAlive": 30,
        "reconnectTime": RECONNECT_MS,
        "username": USER,
        "password": PASSWORD,
        "lwtTopic": STATUS,
        "lwtMessage": "offline",
        "lwtQos": 1,
        "lwtRetain": True,
    }
    if site.broker.secure:  # without a pin the binding takes any certificate; a renewed one of ours has the same key
        settings |= {"certificatepin": False, "publickeypin": True}
        if site.broker.public_key is not None:
            settings["publickey"] = site.broker.public_key
    if site.version.major >= 3:
        settings["enableDiscovery"] = False
    if site.version.has_birth:
        settings |= {"birthTopic": STATUS, "birthMessage": "online", "birthRetain": True}
        settings |= {"shutdownTopic": STATUS, "shutdownMessage": "offline", "shutdownRetain": True}
    channels = () if site.bus == "links" else (_listener(COMMANDS, "command"), _listener(UPDATES, "set"))
    return ThingLine(site.broker.uid, "Broker of the apartment", True, settings=settings, channels=channels)


def _listener(id: str, verb: str) -> ChannelLine:
    pattern = topics.HOME_COMMAND if verb == "command" else topics.HOME_SET
    settings: dict[str, Setting] = {"stateTopic": pattern.filter, "separator": SEPARATOR}
    return ChannelLine("Type", "publishTrigger", id, f"home/+/{verb}", settings)
