"""The grammar of rules, without their bodies: header, triggers, conditions, per release. Pure.

Bodies are programs of their own (Xbase) and come as blanks. A start level and `Time is <item>` came with 3.3, tags
with 4.2; ids, rules without triggers and conditions with 5.2.
"""

from __future__ import annotations

from services.openhab.check.reading import COMMENTS, LOOSE_STRING
from services.openhab.versions import Version

COMMON = r"""
start: rule*
name: STRING | ID
tags: "[" name ("," name)* "]"
when: "when" trigger ("or" trigger)*
trigger: item_event | member_event | channel_event | timer | system | thing_event
item_event: "Item" item event
member_event: "Member of" item event
event: "received command" state? | "received update" state? | "changed" ("from" state)? ("to" state)?
channel_event: "Channel" channel "triggered" state?
channel: STRING | ID
thing_event: "Thing" thing ("received update" status? | "changed" ("from" status)? ("to" status)?)
thing: STRING
item: ID
state: ID | INT ("." INT)? | STRING
!status: "UNINITIALIZED" | "INITIALIZING" | "UNKNOWN" | "ONLINE" | "OFFLINE" | "REMOVING" | "REMOVED"
cron: STRING
INT.-1: /[0-9][0-9_]*/
ID: /\^?[a-zA-Z_$][a-zA-Z0-9_$]*/
MEMBER_OF.2: "Member of"
RECEIVED_COMMAND.2: "received command"
RECEIVED_UPDATE.2: "received update"
SHUTS_DOWN.2: "shuts down"
"""
START_LEVEL = r"""
START_LEVEL.2: "reached start level"
"""
CONDITIONS = r"""
conditions: "but" "only" "if" condition ("and" condition)*
condition: "Time" "is" "between" TIME "and" TIME
    | "Day" "is" day ("or" day)*
    | "Day" offset? "is" "a" ("weekday" | "weekend")
    | "Day" offset? "is" "not"? "a" "holiday"
    | "Day" offset? "is" "in" name
    | INT "ms" "between" "executions"
    | "Thing" thing "is" "not"? status?
    | "Item" item operator? state
!day: "Monday" | "Tuesday" | "Wednesday" | "Thursday" | "Friday" | "Saturday" | "Sunday"
!operator: "=" | "!=" | ">" | ">=" | "<" | "<="
TIME.3: /([01][0-9]|2[0-3]):[0-5][0-9]/
"""


def grammar(version: Version) -> str:
    """The grammar of a release."""
    newest = version >= Version(5, 2)
    timer = '"Time" "cron" cron | "Time" "is" ("midnight" | "noon")'
    system = 'system: "System" ("started" | "shuts down"'
    parts = [COMMON, COMMENTS, LOOSE_STRING]
    if version >= Version(3, 3):
        timer += ' | "Time" "is" item "timeOnly"?' + (" offset?" if version >= Version(4, 3) else "")
        system += ' | "reached start level" INT'
        parts.append(START_LEVEL)
    if version >= Version(4, 3):
        parts.append('offset: "offset" "="? "-"? INT')
    if newest:
        timer += ' | "Time" "is" TIME'
        parts.append(CONDITIONS)
    tags = " tags?" if version >= Version(4, 2) else ""
    uid = ' ("uid" "="? name)?' if newest else ""
    when = "when? conditions?" if newest else "when"
    rule = f'rule: "rule" name{uid}{tags} {when} "then" "end"'
    return "\n".join([*parts, rule, f"timer: {timer}", f"{system})"])
