"""The table of topics as a page for people: `bus_topics.md`."""

from __future__ import annotations

from collections.abc import Iterable

from services.topic import STALE_AFTER_S, Topic
from services.topics import TABLE


def markdown(rows: Iterable[Topic] = TABLE) -> str:
    """`bus_topics.md`: the table for people."""
    lines = [
        "# Topics of the bus",
        "",
        "Written by `apartment topics --write` from `services/topics/`; a test keeps them equal. Kinds: **state**",
        "(retained, QoS 1), **event** and **command** (not retained, QoS 1; a retained command, or one older than",
        f"{STALE_AFTER_S:.0f} s, is refused), **blob** (QoS 0). Payloads that are not text are the models of",
        "`services/payloads/`. Who asks for an answer by MQTT 5's response topic names one below `reply/`: there, and",
        "nowhere else, the access list that we ship lets every service answer.",
        "",
        "| Topic | Kind | Payload | Stored | Written by | Read by | Meaning |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        payload = {str: "text", bytes: "JPEG"}.get(row.payload, f"`{row.payload.__name__}`")
        lines.append(
            f"| `{row.pattern}` | {row.kind.value} | {payload} | {'yes' if row.stored else ''} "
            f"| {_listed(row.writers)} | {_listed(row.readers)} | {row.meaning} |"
        )
    return "\n".join(lines) + "\n"


def _listed(roles: tuple[str, ...]) -> str:
    return ", ".join(f"`{role}`" for role in roles)
