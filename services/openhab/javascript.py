"""The rules of the bus in JavaScript, for OpenHAB's own library `openhab`. Pure."""

from __future__ import annotations

import json

from services.apartment.home import GROUP_ROS
from services.openhab.mqtt import SILENT
from services.openhab.reactions import ChannelTriggered, MemberChanged, Reaction, Started, Trigger, reactions
from services.openhab.site import Site
from services.openhab.things import SEPARATOR, STATUS

HEAD = """const {{ rules, triggers, items, actions }} = require('openhab');

const BROKER = {broker};
const GROUP = {group};
const SILENT = {silent}; // they take no commands

function say(topic, text) {{
  const bus = actions.Things.getActions('mqtt', BROKER);
  if (bus === null) {{
    console.warn("the broker's thing is not there yet");
    return;
  }}
  bus.publishMQTT(topic, text, true);
}}

function sayState(name, type, state) {{
  if (type !== 'Image') {{ // the text of a picture's state is not the picture
    say(`home/${{name}}/state`, state);
  }}
}}
"""
PUBLISH = """(event) => {
    sayState(event.itemName, items.getItem(event.itemName).type, event.newState);
  }"""
SNAPSHOT = """() => {{
    items.getItem(GROUP).members.forEach((one) => sayState(one.name, one.type, one.state));{online}
  }}"""
ACCEPT = """(event) => {{
    const text = event.receivedEvent;
    const cut = text.indexOf({separator});
    if (cut < 0) {{
      console.warn(`no topic in: ${{text}}`);
      return;
    }}
    const [, wanted, verb] = text.slice(0, cut).split('/');
    const value = text.slice(cut + 1);
    const item = items.getItem(wanted, true);
    if (item === null || !item.groupNames.includes(GROUP)) {{
      console.warn(`not a member of ${{GROUP}}: ${{wanted}}`);
      return;
    }}
    if (verb === 'set') {{
      item.postUpdate(value);
    }} else if (SILENT.includes(item.type)) {{
      console.warn(`takes no commands, use set: ${{wanted}}`);
    }} else {{
      item.sendCommand(value);
    }}
  }}"""


def text(site: Site) -> str:
    """The whole file."""
    head = HEAD.format(broker=_js(site.broker.uid), group=_js(GROUP_ROS), silent=json.dumps(SILENT).replace('"', "'"))
    return "\n".join([head, *(_rule(site, one) for one in reactions(site))])


def _js(value: str) -> str:
    return f"'{value}'"


def _rule(site: Site, reaction: Reaction) -> str:
    online = "" if site.version.has_birth else f"\n    say({_js(STATUS)}, 'online');"
    execute = {
        "publish": PUBLISH,
        "snapshot": SNAPSHOT.format(online=online),
        "accept": ACCEPT.format(separator=_js(SEPARATOR)),
    }[reaction.act]
    listed = ",\n    ".join(trigger(one) for one in reaction.triggers)
    lines = (
        "rules.JSRule({",
        f"  name: {_js(reaction.label)},",
        f"  triggers: [\n    {listed}\n  ],",
        f"  execute: {execute}",
        "});",
        "",
    )
    return "\n".join(lines)


def trigger(one: Trigger) -> str:
    """A trigger as a script makes it."""
    if isinstance(one, MemberChanged):
        return f"triggers.GroupStateChangeTrigger({_js(one.group)})"
    if isinstance(one, Started):
        level = 100 if one.level is None else one.level
        return f"triggers.SystemStartlevelTrigger({level})"
    if isinstance(one, ChannelTriggered):
        return f"triggers.ChannelEventTrigger({_js(one.uid)})"
    return f"triggers.ThingStatusChangeTrigger({_js(one.uid)}, 'ONLINE')"
