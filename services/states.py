"""OpenHAB's string forms: which texts are states and commands of which item type, and their number.

Sources: openhab-core `library/types` and `library/items` (`toString`, accepted types per item). Pure.
"""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime, tzinfo
from decimal import Decimal
from zoneinfo import ZoneInfo

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
MILLIS_FROM_DIGITS = 12  # an epoch with fewer digits is in seconds, as DateTimeType reads it
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
# A unit begins with a letter or a sign such as % or °, not with a digit or a comma: `1.2.3` and `21,5` are no numbers.
_QUANTITY = re.compile(rf"({_NUMBER.pattern})(?: ?([^\W\d_]\S*|[%°′″'\"]\S*))?")
_DATE = r"[0-9]{4}-[0-9]{2}-[0-9]{2}"
_TIME = r"[0-9]{2}:[0-9]{2}(?::[0-9]{2}(?:\.[0-9]{1,9})?)?"
_ZONE = r" ?(?:(Z|[+-][0-9]{2}(?::?[0-9]{2})?)|([A-Z][A-Za-z_]+(?:/[A-Z][A-Za-z_]+)*))"
_MOMENT = re.compile(rf"(?:({_DATE})(?:[T ]({_TIME}))?|({_TIME}))(?:{_ZONE})?")
_EPOCH = re.compile(r"-?([0-9]{1,15})")


def base_type(item_type: str) -> str:
    """`Number` of `Number:Temperature`."""
    return item_type.partition(":")[0]


def quantity(text: str) -> tuple[float, str]:
    """Number and unit (empty when there is none) of `21.5 °C`; BadMessage when it is not one."""
    match = _QUANTITY.fullmatch(text)
    if not match:
        raise BadMessage(f"expected a number, optionally with a unit, got {text[:80]!r}")
    unit = match.group(4) or ""
    return _finite(match.group(1)), "" if unit == "one" else unit


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise BadMessage(f"expected a number that fits 64 bits, got {text[:80]!r}")
    return value


def plain(value: float) -> str:
    """A finite number as OpenHAB writes it: `21.5`, `21`, never with an exponent."""
    return str(int(value)) if value.is_integer() else format(Decimal(repr(value)), "f")


def parts(text: str, lowest: int, highest: int) -> list[float]:
    """The numbers of a comma list (`120,100,50`); BadMessage when there are fewer or more than wanted."""
    fields = text.split(",")
    if not lowest <= len(fields) <= highest or not all(_NUMBER.fullmatch(part.strip()) for part in fields):
        raise BadMessage(f"expected {lowest} to {highest} numbers with commas between, got {text[:80]!r}")
    return [_finite(part) for part in fields]


def color(text: str) -> tuple[float, float, float]:
    """Hue 0..360, saturation and brightness 0..100."""
    hue, saturation, brightness = parts(text, 3, 3)
    if not (0 <= hue <= 360 and 0 <= saturation <= 100 and 0 <= brightness <= 100):
        raise BadMessage(f"expected hue 0..360, saturation and brightness 0..100, got {text!r}")
    return hue, saturation, brightness


def percent(text: str) -> float:
    """A number from 0 to 100, without a sign of percent: OpenHAB's PercentType has no unit."""
    value, unit = quantity(text)
    if unit or not 0 <= value <= 100:
        raise BadMessage(f"expected 0 to 100, got {text[:80]!r}")
    return value


def moment(text: str, zone: tzinfo | None = None) -> datetime:
    """A time in any form that OpenHAB reads, such as its own `2026-01-31T07:05:00.000+0100`; always with an offset.

    A text without one is in `zone` (None: this machine's); a time alone belongs to 1970-01-01, as in DateTimeType.
    BadMessage when it is none of them, or no such time.
    """
    match = _MOMENT.fullmatch(text)
    try:
        if _EPOCH.fullmatch(text):
            return _from_epoch(int(text), zone)
        if match:
            date, time, only_time, offset, name = match.groups()
            when = datetime.fromisoformat(f"{date or '1970-01-01'}T{time or only_time or '00:00'}{offset or ''}")
            where = ZoneInfo(name) if name else zone
            when = when if when.tzinfo else when.replace(tzinfo=where) if where else when.astimezone()
            when.timestamp()
            return when
    except (ValueError, OverflowError, KeyError, OSError) as error:
        raise BadMessage(f"expected a time that exists, got {text[:80]!r}: {error}") from error
    raise BadMessage(f"expected a time like 2026-01-31T07:05:00.000+0100, got {text[:80]!r}")


def _from_epoch(count: int, zone: tzinfo | None) -> datetime:
    in_seconds = len(str(abs(count))) < MILLIS_FROM_DIGITS
    return datetime.fromtimestamp(count if in_seconds else count / 1000, UTC).astimezone(zone)


def moment_text(when: datetime) -> str:
    """OpenHAB's own form of a time that has an offset: milliseconds, and the offset without a colon."""
    if when.utcoffset() is None:
        raise ValueError(f"expected a time with an offset, got {when}")
    return when.replace(tzinfo=None).isoformat(timespec="milliseconds") + f"{when:%z}"[:5]


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
