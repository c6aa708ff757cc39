"""The grammar of items files, per release. Pure.

Up to 5.0 item types and group functions are words of the grammar; from 5.1 on any name is read and the rest left to
the validator. Icons of other collections came with 4.0, lists and the functions XOR and MEDIAN with 4.3.
"""

from __future__ import annotations

from collections.abc import Iterable

from services.apartment.forms import FUNCTIONS, NEW_FUNCTIONS
from services.openhab.check.reading import COMMENTS, STRICT_STRING
from services.openhab.versions import Version

BASE = (
    "Switch", "Rollershutter", "String", "Dimmer", "Contact", "DateTime", "Color", "Player", "Location", "Call",
    "Image",
)  # fmt: skip
COMMON = r"""
start: item*
item: kind ID label? icon? groups? tags? bindings?
label: STRING
groups: "(" ID ("," ID)* ")"
tags: "[" (ID | STRING) ("," (ID | STRING))* "]"
bindings: "{" binding ("," binding)* "}"
binding: ID "=" STRING settings?
settings: "[" entry? ("," entry)* "]"
keyed: ID "=" value
value: STRING | number | TRUE | FALSE
TRUE: "true"
FALSE: "false"
arguments: "(" (ID | STRING) ("," (ID | STRING))* ")"
ID: /\^?[a-zA-Z0-9_][a-zA-Z0-9_-]*/
"""
OLD_KINDS = r"""
kind: normal | group
normal: base | NUMBER (":" ID)?
group: GROUP
    | GROUP ":" base
    | GROUP ":" base ":" function arguments?
    | GROUP ":" NUMBER
    | GROUP ":" NUMBER ":" function arguments?
    | GROUP ":" NUMBER ":" ID
    | GROUP ":" NUMBER ":" ID ":" function arguments?
GROUP: "Group"
NUMBER: "Number"
"""
NEW_KINDS = r"""
kind: ID (":" ID (":" ID (":" ID)?)?)? arguments?
"""


def grammar(version: Version) -> str:
    """The grammar of a release."""
    parts = [COMMON, COMMENTS, STRICT_STRING]
    if version.free_item_types:
        parts.append(NEW_KINDS)
    else:
        functions = (*FUNCTIONS, *(NEW_FUNCTIONS if version >= Version(4, 3) else ()))
        parts += [OLD_KINDS, one_of("base", BASE), one_of("function", functions)]
    old_icon = 'icon: "<" (ID | STRING) ">"'
    parts.append('icon: "<" (ID ":" (ID ":")?)? ID ">"' if version.major >= 4 else old_icon)
    parts.append("entry: keyed | value" if version >= Version(4, 3) else "entry: keyed")
    parts.append('number: ID ("." ID)?' if version.major == 2 else 'number: MINUS? ID ("." ID)?\nMINUS: "-"')
    return "\n".join(parts)


def one_of(rule: str, listed: Iterable[str]) -> str:
    """A rule for one of some words of the grammar."""
    return f"!{rule}: " + " | ".join(f'"{word}"' for word in listed)
