"""Rows whose time has not come: an import brought forecasts, or a clock was ahead for a while. Nobody goes by them.

Seconds and minutes are no such thing: a clock that is set right steps back so far, and times go on from what is there.
"""

from __future__ import annotations

from services.storage import Sample, Storage, reading
from services.storage.reading import LAST, SECOND

FAR_S = 86_400.0  # a clock that was kept over a power cut, or learnt late, is behind by less
POSSIBLE_S = 1_767_225_600.0  # 2026-01-01: a clock before that has just begun to count, and any row knows better


def believed(now: float) -> int:
    """The time (microseconds) before which a row may be what it says, when the clock says `now` (seconds)."""
    return min(round((now + FAR_S) * SECOND), LAST) if now >= POSSIBLE_S else LAST


def last_values(storage: Storage, now: float) -> tuple[dict[str, Sample], list[Sample]]:
    """The newest sample of every item that may be what it says; and of each item that has one ahead the newest."""
    newest, until = storage.last_values(), believed(now)
    odd = [sample for _, sample in sorted(newest.items()) if sample.time >= until]
    return (reading.all_before(storage, until) if odd else newest), odd


def is_alone(storage: Storage, now: float) -> bool:
    """Whether the clock is far ahead of all that is stored: it may be wrong, or the apartment was away."""
    last, _ = last_values(storage, now)
    return bool(last) and max(sample.time for sample in last.values()) < round((now - FAR_S) * SECOND)
