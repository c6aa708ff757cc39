"""Things files: from the tree to `ThingLine`s, and what is wrong with things and channels. Pure.

The MQTT binding is known in detail, of others only that a UID is one. Not here: links (`across.py`).
"""

from __future__ import annotations

from collections.abc import Iterator

from lark import Token

from services.openhab.check import mqtt_binding, patterns
from services.openhab.check.findings import Findings
from services.openhab.check.reading import Node, below, name_of, place, text_of, tokens, tree
from services.openhab.check.settings import settings_of
from services.openhab.check.things_grammar import GRAMMAR
from services.openhab.lines import ChannelLine, ThingLine
from services.openhab.versions import Version


def read(text: str, version: Version, findings: Findings) -> tuple[ThingLine, ...]:
    """The things of a file, nested ones with their full UIDs; what is wrong goes to the findings."""
    root = tree(GRAMMAR, text, findings)
    if root is None:
        return ()
    found = tuple(_things(root, None, findings))
    for thing in found:
        _check(thing, version, findings)
    return found


def _things(node: Node, inside: ThingLine | None, findings: Findings) -> Iterator[ThingLine]:
    for one in (*below(node, "bridge"), *below(node, "thing")):
        thing = _thing(one, inside, findings)
        yield thing
        for body in below(one, "bridge_body"):
            yield from _things(body, thing, findings)


def _thing(node: Node, inside: ThingLine | None, findings: Findings) -> ThingLine:
    who = tokens(below(node, "who")[0], "ID")
    names = [name_of(one) for one in who]
    line, column = who[0].line or 1, who[0].column or 1
    if inside is None and len(who) < 3:
        findings.error(place(who[0]), f"expected a UID, <binding>:<type>:<thing>, got {' '.join(names)!r}")
    elif inside is not None and len(who) != 2:
        findings.error(place(who[0]), f"expected <type> <id> of a thing within a bridge, got {':'.join(names)!r}")
    if inside is not None and len(who) == 2:
        binding, _, *bridge = inside.uid.split(":")
        names = [binding, names[0], *bridge, names[1]]
    via = [":".join(name_of(one) for one in tokens(part, "ID")) for part in below(node, "via")]
    bodies = (*below(node, "bridge_body"), *below(node, "thing_body"))
    return ThingLine(
        uid=":".join(names),
        label=next((text_of(one, findings) for part in below(node, "label") for one in tokens(part, "STRING")), None),
        is_bridge=node.data == "bridge",
        bridge=via[0] if via else inside.uid if inside is not None else None,
        location=next(
            (text_of(one, findings) for part in below(node, "location") for one in tokens(part, "STRING")), None
        ),
        settings=settings_of(next(iter(below(node, "settings")), None), findings),
        channels=tuple(_channel(one, findings) for body in bodies for one in below(body, "channel")),
        line=line,
        column=column,
    )


def _channel(node: Node, findings: Findings) -> ChannelLine:
    kind = below(node, "channel_kind")[0]
    words = [str(one) for one in kind.scan_values(lambda one: isinstance(one, Token))]
    own = tokens(below(node, "channel_id")[0], "ID")
    how = words.pop(0) if words[0] in ("Type", "State", "Trigger") else "State"
    first = next(kind.scan_values(lambda one: isinstance(one, Token)))
    return ChannelLine(
        kind=how,
        type="".join(words),
        id="#".join(name_of(one) for one in own),
        label=next((text_of(one, findings) for part in below(node, "label") for one in tokens(part, "STRING")), None),
        settings=settings_of(next(iter(below(node, "settings")), None), findings),
        line=first.line or 1,
        column=first.column or 1,
    )


def _check(thing: ThingLine, version: Version, findings: Findings) -> None:
    seen: set[str] = set()
    for channel in thing.channels:
        if channel.id in seen:
            findings.error(channel, f"expected every channel of a thing once, got {channel.id!r} again")
        seen.add(channel.id)
        for fault in _address_faults(channel):
            findings.error(channel, fault)
    for fault in _address_faults(thing):
        findings.error(thing, fault)
    mqtt_binding.check(thing, version, findings)


def _address_faults(one: ThingLine | ChannelLine) -> Iterator[str]:
    for value in one.settings.values():
        fault = patterns.credentials(value) if isinstance(value, str) else None
        if fault:
            yield fault


def full(thing: ThingLine, channel: ChannelLine) -> str:
    """A channel's UID."""
    return f"{thing.uid}:{channel.id}"
