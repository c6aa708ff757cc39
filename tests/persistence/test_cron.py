"""Quartz's cron expressions as openHAB reads them; the expected times are those of openHAB's own tests and tables."""

from __future__ import annotations

from datetime import datetime
from zoneinfo import ZoneInfo

import pytest

from services.persistence.cron import Cron

MADRID = ZoneInfo("Europe/Madrid")


def at(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=MADRID).timestamp()


def firings(expression: str, since: str, count: int) -> list[str]:
    cron, now, found = Cron(expression, MADRID), at(since), []
    for _ in range(count):
        now = cron.after(now)
        found.append(datetime.fromtimestamp(now, MADRID).strftime("%Y-%m-%d %H:%M:%S"))
    return found


FIRINGS = [
    ("0 */30 * * * ?", "2026-01-31 06:10", ["2026-01-31 06:30:00", "2026-01-31 07:00:00"]),
    ("0 0 0 ? * MON-FRI *", "2026-03-27 12:00", ["2026-03-30 00:00:00", "2026-03-31 00:00:00"]),
    ("0 0 0 ? * 2-6", "2026-03-27 12:00", ["2026-03-30 00:00:00", "2026-03-31 00:00:00"]),  # 1 is Sunday
    ("0 0 0 ? * 1", "2026-03-27 12:00", ["2026-03-29 00:00:00"]),
    ("0 0 0 L * ?", "2026-02-01 12:00", ["2026-02-28 00:00:00", "2026-03-31 00:00:00"]),
    ("0 0 12 LW * ?", "2026-02-01 12:00", ["2026-02-27 12:00:00", "2026-03-31 12:00:00", "2026-04-30 12:00:00",
                                           "2026-05-29 12:00:00"]),
    ("0 0 0 15W 8 ?", "2026-08-01 12:00", ["2026-08-14 00:00:00"]),
    ("0 0 0 1W 8 ?", "2026-07-15 12:00", ["2026-08-03 00:00:00"]),
    ("0 0 0 ? * 2#1", "2026-03-10 12:00", ["2026-04-06 00:00:00"]),
    ("0 0 0 ? * MON#1", "2026-03-10 12:00", ["2026-04-06 00:00:00"]),
    ("0 0 0 ? * 6L", "2026-03-10 12:00", ["2026-03-27 00:00:00"]),
    ("0 0 0 ? * L", "2026-03-10 12:00", ["2026-03-15 00:00:00"]),
    ("0 0 22-2 * * ?", "2026-03-10 12:00", ["2026-03-10 22:00:00", "2026-03-10 23:00:00", "2026-03-11 00:00:00"]),
    ("0 0 0 ? * SAT-MON", "2026-03-11 12:00", ["2026-03-14 00:00:00", "2026-03-15 00:00:00", "2026-03-16 00:00:00",
                                               "2026-03-21 00:00:00"]),
    ("0 1/10 * * * ?", "2026-03-11 12:00", ["2026-03-11 12:01:00", "2026-03-11 12:11:00"]),
    ("@weekly", "2026-03-11 12:00", ["2026-03-16 00:00:00"]),
    ("0 0 2 * * ?", "2026-03-28 12:00", ["2026-03-30 02:00:00"]),  # there is no 02:00 on the 29th
    ("0 30 2 * * ?", "2026-10-24 12:00", ["2026-10-25 02:30:00", "2026-10-25 02:30:00", "2026-10-26 02:30:00"]),
]  # fmt: skip


@pytest.mark.parametrize(("expression", "since", "wanted"), FIRINGS, ids=[row[0] for row in FIRINGS])
def test_it_fires_when_openhab_would(expression: str, since: str, wanted: list[str]) -> None:
    assert firings(expression, since, len(wanted)) == wanted


@pytest.mark.parametrize(
    "wrong",
    ["*/30 * * * *", "0 0 0 1 * MON", "0 0 0 L-3 * ?", "0 0 0 ? * 8", "0 99 * * * ?", "often", "0 0 0 ? * MOO", ""],
)
def test_what_cannot_fire_is_told(wrong: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        Cron(wrong, MADRID)
