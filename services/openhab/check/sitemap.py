"""Sitemaps: which widget has what, and what OpenHAB's validator says. Pure.

Not here: whether the items exist (`across.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lark import Token, Tree

from services.openhab.check import patterns
from services.openhab.check.findings import Findings
from services.openhab.check.items import Reference
from services.openhab.check.reading import Node, below, name_of, place, text_of, tokens, tree
from services.openhab.check.sitemap_grammar import FLAGS, LISTS, SHARED, VALUES, WIDGETS, grammar
from services.openhab.readback import split_label
from services.openhab.versions import Version

HINTS = ("text", "number", "date", "time", "datetime")
KEYS = {key.lower(): key for key in (*VALUES, *LISTS, *FLAGS)}


@dataclass(frozen=True)
class Shown:
    """What a sitemap refers to: items, and groups (of Group widgets)."""

    name: str = ""
    items: tuple[Reference, ...] = ()
    groups: tuple[Reference, ...] = ()


@dataclass(frozen=True)
class Widget:
    """One widget: its kind, the nodes of what it has, those below it."""

    kind: Token
    has: dict[str, Node]
    inside: tuple[Widget, ...]


def read(text: str, version: Version, findings: Findings) -> Shown:
    """What a sitemap refers to; what is wrong goes to the findings."""
    root = tree(grammar(version), text, findings)
    if root is None:
        return Shown()
    widgets = tuple(_widget(one, version, findings) for one in below(root, "widget"))
    _check_level(widgets, None, version, findings)
    for widget in _all(widgets):
        _check(widget, findings)
        _check_level(widget.inside, str(widget.kind), version, findings)
    _check_texts(root, findings)
    items, groups = _references(root, widgets)
    return Shown(name_of(tokens(root, "ID")[0]), items, groups)


def _widget(node: Node, version: Version, findings: Findings) -> Widget:
    kind = next(one for part in ("linkable", "other") for two in below(node, part) for one in two.children)
    assert isinstance(kind, Token)
    allowed, needed = WIDGETS[str(kind)]
    has: dict[str, Node] = {}
    for attribute in below(node, "attribute"):
        inner = attribute.children[0]
        assert isinstance(inner, Tree)
        key = KEYS[str(inner.data)[2:]]
        where = _first(inner) or kind
        if key not in f"{SHARED} {allowed}".split():
            findings.error(
                place(where), f"expected nothing like {key} for a {kind}; it knows {SHARED} {allowed}".rstrip()
            )
        elif key in has:
            say = findings.warning if version.free_sitemap else findings.error
            say(place(where), f"expected {key} once, got it again")
        has[key] = inner
    for key in needed.split():
        if key not in has:
            findings.error(place(kind), f"expected {key}= for a {kind}, got none")
    return Widget(kind, has, tuple(_widget(one, version, findings) for one in below(node, "widget")))


def _first(node: Node) -> Token | None:
    return next(node.scan_values(lambda one: isinstance(one, Token)), None)


def _all(widgets: tuple[Widget, ...]) -> Iterator[Widget]:
    for widget in widgets:
        yield widget
        yield from _all(widget.inside)


def _check_level(widgets: tuple[Widget, ...], inside: str | None, version: Version, findings: Findings) -> None:
    """Frames and others do not mix, frames hold no frames, and buttons are in grids only."""
    kinds = {str(one.kind) == "Frame" for one in widgets}
    mixed = len(kinds) > 1
    say = findings.error if version.free_sitemap else findings.warning
    for widget in widgets:
        if str(widget.kind) == "Frame" and inside == "Frame":
            say(place(widget.kind), "expected no frame within a frame")
        elif mixed and (str(widget.kind) == "Frame") != (str(widgets[0].kind) == "Frame"):
            say(place(widget.kind), "expected only frames or only other widgets on one level")
            return
        if (str(widget.kind) == "Button") != (inside == "Buttongrid") and "Button" in (str(widget.kind), inside or ""):
            findings.error(place(widget.kind), "expected buttons within a Buttongrid only")
        elif inside == "Buttongrid" and str(widget.kind) != "Button":
            findings.error(place(widget.kind), f"expected buttons within a Buttongrid only, got {widget.kind}")


def _check(widget: Widget, findings: Findings) -> None:
    here = place(widget.kind)
    low, high, step = (_number(widget.has.get(key)) for key in ("minValue", "maxValue", "step"))
    if step is not None and step <= 0:
        findings.error(here, f"expected a step above 0, got {step:g}")
    if low is not None and high is not None and low > high:
        findings.error(here, f"expected minValue below maxValue, got {low:g} and {high:g}")
    if "inputHint" in widget.has and (hint := _text(widget.has["inputHint"])) not in HINTS:
        findings.error(here, f"expected one of {', '.join(HINTS)} for inputHint, got {hint!r}")
    if "interpolation" in widget.has and (how := _text(widget.has["interpolation"])) not in ("linear", "step"):
        findings.error(here, f"expected linear or step for interpolation, got {how!r}")
    if "icon" in widget.has and "staticIcon" in widget.has:
        findings.error(here, "expected an icon or a staticIcon, got both")
    if "buttons" in widget.has and "item" not in widget.has:
        findings.error(here, "expected item= for the buttons of a Buttongrid, got none")
    if "label" in widget.has and (fault := patterns.pattern(split_label(_text(widget.has["label"]))[1])):
        findings.error(here, fault)


def _text(node: Node) -> str:
    token = next((one for one in node.children if isinstance(one, Token) and one.type in ("STRING", "ID")), None)
    return str(token).strip("\"'") if token is not None else ""


def _number(node: Node | None) -> float | None:
    if node is None:
        return None
    inner = below(node, "numeral")
    if not inner:
        return None
    text = "".join(str(one) for one in inner[0].children)
    negative = inner[0].meta.end_pos - inner[0].meta.start_pos > len(text)
    return -float(text) if negative else float(text)


def _check_texts(root: Node, findings: Findings) -> None:
    for token in root.scan_values(lambda one: isinstance(one, Token) and one.type == "STRING"):
        assert isinstance(token, Token)
        if fault := patterns.credentials(text_of(token, findings)):
            findings.error(place(token), fault)


def _references(root: Node, widgets: tuple[Widget, ...]) -> tuple[tuple[Reference, ...], tuple[Reference, ...]]:
    items: list[Reference] = []
    groups: list[Reference] = []
    for widget in _all(widgets):
        for token in tokens(widget.has["item"], "ID") if "item" in widget.has else []:
            where = Reference(str(token), token.line or 1, token.column or 1)  # a ^ would be part of the name here
            (groups if str(widget.kind) == "Group" else items).append(where)
    for condition in root.find_data("condition"):
        own = tokens(condition, "ID")
        if own:
            items.append(_reference(own[0]))
    return tuple(items), tuple(groups)


def _reference(token: Token) -> Reference:
    return Reference(name_of(token), token.line or 1, token.column or 1)
