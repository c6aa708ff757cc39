"""Rules files: the structure of each rule, its triggers, and that texts and brackets of its body are closed. Pure.

What a body does is not looked at. Not here: whether items and channels exist (`across.py`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from lark import Token

from services.apartment import forms
from services.openhab.check import patterns
from services.openhab.check.findings import Findings, Place
from services.openhab.check.items import Reference
from services.openhab.check.reading import Node, name_of, place, text_of, tokens, tree
from services.openhab.check.rules_grammar import grammar
from services.openhab.versions import Version
from services.openhab.words import words

LEXEMES = re.compile(
    r"(?P<comment>//[^\n]*|/\*.*?\*/)|(?P<rich>'''.*?''')"
    r"|(?P<text>\"(?:\\.|[^\\\"])*\"|'(?:\\.|[^\\'])*')|(?P<word>[A-Za-z_$][\w$]*)|(?P<bracket>[(){}\[\]])|(?P<open>/\*|[\"'])",
    re.S,
)
PAIRS = {")": "(", "]": "[", "}": "{"}
RESERVED = words(
    "if else val var switch case default for while do new null true false typeof throw return try finally "
    "catch synchronized extends static import extension super instanceof as"
)
HEADS = ("import", "val", "var")


@dataclass(frozen=True)
class Lexeme:
    """A word, a bracket or a text in the file."""

    kind: str
    text: str
    start: int
    end: int


@dataclass(frozen=True)
class Rules:
    """What the rules of a file refer to, and the texts of their triggers in order."""

    items: tuple[Reference, ...] = ()
    groups: tuple[Reference, ...] = ()
    channels: tuple[Reference, ...] = ()
    names: tuple[str, ...] = ()
    triggers: tuple[str, ...] = ()


@dataclass
class Body:
    """The span of a body, between `then` and `end`."""

    start: int
    end: int
    lexemes: list[Lexeme] = field(default_factory=list)


def read(text: str, version: Version, findings: Findings) -> Rules:
    """What the rules refer to; what is wrong goes to the findings."""
    lexemes = _lexed(text, findings)
    rules = Rules() if findings.found else _structure(lexemes, text, version, findings)
    _blame_open_text(lexemes, text, findings)
    return rules


def _structure(lexemes: list[Lexeme], text: str, version: Version, findings: Findings) -> Rules:
    bodies, head_end = _bodies(lexemes, text)
    for body in bodies:
        _check_brackets(body.lexemes, text, findings)
    _check_head(lexemes, head_end, text, findings)
    if findings.found:
        return Rules()
    root = tree(grammar(version), _skeleton(text, bodies, head_end), findings)
    return _rules(root, text, findings) if root is not None else Rules()


def _blame_open_text(lexemes: list[Lexeme], text: str, findings: Findings) -> None:
    """A text without its second quote swallows lines, and is noticed behind them only."""
    long = next((one for one in lexemes if one.kind == "text" and "\n" in one.text), None)
    if findings.found and long is not None:
        noticed = findings.found[0]
        findings.found.clear()
        findings.error(_at(text, long.start), f"expected this text to be closed: {noticed.text} in line {noticed.line}")


def _at(text: str, position: int) -> Place:
    line = text.count("\n", 0, position) + 1
    return Place(line, position - (text.rfind("\n", 0, position) + 1) + 1)


def _lexed(text: str, findings: Findings) -> list[Lexeme]:
    found = []
    for match in LEXEMES.finditer(text):
        kind = str(match.lastgroup)
        if kind == "open":
            findings.error(_at(text, match.start()), f"expected {match[0]} to be closed, got the end of the file")
            break
        if kind != "comment":
            found.append(Lexeme(kind, match[0], match.start(), match.end()))
    return found


def _bodies(lexemes: list[Lexeme], text: str) -> tuple[list[Body], int]:
    """The bodies, as far as rules have the words that they begin and end with; and where the first rule begins."""
    bodies: list[Body] = []
    current: Body | None = None
    in_rule, head_end = False, -1
    for one in lexemes:
        if one.kind == "word" and one.text == "rule" and current is None and not in_rule:
            in_rule, head_end = True, one.start if head_end < 0 else head_end
        elif one.kind == "word" and one.text == "then" and current is None and in_rule:
            current = Body(one.end, len(text))
        elif one.kind == "word" and one.text in ("end", "rule", "when") and current is not None:
            bodies.append(Body(current.start, one.start, current.lexemes))
            current, in_rule = None, one.text == "rule"
        elif current is not None:
            current.lexemes.append(one)
    if current is not None:
        bodies.append(current)
    return bodies, head_end if head_end >= 0 else len(text)


def _check_brackets(lexemes: list[Lexeme], text: str, findings: Findings) -> None:
    waiting: list[Lexeme] = []
    for one in lexemes:
        if one.kind != "bracket":
            continue
        if one.text not in PAIRS:
            waiting.append(one)
        elif waiting and waiting[-1].text == PAIRS[one.text]:
            waiting.pop()
        else:
            got = f"{waiting[-1].text} before it" if waiting else "none"
            findings.error(_at(text, one.start), f"expected a {PAIRS[one.text]} for this {one.text}, got {got}")
            return
    if waiting:
        findings.error(_at(text, waiting[-1].start), f"expected this {waiting[-1].text} to be closed within the rule")


def _check_head(lexemes: list[Lexeme], head_end: int, text: str, findings: Findings) -> None:
    """Before the first rule stand imports and variables."""
    head = [one for one in lexemes if one.end <= head_end]
    if head and (head[0].kind != "word" or head[0].text not in HEADS):
        findings.error(_at(text, head[0].start), f"expected rule, import, val or var, got {head[0].text!r}")
    _check_brackets(head, text, findings)


def _skeleton(text: str, bodies: list[Body], head_end: int) -> str:
    """The same text with blanks for bodies and what is before the first rule, so that every place stays."""
    blanked = list(text)
    for start, end in [(0, head_end), *((body.start, body.end) for body in bodies)]:
        blanked[start:end] = ["\n" if char == "\n" else " " for char in text[start:end]]
    return "".join(blanked)


def _rules(root: Node, text: str, findings: Findings) -> Rules:
    for token in root.scan_values(lambda one: isinstance(one, Token) and one.type == "ID"):
        assert isinstance(token, Token)
        if str(token) in RESERVED:
            findings.error(place(token), f"expected a name that is no word of the language, got {token!s}")
    for node in root.find_data("cron"):
        token = tokens(node, "STRING")[0]
        if fault := patterns.cron(text_of(token, findings)):
            findings.error(place(token), fault)
    triggers = [" ".join(_source(node, text).split()) for rule in root.children for node in _triggers(rule)]
    return Rules(
        tuple(_of(root, ("item_event", "timer", "condition"), "item")),
        tuple(_of(root, ("member_event",), "item")),
        tuple(_channels(root, findings)),
        tuple(str(_first(rule)).strip("\"'") for rule in root.children if not isinstance(rule, Token)),
        tuple(triggers),
    )


def _triggers(rule: Node | Token) -> list[Node]:
    """The triggers of a rule in the order in which they stand."""
    found = list(rule.find_data("trigger")) if not isinstance(rule, Token) else []
    return sorted(found, key=lambda node: node.meta.start_pos)


def _source(node: Node, text: str) -> str:
    return text[node.meta.start_pos : node.meta.end_pos]


def _first(node: Node) -> Token:
    return next(node.scan_values(lambda one: isinstance(one, Token)))


def _of(root: Node, rules: tuple[str, ...], what: str) -> list[Reference]:
    found = []
    for rule in rules:
        for node in root.find_data(rule):
            for one in node.find_data(what):
                token = tokens(one, "ID")[0]
                found.append(Reference(name_of(token), token.line or 1, token.column or 1))
    return found


def _channels(root: Node, findings: Findings) -> list[Reference]:
    found = []
    for node in root.find_data("channel"):
        token = _first(node)
        uid = text_of(token, findings) if token.type == "STRING" else name_of(token)
        if fault := forms.channel(uid):
            findings.error(place(token), fault)
        found.append(Reference(uid, token.line or 1, token.column or 1))
    return found
