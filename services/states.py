"""OpenHAB's string forms: which texts are states and commands of which item type, and their number.

Sources: openhab-core `library/types` and `library/items` (`toString`, accepted types per item). Pure.
"""

from __future__ import annotations

import re
from datetime import datetime

from services.errors import BadMessage

SPECIAL = ("UNDEF", "NULL")  # states of every type, never commands
WORDS: dict[str, dict[str, float]] = {
    "Switch": {"ON": 1.0, "OFF": 0.0},
    "Contact": {"OPEN": 1.0, "CLOSED": 0.0},
    "Player": {"PLAY": 1.0, "PAUSE": 0.0, "REWIND": 0.0, "FASTFORWARD": 1.0},
}
STATE_WORDS = {**WORDS, "Dimmer": {"ON": 100.0, "OFF": 0.0}, "Rollershutter": {"UP": 0.0, "DOWN": 100.0}}
COMMAND_WORDS: dict[str, tuple[str, ...]] = {
    "Switch": ("ON", "OFF"),
    "Dimmer": ("ON", "OFF", "INCREASE", "DECREASE"),
    "Rollershutter": ("UP", "DOWN", "STOP", "MOVE"),
    "Color": ("ON", "OFF", "INCREASE", "DECREASE"),
    "Player": ("PLAY", "PAUSE", "NEXT", "PREVIOUS", "REWIND", "FASTFORWARD"),
}
NO_COMMANDS = ("Contact", "Call", "Image")  # they accept REFRESH only
ITEM_TYPES = (
    "Switch",
    "Contact",
    "Number",
    "String",
    "Dimmer",
    "Rollershutter",
    "Color",
    "DateTime",
    "Location",
    "Player",
    "Call",
    "Image",
)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_QUANTITY = re.compile(rf"({_NUMBER.pattern})(?: ?(\S+))?")


def base_type(item_type: str) -> str:
    """`Number` of `Number:Temperature`."""
    return item_type.partition(":")[0]


def quantity(text: str) -> tuple[float, str]:
    """Number and unit (empty when there is none) of `21.5 °C`; BadMessage when it is not one."""
    match = _QUANTITY.fullmatch(text)
    if not match:
        raise BadMessage(f"expected a number, optionally with a unit, got {text[:80]!r}")
    unit = match.group(4) or ""
    return float(match.group(1)), "" if unit == "one" else unit


def parts(text: str, lowest: int, highest: int) -> list[float]:
    """The numbers of a comma list (`120,100,50`); BadMessage when there are fewer or more than wanted."""
    fields = text.split(",")
    if not lowest <= len(fields) <= highest or not all(_NUMBER.fullmatch(part.strip()) for part in fields):
        raise BadMessage(f"expected {lowest} to {highest} numbers with commas between, got {text[:80]!r}")
    return [float(part) for part in fields]


def color(text: str) -> tuple[float, float, float]:
    """Hue 0..360, saturation and brightness 0..100."""
    hue, saturation, brightness = parts(text, 3, 3)
    if not (0 <= hue <= 360 and 0 <= saturation <= 100 and 0 <= brightness <= 100):
        raise BadMessage(f"expected hue 0..360, saturation and brightness 0..100, got {text!r}")
    return hue, saturation, brightness


def percent(text: str) -> float:
    """A number from 0 to 100."""
    value, unit = quantity(text)
    if unit not in ("", "%") or not 0 <= value <= 100:
        raise BadMessage(f"expected 0 to 100, got {text[:80]!r}")
    return value


def moment(text: str) -> datetime:
    """OpenHAB's DateTime, `2026-01-31T07:05:00.000+0100`, the colon in the offset optional."""
    try:
        return datetime.fromisoformat(text)
    except ValueError as error:
        raise BadMessage(f"expected a time like 2026-01-31T07:05:00.000+0100, got {text[:80]!r}") from error


def _microseconds(when: datetime) -> float:
    try:
        return when.timestamp() * 1e6
    except (ValueError, OverflowError) as error:  # the first and last days of the calendar, without an offset
        raise BadMessage(f"expected a time within the calendar, got {when.isoformat()}") from error


def number(item_type: str, text: str) -> float | None:
    """The number of a legal state: what plots and SQL use. None for texts and for UNDEF and NULL.

    Switch, Contact and Player 1/0; Dimmer and Rollershutter percent; Color its brightness; DateTime microseconds
    since 1970. BadMessage when the text is not a state of that type.
    """
    if text in SPECIAL:
        return None
    kind = base_type(item_type)
    if text in STATE_WORDS.get(kind, {}):
        return STATE_WORDS[kind][text]
    if kind in WORDS:
        raise BadMessage(f"expected one of {', '.join(WORDS[kind])} for a {kind}, got {text[:80]!r}")
    if kind == "Number":
        return quantity(text)[0]
    if kind in ("Dimmer", "Rollershutter"):
        return percent(text)
    if kind == "Color":
        return color(text)[2]
    if kind == "DateTime":
        return _microseconds(moment(text))
    if kind == "Location":
        parts(text, 2, 3)
    return None


def check_state(item_type: str, text: str) -> None:
    """BadMessage when the text is not a state of that type."""
    number(item_type, text)


def check_command(item_type: str, text: str) -> None:
    """BadMessage when OpenHAB would not take the text as a command for that type."""
    kind = base_type(item_type)
    if text == "REFRESH":
        return
    if kind in NO_COMMANDS:
        raise BadMessage(f"a {kind} takes no commands; use `set` to post an update")
    if text in SPECIAL:
        raise BadMessage(f"{text} is a state, never a command; use `set`")
    words = COMMAND_WORDS.get(kind, ())
    if text in words:
        return
    if kind in WORDS:
        raise BadMessage(f"expected one of {', '.join(words)} for a {kind}, got {text[:80]!r}")
    if kind == "Color" and "," not in text:
        percent(text)
        return
    number(item_type, text)
