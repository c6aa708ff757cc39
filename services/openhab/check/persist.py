"""Persistence files: their grammar per release, strategies and filters that do not exist, cron texts. Pure.

4.0 brought new forms of filters, 4.3 exclusions, 5.0 the block of aliases; 5.1 took `default` away and wants a
strategy on every line.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lark import Token, Tree

from services.openhab.check import patterns
from services.openhab.check.findings import Findings, Place
from services.openhab.check.items import Reference
from services.openhab.check.reading import COMMENTS, LOOSE_STRING, Node, below, name_of, place, text_of, tokens, tree
from services.openhab.versions import Version

BUILT_IN = ("everyChange", "everyUpdate", "restoreOnStartup")
COMMON = r"""
strategy: ID (":" STRING)?
defaults: "default" "=" reference ("," reference)*
filters: "Filters" "{" filter* "}"
filter: ID ":" detail
items: "Items" "{" config* "}"
strategies_of: "strategy" "=" reference ("," reference)*
filters_of: "filter" "=" reference ("," reference)*
reference: ID
all: "*"
one: ID
members: ID "*"
not_one: "!" ID
not_members: "!" ID "*"
!unit: "s" | "m" | "h" | "d"
INT: /[0-9]+/
ID: /\^?[a-zA-Z_][a-zA-Z0-9_]*/
"""
SINCE_4 = r"""
detail: ">" PERCENT? decimal STRING?
    | "T" INT unit
    | "=" STRING ("," STRING)*
    | "!" STRING ("," STRING)*
    | "[]" decimal decimal STRING?
    | "][" decimal decimal STRING?
PERCENT: "%"
INCLUDE.2: "[]"
EXCLUDE.2: "]["
"""
BEFORE_4 = r"""
detail: ">" decimal "%"
    | INT unit
"""


@dataclass(frozen=True)
class Persisted:
    """What a file stores: references to items and to groups, and what each item's line says."""

    items: tuple[Reference, ...] = ()
    groups: tuple[Reference, ...] = ()
    strategies: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = ()  # items, groups with * -> strategies


def grammar(version: Version) -> str:
    """The grammar of a release."""
    exclusions = " | not_one | not_members" if version >= Version(4, 3) else ""
    strict = version >= Version(5, 1)
    block = 'strategies: "Strategies" "{" strategy*' + ("" if strict else " defaults?") + ' "}"'
    alias = ' ("->" STRING)?' if version.major < 5 else ""
    what = f"what: all | one | members{exclusions}"
    tail = '":" strategies_of filters_of?' if strict else '(":" strategies_of? filters_of? | ";")'
    start = "start: strategies? filters? items?" if strict else "start: strategies filters? items?"
    parts = [COMMON, block, what, f'config: what ("," what)*{alias} {tail}', COMMENTS, LOOSE_STRING]
    if version.major >= 5:
        start += " aliases?"
        parts += ['aliases: "Aliases" "{" alias* "}"', 'alias: ID "->" STRING']
    parts.append(SINCE_4 if version.major >= 4 else BEFORE_4)
    sign = '"-"? ' if version >= Version(4, 3) else ""
    return "\n".join([start, *parts, f'decimal: {sign}INT ("." INT)?'])


def read(text: str, version: Version, findings: Findings) -> Persisted:
    """What a file stores; what is wrong goes to the findings."""
    root = tree(grammar(version), text, findings)
    if root is None:
        return Persisted()
    known = {*BUILT_IN, *(("forecast",) if version >= Version(4, 1) else ())}
    crons = _defined(root, "strategies", "strategy", findings)
    for token, cron in crons.items():
        if cron is not None and (fault := patterns.cron(cron)):
            findings.error(place(token), fault)
    strategies = known | {name_of(token) for token in crons}
    filters = {name_of(token) for token in _defined(root, "filters", "filter", findings)}
    used = [*_resolve(root, "defaults", strategies, "strategy", findings)]
    used += _resolve(root, "strategies_of", strategies, "strategy", findings)
    _resolve(root, "filters_of", filters, "filter", findings)
    for token, cron in crons.items():
        if cron is not None and name_of(token) not in used:
            findings.warning(place(token), f"expected {name_of(token)!r} to be used in a line of Items")
    return _stored(root, findings)


def _defined(root: Node, block: str, rule: str, findings: Findings) -> dict[Token, str | None]:
    found: dict[Token, str | None] = {}
    seen: set[str] = set()
    for part in below(root, block):
        for node in below(part, rule):
            token = tokens(node, "ID")[0]
            if name_of(token) in seen:
                findings.error(place(token), f"expected every {rule} once, got {name_of(token)!r} again")
            seen.add(name_of(token))
            strings = tokens(node, "STRING")
            found[token] = text_of(strings[0], findings) if strings else None
    return found


def _resolve(root: Node, rule: str, known: set[str], what: str, findings: Findings) -> Iterator[str]:
    found = []
    for node in root.find_data(rule):
        for one in below(node, "reference"):
            token = tokens(one, "ID")[0]
            found.append(name_of(token))
            if name_of(token) not in known:
                listed = ", ".join(sorted(known)) or "none is defined"
                findings.error(place(token), f"expected a {what} that exists ({listed}), got {name_of(token)!r}")
    return iter(found)


def _stored(root: Node, findings: Findings) -> Persisted:
    items: list[Reference] = []
    groups: list[Reference] = []
    lines = []
    has_default = bool(list(root.find_data("defaults")))
    for config in (one for part in below(root, "items") for one in below(part, "config")):
        here = list(_named(config))
        items += [_reference(token) for rule, token in here if rule in ("one", "not_one") and token is not None]
        groups += [
            _reference(token) for rule, token in here if rule in ("members", "not_members") and token is not None
        ]
        said = tuple(_strategies(config))
        if not said and not has_default:
            findings.warning(_start(config), "expected a strategy for these items: there is no default")
        names = (
            f"{name_of(token) if token else ''}{'' if rule == 'one' else '*'}"
            for rule, token in here
            if "not" not in rule
        )
        lines.append((tuple(names), said))
    return Persisted(tuple(items), tuple(groups), tuple(lines))


def _named(config: Node) -> Iterator[tuple[str, Token | None]]:
    """What a line stores: the kind of each name, and the name."""
    for part in below(config, "what"):
        for one in part.children:
            if isinstance(one, Tree):
                yield str(one.data), next(iter(tokens(one, "ID")), None)


def _strategies(config: Node) -> Iterator[str]:
    for node in below(config, "strategies_of"):
        for one in below(node, "reference"):
            yield name_of(tokens(one, "ID")[0])


def _start(config: Node) -> Place:
    return Place(config.meta.line, config.meta.column)


def _reference(token: Token) -> Reference:
    return Reference(name_of(token), token.line or 1, token.column or 1)
