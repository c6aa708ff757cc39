"""The grammar of things files; it is the same in every release. Pure."""

from __future__ import annotations

from services.openhab.check.items_grammar import BASE, one_of
from services.openhab.check.reading import COMMENTS, STRICT_STRING

GRAMMAR = "\n".join(
    [
        r"""
start: (bridge | thing)*
bridge: "Bridge" who label? location? settings? bridge_body?
bridge_body: "{" "Things:"? (bridge | thing)* "Channels:"? channel* "}"
thing: "Thing"? who label? via? location? settings? thing_body?
thing_body: "{" "Channels:"? channel* "}"
who: ID (":" ID ":" ID (":" ID)*)?
    | ID ID
via: "(" ID ":" ID ":" ID (":" ID)* ")"
label: STRING
location: "@" STRING
channel: channel_kind ":" channel_id label? settings?
channel_kind: TYPE ID
    | (STATE | TRIGGER)? (base | NUMBER | NUMBER_OF ID)
channel_id: ID ("#" ID)?
settings: "[" entry? ("," entry)* "]"
entry: keyed | value
keyed: ID "=" value
value: STRING | number | TRUE | FALSE
number: ID ("." ID)?
NUMBER_OF.2: "Number:"
NUMBER: "Number"
TYPE: "Type"
STATE: "State"
TRIGGER: "Trigger"
TRUE: "true"
FALSE: "false"
THINGS_WORD.2: "Things:"
CHANNELS_WORD.2: "Channels:"
ID: /\^?[a-zA-Z0-9_-][a-zA-Z0-9_-]*/
""",
        one_of("base", BASE),
        COMMENTS,
        STRICT_STRING,
    ]
)
