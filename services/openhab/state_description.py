"""How OpenHAB shows an item: its `stateDescription`, and what of it can be read back. Pure.

Its options are one text with commas and equals signs between, which nothing in them can escape.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from services.apartment.home import Item, Range
from services.openhab.lines import Metadata, Setting
from services.states import base_type, plain

NAMESPACE = "stateDescription"
_UNIT = re.compile(r"%(?:\d+\$)?[-#+ 0,(]*\d*(?:\.\d+)?[a-zA-Z] ?(.*)")


def description(
    *, pattern: str | None = None, read_only: bool = False, range_: Range | None = None, options: Mapping[str, str] = {}
) -> tuple[Metadata, ...]:  # fmt: skip
    """The metadata, when there is anything to say."""
    said: dict[str, Setting] = {}
    if pattern is not None:
        said["pattern"] = pattern
    if read_only:
        said["readOnly"] = "true"
    if range_ is not None:
        said |= {"min": plain(range_.min), "max": plain(range_.max)}
        if range_.step is not None:
            said["step"] = plain(range_.step)
    if listed := options_text(options):
        said["options"] = listed
    return (Metadata(NAMESPACE, " ", said),) if said else ()


def of_item(item: Item) -> tuple[Metadata, ...]:
    """The metadata of an item of the home."""
    return description(pattern=pattern(item), read_only=item.only_told, range_=item.range, options=item.options)


def pattern(item: Item) -> str | None:
    """How a state is written; None: as it is."""
    if base_type(item.type) == "DateTime":
        return "%1$tF %1$tR"
    if base_type(item.type) != "Number" or not item.unit:
        return None
    step = item.range.step if item.range is not None else None
    digits = len(plain(step).partition(".")[2]) if step is not None else int(item.type == "Number:Temperature")
    return f"%.{digits}f {item.unit.replace('%', '%%')}"


def unit_of(text: str) -> str | None:
    """The unit that a pattern names; None when it names none."""
    match = _UNIT.fullmatch(text)
    unit = match[1].replace("%%", "%").strip() if match else ""
    return unit if unit and unit != "%unit%" else None


def options_text(options: Mapping[str, str]) -> str:
    """`state=words,...` of the options that this form can carry; in their words comma and equals sign are replaced."""
    listed = []
    for state, words in options.items():
        shown = _plain(words) or state
        if state and state == state.strip() and not re.search("[,=]", state):
            listed.append(f"{state}={shown}")
    return ",".join(listed)


def _plain(words: str) -> str:
    return " ".join(words.replace(",", ";").replace("=", ":").split())


def options_of(text: str) -> dict[str, str]:
    """The options of such a text."""
    pairs = [part.split("=", 1) for part in text.split(",") if part.strip()]
    return {pair[0].strip(): pair[-1].strip() for pair in pairs}
