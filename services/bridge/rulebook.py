"""Reads `bridge.yaml`: every rule checked, repeated for each camera, and checked against the others.

Faults are told all at once, with file and line. What a rule does: `rules.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from services import document
from services.bridge import template
from services.bridge.rules import Rule
from services.document import Document, Path_

DIAGNOSTICS = "/diagnostics"  # gathered by the bridge itself, once a second
OWN = (
    DIAGNOSTICS,
    "/tf",
    "/tf_static",
    "/joint_states",
    "/map",
    "/map_metadata",
    "/clock",
    "/rosout",
    "/iot_mission",
    "/iot_mission/state",
)
Check = Callable[[Rule], Iterable[tuple[Path_, str]]]
Numbered = tuple[int, Rule]  # where it stands in the file, and the rule for one camera


def unchecked(rule: Rule) -> Iterable[tuple[Path_, str]]:
    """Where no ROS is: types and fields cannot be looked up."""
    return ()


def load(file: Path, cameras: tuple[str, ...], check: Check = unchecked) -> tuple[Rule, ...]:
    """The rules of a file, for these cameras, the default one first; ConfigError with every fault.

    `check` finds what is wrong with a rule beyond its own words: types and fields that are not installed.
    """
    source = document.read(file)
    entries = _entries(source)
    rules = [(index, rule) for index, entry in enumerate(entries) if (rule := _rule(entry, index, source))]
    for index, rule in rules:
        for path, text in check(expand(rule, ("cam",))[0]):
            source.fault(("rules", index, *path), text)
    numbered = [(index, one) for index, rule in rules for one in expand(rule, cameras)]
    for index, text in collisions(numbered):
        source.fault(("rules", index), text)
    document.must(source)
    return tuple(rule for _, rule in numbered)


def expand(rule: Rule, cameras: tuple[str, ...]) -> list[Rule]:
    """The rule itself, or one for each camera: the default one keeps the names, the others have theirs before them."""
    if rule.each is None:
        return [rule]
    return [_for_camera(rule, cam, "" if cam == cameras[0] else f"/{cam}") for cam in cameras]


def collisions(rules: list[Numbered]) -> Iterator[tuple[int, str]]:
    """Which rules cannot be together, by the later one's place in the file."""
    first: dict[str, Rule] = {}
    seen: set[tuple[str, str, str]] = set()
    for index, rule in rules:
        if rule.ros in OWN:
            yield index, f"expected another topic than {rule.ros}, which the bridge says itself"
        other = first.setdefault(rule.ros, rule)
        for name in ("type", "direction", "latches", "replay"):
            here, there = getattr(rule, name), getattr(other, name)
            if here != there:
                yield index, f"expected {name} {there!r} as in another rule for {rule.ros}, got {here!r}"
        if (key := (rule.direction, rule.ros, rule.mqtt)) in seen:
            yield index, f"expected every pair of topics once, got {rule.mqtt} and {rule.ros} again"
        seen.add(key)


def _entries(source: Document) -> list[Any]:
    value = source.value
    if source.faults:
        return []
    if not isinstance(value, dict) or list(value) != ["rules"] or not isinstance(value["rules"], list):
        source.fault((), "expected one key, rules, with a list")
        return []
    return value["rules"]


def _rule(entry: Any, index: int, source: Document) -> Rule | None:
    try:
        return Rule.model_validate(entry)
    except ValidationError as error:
        for fault in error.errors(include_url=False):
            source.fault(("rules", index, *fault["loc"]), _told(fault))
        return None


def _told(fault: Any) -> str:
    """Pydantic's words as ours: `expected ..., got ...`."""
    if fault["type"] == "missing":
        return "expected a value, got nothing"
    if fault["type"] == "extra_forbidden":
        return f"expected one of {', '.join(Rule.model_fields)}, got {fault['loc'][-1]!r}"
    text = str(fault["msg"]).replace("Value error, ", "").replace("Input should be", "expected")
    return text if ", got " in text or fault["type"] == "value_error" else f"{text}, got {fault['input']!r:.80}"


def _for_camera(rule: Rule, cam: str, prefix: str) -> Rule:
    changed = {
        "mqtt": template.given(rule.mqtt, "cam", cam),
        "ros": prefix + rule.ros,
        "fields": template.given(rule.fields, "cam", cam),
        "payload": template.given(rule.payload, "cam", cam),
        "each": None,
    }
    return Rule.model_validate({**rule.model_dump(), **changed})
