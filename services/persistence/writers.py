"""Several writers on one bus: who takes what, and whose times are which. Pure.

Split `by: item`, each takes its own items of the home's model: order, filters and restoring stay as with one writer.
With `by: share` the broker deals the states out (`$share`), whatever their items are: an item's values then go to
different writers, so there is no order among them, and nothing may depend on an item's last value.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, Self
from zlib import crc32

from pydantic import Field, model_validator

from services import topics
from services.apartment.home import Home
from services.persistence import strategies
from services.persistence.rows import State
from services.persistence.strategies import Line, Rule
from services.section import Section
from services.storage import Row
from services.topics import HOME_STATE

SHARED = f"$share/persistence/{HOME_STATE.filter}"
EVERY_UPDATE = strategies.rule(["everyUpdate"])


class Writers(Section):
    """How many there are, which of them this one is (from 0), and how they divide the states of items.

    All else that is stored (scans, orders, missions, diagnostics) is for number 0.
    """

    count: int = Field(default=1, ge=1, le=64)
    number: int = Field(default=0, ge=0)
    by: Literal["item", "share"] = "item"

    @model_validator(mode="after")
    def is_one_of_them(self) -> Self:
        if self.number >= self.count:
            raise ValueError(f"expected a number below {self.count}, got {self.number}")
        return self

    @property
    def shared(self) -> bool:
        """Whether the broker deals the states out."""
        return self.count > 1 and self.by == "share"

    def name(self, service: str) -> str:
        """Of this writer in the database and in the diagnostics."""
        return f"{service}-{self.number}" if self.number else service

    def filters(self, home: Home) -> tuple[str, ...]:
        """What it subscribes to."""
        others = tuple(row.filter for row in topics.TABLE if row.stored and row is not HOME_STATE)
        if self.count == 1:
            states: tuple[str, ...] = (HOME_STATE.filter,)
        elif self.shared:
            states = (SHARED,)
        else:
            states = tuple(HOME_STATE.name(item=name) for name in home.items if self._has(name))
        return (*states, *others) if self.number == 0 else states

    def takes(self, row: State | Row) -> bool:
        """Whether it is this one's to store: a kept session may still hold what it was subscribed to before.

        Where states are dealt out, a retained one (of a reconnect) is of what another writer may have stored.
        """
        if self.count == 1:
            return True
        if not isinstance(row, State):
            return self.number == 0
        return self._has(row.item) and not (self.shared and row.retained)

    def _has(self, item: str) -> bool:
        return self.shared or crc32(item.encode()) % self.count == self.number

    def rules(self, rules: Mapping[str, Rule]) -> dict[str, Rule]:
        """Those of its items."""
        return {name: rule for name, rule in rules.items() if self._has(name)}

    @property
    def unknown(self) -> Rule:
        """The rule of an item that the home's model does not have."""
        return EVERY_UPDATE if self.shared else strategies.UNKNOWN_ITEM

    def unfit(self, rules: Mapping[str, Rule]) -> list[str]:
        """The items whose rule needs their last value, where the broker deals the states out."""
        kept = [(name, one) for name, one in rules.items() if self.shared and (one.restore or one.stores)]
        return [name for name, one in kept if one.restore or any(line != Line(update=True) for line in one.lines)]

    def next_time(self, at: int, last: int) -> int:
        """The first of this writer's microseconds from `at` on, and after `last`: no two writers have one in common."""
        wanted = max(at, last + 1)
        return wanted + (self.number - wanted) % self.count
