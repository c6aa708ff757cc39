"""From what came to what is written: keeps the last values and levels, and compares. Pure but for its counting.

Not here: what a message says (`rows.py`), what a strategy wants (`strategies.py`), the database (`service.py`).
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Mapping

from services.home import Home
from services.persistence import rows, strategies
from services.persistence.rows import State
from services.storage import Batch, Diagnostic, Item, Row, Sample

log = logging.getLogger(__name__)


class Decisions:
    """What of a turn is to be written. `learn` comes first: without the last values every state is a change."""

    def __init__(self, home: Home, counters: Counter[str]) -> None:
        self._home = home
        self._counters = counters
        self._rules = strategies.rules(home)
        self._last: dict[str, strategies.Value] = {}
        self._levels: dict[str, tuple[int, str]] = {}  # of components: level and message
        self._odd: set[str] = set()  # items that were told to have a value in another unit

    @property
    def restored(self) -> list[str]:
        """The items whose last state a start gives back."""
        return [name for name, rule in self._rules.items() if rule.restore]

    def learn(self, last: Mapping[str, Sample], diagnostics: Mapping[str, Diagnostic]) -> None:
        """What the last rows are: what a change is measured by."""
        self._last = {name: (sample.num, sample.text) for name, sample in last.items()}
        self._levels = {name: (row.level, row.message) for name, row in diagnostics.items()}

    def last_text(self, name: str, items: Mapping[str, Item]) -> str | None:
        """The last stored state as OpenHAB writes it; None where there is none worth restoring."""
        if name not in self._last or name not in items:
            return None
        text = rows.state_text(Sample(name, 0, *self._last[name]), items[name].unit)
        return None if text == "NULL" else text

    def new_items(self, gathered: Iterable[State | Row], known: Mapping[str, Item]) -> list[Item]:
        """Items that the database does not have, or not like this."""
        new: dict[str, Item] = {}
        for one in gathered:
            if isinstance(one, State) and self._rule(one.item).stores:
                before = new.get(one.item) or known.get(one.item)
                item = self._item(one, before)
                if before is None or (before.kind, before.unit) != (item.kind, item.unit):
                    new[one.item] = item
        return list(new.values())

    def _item(self, state: State, known: Item | None) -> Item:
        """The unit is the one that is stored, else the model's, else that of the first value."""
        model = self._home.items.get(state.item)
        if model is None and known is not None and known.kind != state.kind:
            return known  # it has left the model; what is stored keeps its meaning
        unit = None
        if state.kind == "Number":
            unit = (known and known.unit) or (model and model.unit) or state.unit or None
        return Item(state.item, state.kind, unit)

    def batch(self, gathered: Iterable[State | Row], items: Mapping[str, Item]) -> Batch:
        """What of it is to be written; from now on it counts as the last value."""
        batch = Batch()
        for one in gathered:
            if isinstance(one, State):
                self._add_state(batch, one, items)
            elif not isinstance(one, Diagnostic) or self._is_transition(one):
                batch.rows.append(one)
        return batch

    def _add_state(self, batch: Batch, state: State, items: Mapping[str, Item]) -> None:
        rule = self._rule(state.item)
        if not rule.stores:
            return
        sample, odd = rows.sample(state, items[state.item].unit)
        if not strategies.is_wanted(
            rule, (sample.num, sample.text), self._last.get(state.item), retained=state.retained
        ):
            return
        if odd:
            self._count_odd(odd, state, items[state.item].unit)
        self._last[state.item] = (sample.num, sample.text)
        batch.samples.append(sample)

    def _count_odd(self, odd: str, state: State, unit: str | None) -> None:
        self._counters[odd] += 1
        if state.item not in self._odd:
            self._odd.add(state.item)
            log.warning("%s: %.80r is kept as text, its numbers are in %s", state.item, state.text, unit or "no unit")

    def _is_transition(self, row: Diagnostic) -> bool:
        changed = self._levels.get(row.component) != (row.level, row.message)
        self._levels[row.component] = (row.level, row.message)
        return changed

    def _rule(self, name: str) -> strategies.Rule:
        return self._rules.get(name, strategies.UNKNOWN_ITEM)
