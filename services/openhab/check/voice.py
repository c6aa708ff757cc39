"""Alexa's metadata as the skill reads it: device types, attributes, what goes with which item. Pure."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping

from services.openhab.check.findings import Findings, Place
from services.openhab.lines import ItemLine, Metadata
from services.openhab.readback import metadata_of, split_label
from services.openhab.skill import ATTRIBUTES, DEFAULTS, MODES, MOST_ENDPOINTS, TYPES, attributes_of, defaults_of

OLD_TYPES = {"Lighting": "Light", "Switchable": "Switch", "CurrentTemperature": "", "WindowCovering": "Blind"}


def check(line: ItemLine, groups: Mapping[str, ItemLine], findings: Findings) -> None:
    """What the skill would not understand of an item; `groups`: all plain groups by name."""
    said = metadata_of(line, "alexa")
    if said is None:
        return
    values = [part.strip() for part in said.value.split(",") if part.strip()]
    if not values:
        findings.error(Place(said.line, said.column), "expected a device type such as Light, got nothing")
    around = _group_type(line, groups)
    for value in values:
        for fault in _faults(line, value, around):
            findings.error(Place(said.line, said.column), fault)
    for fault in _setting_faults(said, values):
        findings.error(Place(said.line, said.column), fault)


def _group_type(line: ItemLine, groups: Mapping[str, ItemLine]) -> str | None:
    """The device type of the group that an item is part of for Alexa."""
    for name in line.groups:
        group = groups.get(name)
        said = metadata_of(group, "alexa") if group is not None else None
        if said is not None and said.value in TYPES:
            return said.value
    return None


def _faults(line: ItemLine, value: str, around: str | None) -> Iterator[str]:
    kind, _, attribute = value.partition(".")
    base = _base(line)
    if value.startswith("Alexa.") or (kind.endswith(("Controller", "Sensor")) and kind not in TYPES and attribute):
        return  # the form of the skill's first version, which it still reads
    if kind in TYPES:
        if attribute and attribute not in ATTRIBUTES:
            yield f"expected an attribute that the skill knows, got {attribute!r}{_near(attribute, ATTRIBUTES)}"
        elif attribute and attribute not in attributes_of(kind):
            yield f"expected an attribute of {kind} ({', '.join(attributes_of(kind))}), got {attribute!r}"
        elif around is not None and kind != around and kind != "Switch":
            yield f"expected the type of its group, {around}, or an attribute alone, got {kind!r}"
        elif base is not None:
            yield from _fits(line, base, (attribute,) if attribute else defaults_of(kind, base), kind, attribute)
    elif kind in ATTRIBUTES and not attribute:
        if line.type == "Group":
            yield f"expected a device type for a group, got the attribute {kind!r}"
        elif around is not None and kind not in attributes_of(around):
            yield f"expected an attribute of {around} ({', '.join(attributes_of(around))}), got {kind!r}"
        elif base is not None:
            yield from _fits(line, base, (kind,), kind, kind)
    elif kind in ("Lighting", "Switchable") and not attribute:
        yield f"expected {OLD_TYPES[kind]!r}, the skill's word since its version 3, got {kind!r}"
    else:
        near = _near(kind, (*TYPES, *ATTRIBUTES))
        yield f"expected a device type or an attribute that the skill knows, got {kind!r}{near}"


def _fits(line: ItemLine, base: str, attributes: tuple[str, ...], kind: str, attribute: str) -> Iterator[str]:
    wrong = [one for one in attributes if base not in ATTRIBUTES[one].split()]
    if wrong:
        yield f"expected a {' or '.join(ATTRIBUTES[wrong[0]].split())} for {wrong[0]}, got a {line.type}"
    elif not attributes and not attribute and DEFAULTS.get(kind, "PowerState"):
        names = DEFAULTS.get(kind, "PowerState").split()
        types = sorted({one for name in names for one in ATTRIBUTES[name].split()})
        yield f"expected a {' or '.join(types)} for {kind}, got a {line.type}"
    elif not attributes and not attribute:
        yield f"expected {kind}.<attribute>, since {kind} alone means none, got {kind!r}"


def _base(line: ItemLine) -> str | None:
    """The base type of an item, or of the members of a group with a state; None for a plain group."""
    parts = line.type.split(":")
    if parts[0] != "Group":
        return parts[0]
    return parts[1] if len(parts) > 1 else None


def _near(word: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, list(known), n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


def _setting_faults(said: Metadata, values: list[str]) -> Iterator[str]:
    attributes = {value.rpartition(".")[2] for value in values}
    listed = said.settings.get("supportedModes")
    if "Mode" in attributes and isinstance(listed, str):
        states = {part.partition("=")[0].strip() for part in listed.split(",") if part.strip()}
        if not MODES[0] <= len(states) <= MODES[1]:
            yield f"expected {MODES[0]} to {MODES[1]} modes, got {len(states)}"
    for key, parts in (("supportedRange", 3), ("setpointRange", 2), ("range", 2)):
        text = said.settings.get(key)
        if isinstance(text, str) and not _is_range(text, parts):
            yield f"expected {key} such as {'0:100:1' if parts == 3 else '5:30'}, got {text!r}"
    scale = said.settings.get("scale")
    if scale is not None and scale not in ("Celsius", "Fahrenheit", "celsius", "fahrenheit"):
        yield f"expected Celsius or Fahrenheit for scale, got {scale!r}"


def _is_range(text: str, parts: int) -> bool:
    try:
        numbers = [float(part) for part in text.split(":")]
    except ValueError:
        return False
    return len(numbers) == parts and numbers[0] < numbers[1] and (parts < 3 or numbers[2] > 0)


def check_all(lines: Iterable[tuple[ItemLine, Findings]], groups: Mapping[str, ItemLine]) -> None:
    """What only all items together show: names twice, too many devices."""
    seen: dict[str, str] = {}
    for line, findings in lines:
        said = metadata_of(line, "alexa")
        if said is None or _group_type(line, groups) is not None:
            continue
        spoken = str(said.settings.get("name") or split_label(line.label or "")[0]).strip()
        if not any(char.isalnum() for char in spoken):
            findings.warning(line, "expected a label or a name that can be spoken, got none: the skill leaves it out")
        elif spoken.lower() in seen:
            findings.warning(
                line, f"expected names that Alexa can tell apart, got {spoken!r} of {seen[spoken.lower()]} too"
            )
        seen.setdefault(spoken.lower(), line.name)
        if len(seen) == MOST_ENDPOINTS + 1:
            findings.warning(line, f"expected {MOST_ENDPOINTS} devices for Alexa at most: she leaves this one out")
