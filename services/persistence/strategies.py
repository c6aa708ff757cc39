"""When a state is worth a row, and how a start restores it. Pure.

The words are OpenHAB's (`persist` of an item in home.yaml). An update that two strategies want makes one row.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from services.home import Home

STRATEGIES = ("everyChange", "everyUpdate", "restoreOnStartup")
Value = tuple[float | None, str | None]  # number and text of a sample; numbers compare, so 21.50 °C is 21.5 °C


@dataclass(frozen=True, slots=True)
class Rule:
    """What an item's strategies want."""

    change: bool
    update: bool
    restore: bool

    @property
    def stores(self) -> bool:
        """Whether the item is ever stored."""
        return self.change or self.update


def rule(names: Iterable[str]) -> Rule:
    """The rule of these strategies."""
    wanted = set(names)
    return Rule("everyChange" in wanted, "everyUpdate" in wanted, "restoreOnStartup" in wanted)


UNKNOWN_ITEM = rule(["everyChange"])  # an item that the home's model does not have is kept, but never restored


def rules(home: Home) -> dict[str, Rule]:
    """The rule of every item of the home."""
    return {name: rule(item.persist) for name, item in home.items.items()}


def faults(home: Home) -> Iterator[str]:
    """The strategies that nobody knows."""
    for name, item in home.items.items():
        for strategy in item.persist:
            if strategy not in STRATEGIES:
                yield f"items.{name}.persist: expected of {', '.join(STRATEGIES)}, got {strategy!r}"


def is_wanted(rule: Rule, value: Value, last: Value | None, *, retained: bool) -> bool:
    """Whether to store a state that came; `last` is the item's last stored value.

    A retained message is the broker's snapshot at a (re)connect: it tells nothing unless it differs.
    """
    if not rule.stores:
        return False
    return value != last or (rule.update and not retained)


class Restore:
    """Which items get their last state back: those that the broker told nothing about for a while after the start.

    `due` is when to look; it is set by the first message, which shows that there is a broker.
    """

    def __init__(self, items: Iterable[str], patience_s: float) -> None:
        self._waiting = set(items)
        self._patience_s = patience_s
        self._own: dict[str, str] = {}
        self.due: float | None = None

    def begin(self, now: float) -> None:
        """A message came."""
        if self.due is None and self._waiting:
            self.due = now + self._patience_s

    def saw(self, item: str, text: str) -> bool:
        """A state of an item came, so it needs no restoring. True when it is the echo of our own restoring."""
        self._waiting.discard(item)
        return self._own.pop(item, None) == text

    def missing(self, now: float) -> list[str]:
        """The items to restore now, once."""
        if self.due is None or now < self.due:
            return []
        missing, self._waiting, self.due = sorted(self._waiting), set(), None
        return missing

    def says(self, item: str, text: str) -> None:
        """We publish a state, and will receive it."""
        self._own[item] = text
