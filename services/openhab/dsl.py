"""The rules of the bus in OpenHAB's own language. Pure."""

from __future__ import annotations

from services.apartment.home import GROUP_ROS
from services.openhab.mqtt import SILENT
from services.openhab.reactions import ChannelTriggered, MemberChanged, Reaction, Started, Trigger, reactions
from services.openhab.site import Site
from services.openhab.things import SEPARATOR, STATUS


def text(site: Site) -> str:
    """The whole file."""
    return "\n".join(_rule(site, one) for one in reactions(site))


def _rule(site: Site, reaction: Reaction) -> str:
    when = " or\n    ".join(trigger(one) for one in reaction.triggers)
    body = {"publish": _publish, "snapshot": _snapshot, "accept": _accept}[reaction.act](site)
    return "\n".join(
        [f'rule "{reaction.label}"', "when", f"    {when}", "then", *(f"    {line}" for line in body), "end", ""]
    )


def trigger(one: Trigger) -> str:
    """A trigger as a rule names it."""
    if isinstance(one, MemberChanged):
        return f"Member of {one.group} changed"
    if isinstance(one, Started):
        return f"System reached start level {one.level}" if one.level is not None else "System started"
    if isinstance(one, ChannelTriggered):
        return f'Channel "{one.uid}" triggered'
    return f'Thing "{one.uid}" changed to ONLINE'


def _actions(site: Site) -> list[str]:
    return [
        f'val bus = getActions("mqtt", "{site.broker.uid}")',
        "if (bus === null) {",
        '    logWarn("bus", "the broker\'s thing is not there yet")',
        "    return;",
        "}",
    ]


def _publish(site: Site) -> list[str]:
    state = "triggeringItem.state" if site.version.major == 2 else "newState"
    return [
        'if (triggeringItem.type == "Image") {',
        "    return; // the text of a picture's state is not the picture",
        "}",
        *_actions(site),
        f'bus.publishMQTT("home/" + triggeringItem.name + "/state", {state}.toString, true)',
    ]


def _snapshot(site: Site) -> list[str]:
    return [
        *_actions(site),
        f'{GROUP_ROS}.members.filter[ one | one.type != "Image" ].forEach[ one |',
        '    bus.publishMQTT("home/" + one.name + "/state", one.state.toString, true)',
        "]",
        *([] if site.version.has_birth else [f'bus.publishMQTT("{STATUS}", "online", true)']),
    ]


def _accept(site: Site) -> list[str]:
    event = "receivedEvent.getEvent()" if site.version.major == 2 else "receivedEvent"
    silent = " || ".join(f'item.type == "{kind}"' for kind in SILENT)
    return [
        f"val text = {event}",
        f'val cut = text.indexOf("{SEPARATOR}")',
        "if (cut < 0) {",
        '    logWarn("bus", "no topic in: {}", text)',
        "    return;",
        "}",
        'val levels = text.substring(0, cut).split("/")',
        "val value = text.substring(cut + 1)",
        "val wanted = levels.get(1)",
        f"val item = {GROUP_ROS}.members.findFirst[ one | one.name == wanted ]",
        "if (item === null) {",
        f'    logWarn("bus", "not a member of {GROUP_ROS}: {{}}", wanted)',
        "    return;",
        "}",
        'if (levels.get(2) == "set") {',
        "    postUpdate(wanted, value)",
        f"}} else if ({silent}) {{",
        '    logWarn("bus", "takes no commands, use set: {}", wanted)',
        "} else {",
        "    sendCommand(wanted, value)",
        "}",
    ]
