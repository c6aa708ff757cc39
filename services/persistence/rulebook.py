"""Reads `persistence.yaml`: named cron expressions and filters, and lines that say which items are stored when.

An item that no line names is stored as `persist` in home.yaml says. Faults are told all at once, with file and line.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from services import document
from services.apartment.home import Home
from services.document import Document, Path_
from services.persistence.cron import Cron
from services.persistence.filters import Filter
from services.persistence.strategies import BUILT_IN, Line, Rule, rule
from services.section import Section

TOP = ("strategies", "filters", "items")


class Entry(Section):
    """One line: item names, `Group*` for the members of a group, `*` for all, each with `!` before it to leave out."""

    items: tuple[str, ...] = Field(min_length=1)
    strategy: tuple[str, ...] = Field(min_length=1)
    filter: tuple[str, ...] = ()


def load(file: Path, home: Home) -> dict[str, Rule]:
    """The rule of every item that the file names; ConfigError with every fault."""
    source = document.read(file)
    raw = source.value if isinstance(source.value, dict) else {}
    if not source.faults and not raw:
        source.fault((), f"expected {', '.join(TOP)}, got nothing")
    for key in raw:
        if key not in TOP:
            source.fault((key,), f"expected one of {', '.join(TOP)}, got {key!r}")
    crons = dict(_crons(_mapping(raw, "strategies", source), home, source))
    filters = {name: one for name, value in _mapping(raw, "filters", source).items()
               if (one := _model(Filter, value, ("filters", name), source))}  # fmt: skip
    lines: dict[str, list[Line]] = {}
    restored: set[str] = set()
    for index, entry in enumerate(_entries(raw, source)):
        names = list(_selected(entry, home, index, source))
        line = Line(
            *_strategies(entry, crons, index, source), tuple(_filters(entry, filters, names, home, index, source))
        )
        for name in names:
            lines.setdefault(name, []).append(line)
        restored.update(names if "restoreOnStartup" in entry.strategy else ())
    document.must(source)
    return {name: Rule(tuple(found), name in restored) for name, found in lines.items()}


def rules(home: Home, file: Path | None) -> dict[str, Rule]:
    """The rule of every item of the home: the file's, else the home's own."""
    return {**{name: rule(item.persist) for name, item in home.items.items()}, **(load(file, home) if file else {})}


def _mapping(raw: dict[str, Any], key: str, source: Document) -> dict[str, Any]:
    value = raw.get(key) or {}
    if isinstance(value, dict):
        return value
    source.fault((key,), f"expected names with a value each, got {value!r:.80}")
    return {}


def _entries(raw: dict[str, Any], source: Document) -> Iterator[Entry]:
    value = raw.get("items")
    if not isinstance(value, list):
        source.fault(("items",), "expected a list of lines with items and strategy")
        return
    for index, one in enumerate(value):
        entry = _model(Entry, one, ("items", index), source)
        yield entry or Entry(items=("!*",), strategy=("everyChange",))  # keeps the count


def _crons(named: dict[str, Any], home: Home, source: Document) -> Iterator[tuple[str, Cron]]:
    for name, expression in named.items():
        if name in BUILT_IN:
            source.fault(("strategies", name), f"expected a name that is not built in ({', '.join(BUILT_IN)})")
            continue
        try:
            yield name, Cron(str(expression), home.zone)
        except ValueError as error:
            source.fault(("strategies", name), str(error))


def _strategies(
    entry: Entry, crons: dict[str, Cron], index: int, source: Document
) -> tuple[bool, bool, tuple[tuple[str, Cron], ...]]:
    for name in entry.strategy:
        if name not in BUILT_IN and name not in crons:
            known = ", ".join([*BUILT_IN, *crons])
            source.fault(("items", index, "strategy"), f"expected of {known}, got {name!r}")
    fired = tuple((name, crons[name]) for name in entry.strategy if name in crons)
    return "everyChange" in entry.strategy, "everyUpdate" in entry.strategy, fired


def _filters(
    entry: Entry, filters: dict[str, Filter], names: Iterable[str], home: Home, index: int, source: Document
) -> Iterator[Filter]:
    where = ("items", index, "filter")
    for name in entry.filter:
        if name not in filters:
            source.fault(where, f"expected of {', '.join(filters) or 'the filters (there are none)'}, got {name!r}")
            continue
        unit = filters[name].unit
        for item in names:
            if unit is not None and home.items[item].unit != unit:
                source.fault(where, f"expected items in {unit}, as the filter {name} says, got {item}")
        yield filters[name]


def _selected(entry: Entry, home: Home, index: int, source: Document) -> Iterator[str]:
    """The items of a line, in the home's order; what is left out wins wherever it stands."""
    wanted, unwanted = set[str](), set[str]()
    for word in entry.items:
        name = word.removeprefix("!").replace(" ", "")
        found = home.named(name)
        if found is None:
            source.fault(("items", index, "items"), f"expected an item, Group* or *, got {word!r}")
            continue
        (unwanted if word.startswith("!") else wanted).update(found)
    yield from (name for name in home.items if name in wanted - unwanted)


def _model(model: type[Any], value: Any, path: Path_, source: Document) -> Any:
    try:
        return model.model_validate(value)
    except ValidationError as error:
        for fault in error.errors(include_url=False):
            text = str(fault["msg"]).replace("Value error, ", "").replace("Input should be", "expected")
            source.fault((*path, *fault["loc"]), text if ", got " in text else f"{text}, got {fault['input']!r:.80}")
        return None
