"""What the MQTT binding of OpenHAB knows: the settings of brokers, generic things and their channels. Pure."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from collections.abc import Set as AbstractSet

from services.apartment import forms
from services.openhab.check.findings import Findings
from services.openhab.lines import ChannelLine, Setting, ThingLine
from services.openhab.versions import Version
from services.openhab.words import words

BROKER = words(
    "host port secure hostnameValidated protocol qos clientID reconnectTime keepAlive lwtTopic lwtMessage "
    "lwtQos lwtRetain username password certificatepin certificate publickeypin publickey enableDiscovery"
)
NEW_BROKER = words("mqttVersion birthTopic birthMessage birthRetain shutdownTopic shutdownMessage shutdownRetain")
OLD_BROKER = frozenset(("retainMessages",))
THING = words("availabilityTopic payloadAvailable payloadNotAvailable transformationPattern availabilityMode")
CHANNEL = words(
    "stateTopic commandTopic transformationPattern transformationPatternOut formatBeforePublish postCommand "
    "retained qos trigger nullValue ignoreValue"
)
TYPES: dict[str, str] = {
    "switch": "on off",
    "contact": "on off",
    "number": "min max step unit",
    "dimmer": "min max step on off",
    "rollershutter": "on off stop stopCommandTopic onState offState invert transformExtentsToString",
    "string": "allowedStates",
    "datetime": "",
    "location": "",
    "image": "",
    "color": "on off onBrightness colorMode color_mode",
    "colorRGB": "on off onBrightness",
    "colorHSB": "on off onBrightness",
    "trigger": "",
}
ITEM_OF = {  # the base item type that a channel's states are of
    "switch": "Switch",
    "contact": "Contact",
    "number": "Number",
    "dimmer": "Dimmer",
    "rollershutter": "Rollershutter",
    "string": "String",
    "datetime": "DateTime",
    "location": "Location",
    "image": "Image",
    "color": "Color",
    "colorRGB": "Color",
    "colorHSB": "Color",
}
FITS = {  # item types that a channel's states can be kept in as well; a text is no state of any other type
    "switch": ("String",),
    "contact": ("String", "Switch"),
    "number": ("String", "Dimmer", "Rollershutter"),
    "dimmer": ("Switch", "Number", "String", "Rollershutter"),
    "rollershutter": ("Dimmer", "Number", "String", "Switch"),
    "datetime": ("String",),
    "location": ("String",),
    "color": ("Switch", "Dimmer", "Number", "String"),
    "colorRGB": ("Switch", "Dimmer", "Number", "String"),
    "colorHSB": ("Switch", "Dimmer", "Number", "String"),
}
MODES = ("HSB", "RGB", "XYY", "hsb", "rgb", "xyY")


def check(thing: ThingLine, version: Version, findings: Findings) -> None:
    """What is wrong with a thing of the binding; nothing is said of others."""
    if thing.uid.startswith(("mqtt:broker:", "mqtt:systemBroker:")):
        _check_broker(thing, version, findings)
    elif thing.uid.startswith("mqtt:topic:"):
        _unknown(thing, thing.settings, THING, findings)
        topic = thing.settings.get("availabilityTopic")
        if isinstance(topic, str) and (fault := forms.mqtt_filter(topic)):
            findings.error(thing, fault)
        for channel in thing.channels:
            _check_channel(channel, findings)


def _check_broker(thing: ThingLine, version: Version, findings: Findings) -> None:
    known = BROKER | (NEW_BROKER if version >= Version(3, 4) else OLD_BROKER if version.major == 2 else frozenset())
    _unknown(thing, thing.settings, known, findings)
    if not thing.is_bridge:
        findings.error(thing, "expected Bridge before a broker, got Thing")
    if "host" not in thing.settings:
        findings.error(thing, "expected host among the settings of a broker, got none")
    for key in ("qos", "lwtQos"):
        if key in thing.settings and str(thing.settings[key]) not in ("0", "1", "2"):
            findings.error(thing, f"expected 0, 1 or 2 for {key}, got {thing.settings[key]!r}")
    for channel in thing.channels:
        if channel.type != "publishTrigger":
            findings.error(channel, f"expected Type publishTrigger, a broker's only channel, got {channel.type!r}")
        _topic(channel, "stateTopic", findings, needed=True)
        _unknown(channel, channel.settings, frozenset(("stateTopic", "separator", "payload")), findings)


def _check_channel(channel: ChannelLine, findings: Findings) -> None:
    if channel.kind == "Type" and channel.type not in TYPES:
        near = difflib.get_close_matches(channel.type, TYPES, n=1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        findings.error(
            channel, f"expected a channel of the MQTT binding ({', '.join(TYPES)}), got {channel.type!r}{hint}"
        )
        return
    _unknown(channel, channel.settings, CHANNEL | set(TYPES.get(channel.type, "").split()), findings)
    if not {"stateTopic", "commandTopic"} & set(channel.settings):
        findings.error(channel, "expected a stateTopic or a commandTopic, got neither")
    _topic(channel, "stateTopic", findings)
    command = channel.settings.get("commandTopic")
    if isinstance(command, str) and (fault := forms.mqtt_topic(command)):
        findings.error(channel, f"commandTopic: {fault}")
    if "qos" in channel.settings and str(channel.settings["qos"]) not in ("0", "1", "2"):
        findings.error(channel, f"expected 0, 1 or 2 for qos, got {channel.settings['qos']!r}")
    for key in ("colorMode", "color_mode"):
        if key in channel.settings and channel.settings[key] not in MODES:
            findings.error(channel, f"expected HSB, RGB or XYY for {key}, got {channel.settings[key]!r}")


def _topic(channel: ChannelLine, key: str, findings: Findings, *, needed: bool = False) -> None:
    topic = channel.settings.get(key)
    if topic is None:
        if needed:
            findings.error(channel, f"expected {key} among the settings, got none")
    elif not isinstance(topic, str):
        findings.error(channel, f"expected a text for {key}, got {topic!r}")
    elif fault := forms.mqtt_filter(topic):
        findings.error(channel, f"{key}: {fault}")


def _unknown(
    where: ThingLine | ChannelLine, settings: Mapping[str, Setting], known: AbstractSet[str], findings: Findings
) -> None:
    for key in settings:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            say = findings.error if near else findings.warning
            say(where, f"expected a setting that the MQTT binding knows, got {key!r}{hint}")
