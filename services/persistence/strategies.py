"""When a state is worth a row, and how a start restores it. Pure.

The words are OpenHAB's. Lines come from `persistence.yaml` (`rulebook.py`), or from `persist` of an item in home.yaml.
An update that two strategies or two lines want makes one row.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import get_args

from services.apartment.home import Strategy
from services.persistence.cron import Cron
from services.persistence.filters import Filter, Kept

BUILT_IN: tuple[str, ...] = get_args(Strategy)
Value = tuple[float | None, str | None]  # number and text of a sample; numbers compare, so 21.50 °C is 21.5 °C


@dataclass(frozen=True, slots=True)
class Line:
    """What one line wants of its items: at a change, at every update, when a cron fires; if its filters agree."""

    change: bool = False
    update: bool = False
    crons: tuple[tuple[str, Cron], ...] = ()
    filters: tuple[Filter, ...] = ()

    def wants(self, *, changed: bool, retained: bool) -> bool:
        """Whether a state that came is to be stored, filters apart.

        A retained message is the broker's snapshot at a (re)connect: it tells nothing unless it differs.
        """
        return (self.change and changed) or (self.update and (changed or not retained))

    def lets(self, new: Kept, last: Kept | None) -> bool:
        """Whether all filters agree."""
        return all(one.passes(new, last) for one in self.filters)


@dataclass(frozen=True, slots=True)
class Rule:
    """What all lines want of one item."""

    lines: tuple[Line, ...]
    restore: bool
    stores: bool = field(init=False)  # whether the item is ever stored: asked for every message, so reckoned once

    def __post_init__(self) -> None:
        wanted = any(line.change or line.update or line.crons for line in self.lines)
        object.__setattr__(self, "stores", wanted)


def rule(names: Iterable[str]) -> Rule:
    """The rule of these strategies, of those that are built in."""
    wanted = set(names)
    return Rule((Line("everyChange" in wanted, "everyUpdate" in wanted),), "restoreOnStartup" in wanted)


UNKNOWN_ITEM = rule(["everyChange"])  # an item that the home's model does not have is kept, but never restored


class Timetable:
    """The cron strategies: which of them fire when. After a pause one fires once, not for all that it missed."""

    def __init__(self, rules: Mapping[str, Rule]) -> None:
        lines = (line for rule in rules.values() for line in rule.lines)
        self._crons = {name: cron for line in lines for name, cron in line.crons}
        self._next: dict[str, float] = {}

    @property
    def due(self) -> float | None:
        """When the next one fires; None while nothing does."""
        return min(self._next.values(), default=None)

    def fired(self, now: float) -> set[str]:
        """The names of those that fire now; the first call begins."""
        fired = {name for name, due in self._next.items() if now >= due}
        for name, cron in self._crons.items():
            if name in fired or name not in self._next:
                self._next[name] = cron.after(now)
        return fired


class Restore:
    """Which items get their last state back: those that the broker told nothing about after the start.

    It may have hours of messages for us, and its retained states come behind them. So a mark is said at each
    connection, after it was asked for them: all that it had is here when the mark is heard again. `due` is when to
    look, a while after that: a broker may hand out retained states beside its queue.
    """

    def __init__(self, items: Iterable[str], patience_s: float) -> None:
        self._waiting = set(items)
        self._patience_s = patience_s
        self._own: dict[str, str] = {}
        self._mark = ""
        self.due: float | None = None

    @property
    def mark(self) -> str | None:
        """What is to be said, again and again, until it is heard; None when nothing is waited for."""
        return self._mark if self._waiting and self.due is None else None

    def begin(self, mark: str) -> None:
        """A connection was made; no other one ever had this mark."""
        self._mark, self.due = mark, None

    def heard(self, mark: str | None, now: float) -> None:
        """A mark came: of this connection, or of an older one."""
        if mark and mark == self.mark:
            self.due = now + self._patience_s

    def saw(self, item: str, text: str, *, again: bool = False) -> bool:
        """A state of an item came, so it needs no restoring. True when it is the echo of our own restoring.

        `again`: it was handed to us before; whether the broker still has it, its retained states tell.
        """
        if not again:
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
