"""How often, and in which range, something is taken from ROS. Pure.

ROS 1 has no authentication: whoever reaches the master may say what he likes, so all of it is one untrusted role. The
limits stand in the rules, `most` and `ranges`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from services.bridge.rules import Fields, Rule
from services.errors import BadMessage

STOP = "stop"  # ends a motion, of a camera or of a blind; never one too many
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")


class Allowance:
    """By name so many words at once, and the same number again within a second. Times are seconds of any one clock."""

    def __init__(self) -> None:
        self._left: dict[str, tuple[float, float]] = {}  # how many more, and when that was so

    def take(self, name: str, most: float, now: float) -> None:
        """One word; BadMessage when it is one too many."""
        room = max(most, 1.0)  # also of less than one a second the first may come
        left, at = self._left.get(name, (room, now))
        left = min(room, left + max(0.0, now - at) * most)
        self._left[name] = (left - 1 if left >= 1 else left, now)
        if left < 1:
            raise BadMessage(f"expected at most {most:g} a second (`most` in the rule), got more")


def check(rule: Rule, fields: Fields, allowance: Allowance, now: float) -> None:
    """BadMessage when a robot's word is out of its rule's ranges, or one too many."""
    for name, allowed in rule.ranges.items():
        _check_range(name, fields, allowed)
    if rule.most is not None and not _stops(fields):
        allowance.take(rule.ros, rule.most, now)


def _stops(fields: Fields) -> bool:
    return any(isinstance(value, str) and value.strip().lower() == STOP for value in fields.values())


def _check_range(name: str, fields: Fields, allowed: tuple[float, float]) -> None:
    value = _named(name, fields)
    if isinstance(value, str):  # a word such as ON is in no range; `21.5 °C` is the number before it
        found = NUMBER.match(value)
        value = float(found[1]) if found else None
    if value is None:
        return
    low, high = allowed
    if not math.isfinite(value) or not low <= value <= high:
        raise BadMessage(f"expected {name} from {low:g} to {high:g} (`ranges` in the rule), got {value:g}")


def _named(name: str, fields: Mapping[str, Any]) -> float | str | None:
    """The field of that name; of a KeyValue the value, when its key has that name."""
    if name in fields:
        value = fields[name]
    else:
        value = fields.get("value") if str(fields.get("key", "")).lower() == name.lower() else None
    return float(value) if isinstance(value, int | float) else value if isinstance(value, str) else None
