"""Items files: from the tree to `ItemLine`s, and what OpenHAB's validator and the parts behind it would say. Pure.

Not here: what only several files together show (`across.py`), and Alexa's metadata (`voice.py`).
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass

from lark import Token

from services.apartment import forms
from services.apartment.forms import FUNCTIONS, NEW_FUNCTIONS
from services.apartment.home import NAME
from services.openhab.check import patterns
from services.openhab.check.findings import Findings, Place
from services.openhab.check.items_grammar import grammar
from services.openhab.check.reading import Node, below, name_of, text_of, tokens, tree
from services.openhab.check.settings import settings_of
from services.openhab.lines import ItemLine, Metadata
from services.openhab.readback import metadata_of, split_label
from services.openhab.state_description import NAMESPACE
from services.openhab.versions import Version
from services.openhab.words import words

PROFILES = words(
    "default follow offset hysteresis range trigger-event-string timestamp-change timestamp-offset "
    "timestamp-trigger timestamp-update rawbutton-on-off-switch rawbutton-toggle-player "
    "rawbutton-toggle-rollershutter rawbutton-toggle-switch rawrocker-to-dimmer rawrocker-to-next-previous "
    "rawrocker-to-on-off rawrocker-to-play-pause rawrocker-to-rewind-fastforward rawrocker-to-stop-move "
    "rawrocker-to-up-down"
)


@dataclass(frozen=True)
class Reference:
    """A name that has to be defined somewhere."""

    name: str
    line: int
    column: int


@dataclass(frozen=True)
class Items:
    """What an items file holds; `groups` are the references to groups in their places."""

    lines: tuple[ItemLine, ...] = ()
    groups: tuple[Reference, ...] = ()


def read(text: str, version: Version, findings: Findings) -> Items:
    """The items of a file; what is wrong goes to the findings. Nothing when its grammar is wrong."""
    root = tree(grammar(version), text, findings)
    if root is None:
        return Items()
    nodes = below(root, "item")
    lines = tuple(_line(node, findings) for node in nodes)
    for line in lines:
        _check(line, version, findings)
    groups = [token for node in nodes for part in below(node, "groups") for token in tokens(part, "ID")]
    return Items(lines, tuple(Reference(name_of(one), one.line or 1, one.column or 1) for one in groups))


def _line(node: Node, findings: Findings) -> ItemLine:
    kind = below(node, "kind")[0]
    kinds = list(kind.scan_values(lambda one: isinstance(one, Token)))
    arguments = [one for part in kind.find_data("arguments") for one in part.children if isinstance(one, Token)]
    name = tokens(node, "ID")[0]
    label = [text_of(one, findings) for part in below(node, "label") for one in tokens(part, "STRING")]
    icons = [str(one) for part in below(node, "icon") for one in part.children]
    return ItemLine(
        type=":".join(str(one) for one in kinds if one not in arguments),
        name=name_of(name),
        label=label[0] if label else None,
        icon=":".join(icons).strip("\"'") or None,
        groups=tuple(name_of(one) for part in below(node, "groups") for one in tokens(part, "ID")),
        tags=tuple(
            _word(one, findings) for part in below(node, "tags") for one in part.children if isinstance(one, Token)
        ),
        metadata=tuple(_metadata(one, findings) for part in below(node, "bindings") for one in below(part, "binding")),
        arguments=tuple(_word(one, findings) for one in arguments),
        line=name.line or 1,
        column=name.column or 1,
    )


def _word(token: Token, findings: Findings) -> str:
    return text_of(token, findings) if token.type == "STRING" else name_of(token)


def _metadata(node: Node, findings: Findings) -> Metadata:
    key, value = tokens(node, "ID")[0], tokens(node, "STRING")[0]
    settings = settings_of(next(iter(below(node, "settings")), None), findings)
    return Metadata(name_of(key), text_of(value, findings), settings, key.line or 1, key.column or 1)


def _check(line: ItemLine, version: Version, findings: Findings) -> None:
    if not re.fullmatch(NAME, line.name):
        findings.error(line, f"expected a name of letters, digits and _ that begins with no digit, got {line.name!r}")
    for fault in _type_faults(line, version):
        if fault:
            findings.error(line, fault)
    _, shown = split_label(line.label or "")
    if (wrong := patterns.pattern(shown)) is not None:
        findings.error(line, wrong)
    seen: set[str] = set()
    for one in line.metadata:
        if one.namespace in seen and one.namespace != "channel":
            findings.warning(one, f"expected every namespace once, got {one.namespace!r} again")
        seen.add(one.namespace)
        _check_metadata(line, one, version, findings)


def _type_faults(line: ItemLine, version: Version) -> Iterator[str | None]:
    kind, *rest = line.type.split(":")
    if kind == "Group":
        functions = (*FUNCTIONS, *(NEW_FUNCTIONS if version >= Version(4, 3) else ()))
        yield forms.group_state(rest, len(line.arguments), functions)
        return
    yield forms.item_type(line.type)
    if line.arguments:
        yield "expected arguments behind a group's function only"


def _check_metadata(line: ItemLine, one: Metadata, version: Version, findings: Findings) -> None:
    here = Place(one.line, one.column)
    faults: list[str | None] = [patterns.credentials(text) for text in _texts(one)]
    if one.namespace == "channel":
        faults += [forms.channel(one.value), _profile_fault(one)]
    elif one.namespace == "autoupdate" and one.value not in ("true", "false"):
        faults.append(f"expected true or false, got {one.value!r}")
    elif one.namespace == "expire":
        faults.append(forms.expire(one.value, iso=version.major >= 4, wordy=version.major >= 5))
    elif one.namespace == "unit" and line.type.split(":")[0] not in ("Number", "Group"):
        faults.append(f"expected a unit for a Number only, got one for a {line.type}")
    elif one.namespace == NAMESPACE:
        faults += _described(line)
    for fault in faults:
        if fault:
            findings.error(here, fault)


def _texts(one: Metadata) -> Iterator[str]:
    yield one.value
    yield from (value for value in one.settings.values() if isinstance(value, str))


def _profile_fault(one: Metadata) -> str | None:
    profile = one.settings.get("profile")
    if not isinstance(profile, str):
        return None if profile is None else f"expected the name of a profile, got {profile!r}"
    parts = profile.split(":")
    if len(parts) > 2 or not all(forms.SEGMENT.fullmatch(part) for part in parts):
        return f"expected a profile such as follow or transform:MAP, got {profile!r}"
    near = difflib.get_close_matches(parts[-1], PROFILES, n=1, cutoff=0.8)
    if (len(parts) == 1 or parts[0] == "system") and parts[-1] not in PROFILES and near:
        return (
            f"expected a profile of OpenHAB's own, or <add-on>:<profile>, got {profile!r} (did you mean {near[0]!r}?)"
        )
    return None


def _described(line: ItemLine) -> Iterator[str | None]:
    shown = metadata_of(line, NAMESPACE)
    assert shown is not None
    for key, value in shown.settings.items():
        if key == "pattern":
            yield patterns.pattern(str(value))
        elif key == "options":
            yield patterns.options(str(value)) if not isinstance(value, tuple) else None
        elif key in ("min", "max", "step") and not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", str(value)):
            yield f"expected a number for {key}, got {value!r}"
        elif key == "readOnly" and str(value).lower() not in ("true", "false"):
            yield f"expected true or false for readOnly, got {value!r}"
