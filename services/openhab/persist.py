"""The persistence file, for those who keep OpenHAB's own database. Pure.

Named after OpenHAB's service (`jdbc.persist`, `mysql.persist`). Items with the same strategies share a line.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from services.openhab.check.persist import BUILT_IN, Persisted
from services.openhab.lines import name
from services.openhab.site import Site
from services.openhab.words import PERSIST_WORDS

WIDTH = 100


def text(site: Site) -> str:
    """The whole file; without `default`, which 5.1 refuses, and with the block of strategies, which 5.0 wants."""
    body = [f"    {line}" for line in _lines(site)]
    return "\n".join(["Strategies {", "}", "", "Items {", *body, "}", ""])


def _lines(site: Site) -> Iterator[str]:
    by_strategies: dict[tuple[str, ...], list[str]] = {}
    for item_name, item in site.home.items.items():
        if item.persist:
            by_strategies.setdefault(item.persist, []).append(name(item_name, PERSIST_WORDS))
    for strategies, names in by_strategies.items():
        yield f"{_wrapped(names)} : strategy = {', '.join(strategies)}"


def _wrapped(names: list[str]) -> str:
    """Names with commas between, no line much longer than `WIDTH`."""
    lines = [""]
    for one in names:
        if lines[-1] and len(lines[-1]) + len(one) > WIDTH:
            lines.append("")
        lines[-1] += f"{', ' if lines[-1] else ''}{one}"
    return ",\n        ".join(lines)


def strategies_of(item: str, groups: Collection[str], files: Iterable[Persisted]) -> tuple[str, ...] | None:
    """The strategies of OpenHAB's own that files give an item, in a fixed order; None when no file says anything.

    What is restored is stored at changes too: by cron alone a home cannot say it, and alone it restores from nothing.
    """
    found: set[str] = set()
    said = False
    for stored in files:
        said = True
        for names, strategies in stored.strategies:
            if item in names or "*" in names or any(f"{group}*" in names for group in groups):
                found |= set(strategies)
    if "restoreOnStartup" in found and "everyUpdate" not in found:
        found.add("everyChange")
    return tuple(one for one in BUILT_IN if one in found) if said else None
