"""From what came to what is written: keeps the last values and levels, and compares. Pure but for its counting.

Not here: what a message says (`rows.py`), what a strategy wants (`strategies.py`), the database (`service.py`).
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Set

from services.apartment.home import Home
from services.persistence import rows, strategies
from services.persistence.again import Again
from services.persistence.filters import Kept
from services.persistence.rows import State
from services.persistence.strategies import Rule
from services.states import SPECIAL
from services.storage import Batch, CameraOrder, Diagnostic, Item, Mission, Row, Sample

log = logging.getLogger(__name__)


class Decisions:
    """What of a turn is to be written. `learn` comes first: without the last values every state is a change."""

    def __init__(self, home: Home, rules: Mapping[str, Rule], counters: Counter[str], unknown: Rule) -> None:
        self._home = home
        self._unknown = unknown  # the rule of an item that the home's model does not have
        self._counters = counters
        self._rules = rules
        self._last: dict[str, strategies.Value] = {}  # as heard, else as stored: what a change is measured by
        self._stored: dict[str, Sample] = {}
        self._heard: dict[str, State] = {}  # what a cron strategy stores
        self._passed: dict[tuple[str, int], Kept] = {}  # by item and line: what the filters compare with
        self._levels: dict[str, tuple[int, str]] = {}  # of components: level and message
        self.again = Again()
        self._odd: set[str] = set()  # items of which a value in another unit was told

    @property
    def restored(self) -> list[str]:
        """The items whose last state a start gives back."""
        return [name for name, rule in self._rules.items() if rule.restore]

    def learn(self, last: Mapping[str, Sample], diagnostics: Mapping[str, Diagnostic]) -> None:
        """What the last rows are: what a change is measured by."""
        self._stored = dict(last)
        self._last = {name: (sample.num, sample.text) for name, sample in last.items()}
        self._levels = {name: (row.level, row.message) for name, row in diagnostics.items()}

    def last_text(self, name: str, items: Mapping[str, Item]) -> str | None:
        """The last stored state as OpenHAB writes it; None where there is none worth restoring."""
        if name not in self._stored or name not in items:
            return None
        text = rows.state_text(self._stored[name], items[name].unit)
        return None if text == "NULL" else text

    def new_items(self, gathered: Iterable[State | Row], known: Mapping[str, Item]) -> list[Item]:
        """Items that the database does not have, or not like this."""
        new: dict[str, Item] = {}
        for one in gathered:
            if isinstance(one, State) and self._rule(one.item).stores:
                before = new.get(one.item) or known.get(one.item)
                if before is None:
                    new[one.item] = Item(one.item, one.kind, self._unit(one))
                elif before.kind != one.kind and one.item in self._home.items:  # else it has left the model
                    new[one.item] = Item(one.item, one.kind, (one.kind == "Number" and before.unit) or self._unit(one))
                elif not before.unit and before.kind == one.kind and (unit := self._unit(one)):
                    new[one.item] = Item(one.item, one.kind, unit)
        return list(new.values())

    def _unit(self, state: State) -> str | None:
        """Of an item that has none yet: the model's, else that of the first value."""
        if state.kind != "Number":
            return None
        model = self._home.items.get(state.item)
        return (model and model.unit) or state.unit or None

    def batch(self, gathered: Iterable[State | Row], items: Mapping[str, Item]) -> Batch:
        """What of it is to be written; from now on it counts as the last value."""
        batch = Batch()
        for one in gathered:
            if isinstance(one, State):
                self._add_state(batch, one, items)
            elif isinstance(one, CameraOrder):
                batch.rows.append(self.again.order(one))
            elif isinstance(one, Mission):
                batch.rows.append(self.again.mission(one))
            elif not isinstance(one, Diagnostic) or self._is_transition(one):
                batch.rows.append(one)
        return batch

    def heard(self, state: State) -> None:
        """The echo of a restored state: nothing to store, but what the item is now."""
        self._heard[state.item] = state

    def fired(self, names: Set[str], items: Mapping[str, Item], next_time: Callable[[], int]) -> Batch:
        """What cron strategies store when they fire: the present states, changed or not, but never UNDEF and NULL."""
        batch = Batch()
        for name, state in self._heard.items() if names else ():
            rule = self._rule(name)
            lines = [n for n, line in enumerate(rule.lines) if any(cron in names for cron, _ in line.crons)]
            if lines and name in items and state.text not in SPECIAL:
                again = state._replace(time=next_time())
                if self._passes(again, rule, lines):
                    self._keep(batch, again, rows.sample(again, items[name].unit), items[name].unit)
        return batch

    def _add_state(self, batch: Batch, state: State, items: Mapping[str, Item]) -> None:
        rule = self._rule(state.item)
        if not rule.stores:
            return
        unit = items[state.item].unit
        sample = rows.sample(state, unit)
        value = (sample.num, sample.text)
        changed = value != self._last.get(state.item)
        self._last[state.item], self._heard[state.item] = value, state
        lines = [n for n, line in enumerate(rule.lines) if line.wants(changed=changed, retained=state.retained)]
        if lines and self._passes(state, rule, lines):
            self._keep(batch, state, sample, unit)

    def _passes(self, state: State, rule: Rule, lines: Iterable[int]) -> bool:
        """Whether the filters of one of these lines agree; each that does remembers the state."""
        passed = False
        for number in lines:
            line = rule.lines[number]
            if not line.filters:
                passed = True
                continue
            new = Kept(state.kind, state.num, state.text, state.time)
            if line.lets(new, self._before(state, number)):
                self._passed[state.item, number] = new
                passed = True
        return passed

    def _before(self, state: State, number: int) -> Kept | None:
        """What passed a line last; after a start what was stored last."""
        stored = self._stored.get(state.item)
        if (passed := self._passed.get((state.item, number))) is not None or stored is None:
            return passed
        return Kept(state.kind, stored.num, stored.text or "", stored.time)

    def _keep(self, batch: Batch, state: State, sample: Sample, unit: str | None) -> None:
        if sample.num is None and state.num is not None:
            self._count_mismatch(state, unit)
        self._stored[state.item] = sample
        batch.samples.append(sample)

    def _count_mismatch(self, state: State, unit: str | None) -> None:
        self._counters["unit_mismatch"] += 1
        if state.item not in self._odd:
            self._odd.add(state.item)
            log.warning("%s: %.80r is kept as text, its numbers are in %s", state.item, state.text, unit)

    def _is_transition(self, row: Diagnostic) -> bool:
        changed = self._levels.get(row.component) != (row.level, row.message)
        self._levels[row.component] = (row.level, row.message)
        return changed

    def _rule(self, name: str) -> strategies.Rule:
        return self._rules.get(name, self._unknown)
