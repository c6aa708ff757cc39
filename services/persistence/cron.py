"""When a cron strategy fires: Quartz's expressions as openHAB reads them, over croniter, which speaks Unix cron. Pure.

Seconds come first, six or seven fields; weekdays count from 1 = Sunday; `?` is `*`; `L`, `LW`, `15W`, `6L`, `2#1` work.
An hour that the clocks skip has no firings, one that comes twice fires twice.
"""

from __future__ import annotations

import calendar
import re
from datetime import datetime, timedelta, tzinfo

from croniter import croniter
from croniter.croniter import CroniterError

NAMED = {"@hourly": "0 0 * * * *", "@daily": "0 0 0 * * *", "@weekly": "0 0 0 * * MON", "@monthly": "0 0 0 1 * *",
         "@yearly": "0 0 0 1 1 *"}  # fmt: skip
DAYS = ("SUN", "MON", "TUE", "WED", "THU", "FRI", "SAT")
DAY, WEEKDAY = 3, 5  # their fields
ANY = ("*", "?")


class Cron:
    """One expression in one time zone; ValueError says what is wrong with it."""

    def __init__(self, expression: str, zone: tzinfo) -> None:
        self._zone = zone
        self._text, self._last_weekday = _translated(expression)
        try:
            croniter(self._text, datetime(2026, 1, 1, tzinfo=zone), second_at_beginning=True)
            self.after(0.0)
        except (CroniterError, KeyError, IndexError) as error:
            raise ValueError(f"expected a cron expression like 0 */30 * * * ?, got {expression!r}: {error}") from error

    def after(self, seconds: float) -> float:
        """The first firing after a time, seconds since 1970."""
        times = croniter(self._text, datetime.fromtimestamp(seconds, self._zone), second_at_beginning=True)
        while True:
            when: datetime = times.get_next(datetime)
            if self._is_real(when) and when.timestamp() > seconds:
                return when.timestamp()

    def _is_real(self, when: datetime) -> bool:
        """croniter moves what falls into an hour that the clocks skip behind it."""
        if self._last_weekday and not _is_last_weekday(when):
            return False
        return bool(croniter.match(self._text, when.replace(tzinfo=None), second_at_beginning=True))


def _translated(expression: str) -> tuple[str, bool]:
    """The expression in croniter's words, and whether only the last weekday of a month counts."""
    fields = NAMED.get(expression.strip().lower(), expression).upper().split()
    if len(fields) not in (6, 7):
        raise ValueError(f"expected six or seven fields, seconds first, got {expression!r}")
    if fields[DAY] not in ANY and fields[WEEKDAY] not in ANY:
        raise ValueError(f"expected ? for the day of the month or of the week, got {expression!r}")
    if re.search(r"L-[0-9]", fields[DAY]):
        raise ValueError(f"expected no L-n, got {expression!r}")
    last_weekday = fields[DAY] == "LW"
    if last_weekday:
        fields[DAY] = "26-31"
    fields[WEEKDAY] = ",".join(_weekday(part) for part in fields[WEEKDAY].split(","))
    return " ".join("*" if field == "?" else field for field in fields), last_weekday


def _weekday(part: str) -> str:
    """One part of the list of weekdays: Quartz's numbers as names, `6L` as croniter's `L5`, a bare `L` as Sunday."""
    if part == "L":
        return "SUN"
    if last := re.fullmatch(r"([1-7]|[A-Z]{3})L", part):
        return f"L{DAYS.index(_name(last[1]))}"
    head, slash, step = part.partition("/")
    days, hash_, which = head.partition("#")
    named = "-".join(_name(day) for day in days.split("-"))
    return f"{named}{hash_}{which}{slash}{step}"


def _name(day: str) -> str:
    if re.fullmatch("[1-7]", day):
        return DAYS[int(day) - 1]
    if day not in (*DAYS, *ANY):
        raise ValueError(f"expected 1 (Sunday) to 7 or MON to SUN, got {day!r}")
    return day


def _is_last_weekday(when: datetime) -> bool:
    """Whether no weekday follows in the month."""
    last = calendar.monthrange(when.year, when.month)[1]
    later = (when + timedelta(days=days) for days in range(1, last - when.day + 1))
    return when.weekday() < 5 and not any(day.weekday() < 5 for day in later)
