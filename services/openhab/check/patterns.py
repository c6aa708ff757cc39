"""The small languages within texts: patterns, options, cron, addresses. Pure.

Each function says what is wrong with a text, or None. Not here: what a home is written in too, in
`services/apartment/forms.py`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

CONVERSION = re.compile(
    r"%(?:unit%|%|n|(?:\d+\$|<)?[-#+ 0,(]*\d*(?:\.\d+)?(?:[tT][HIklMSLNpzZsQBbhAaCYyjmdeRTrDFc]|[bBhHsScCdoxXeEfgGaA]))"
)
TRANSFORM = re.compile(r"[A-Z0-9]+\([^()]*\):(.*)", re.S)
CREDENTIALS = re.compile(r"[a-z][a-z0-9+.-]*://[^/\s\"'?#]*@", re.I)
SECRET_PARAMETER = re.compile(r"[?&](?:password|passwd|pwd|pass|loginpas|token)=[^&\s]+", re.I)
CRON_FIELDS = (
    ("seconds", 0, 59, ()),
    ("minutes", 0, 59, ()),
    ("hours", 0, 23, ()),
    ("day of the month", 1, 31, ()),
    ("month", 1, 12, ["JAN", "FEB", "MAR", "APR", "MAY", "JUN", "JUL", "AUG", "SEP", "OCT", "NOV", "DEC"]),
    ("day of the week", 0, 7, ["SUN", "MON", "TUE", "WED", "THU", "FRI", "SAT"]),
    ("year", 1970, 2199, ()),
)


def pattern(text: str) -> str | None:
    """A pattern of states, as Java's formatter reads it, perhaps behind a transformation."""
    match = TRANSFORM.fullmatch(text)
    rest = CONVERSION.sub("", match[1] if match else text)
    if "%" in rest:
        return f"expected a pattern such as %.1f °C, with %% for a sign of percent, got {text!r}"
    return None


def options(text: str) -> str | None:
    """`state=words,...` of a state description."""
    for part in text.split(","):
        state, equals, words = part.partition("=")
        if not state.strip() or (equals and not words.strip()):
            return f"expected options like state=words, got {part!r}"
    return None


def credentials(text: str) -> str | None:
    """An address with an account in it, which everybody sees who sees the page."""
    if CREDENTIALS.search(text) or SECRET_PARAMETER.search(text):
        return "expected an address without a user or password in it"
    return None


def cron(text: str) -> str | None:
    """Six or seven fields, seconds first."""
    if text.strip().startswith("@"):
        return None
    fields = text.split()
    if not 6 <= len(fields) <= 7:
        return f"expected six or seven fields, seconds first, got {len(fields)} in {text!r}"
    for field, (name, low, high, words) in zip(fields, CRON_FIELDS, strict=False):
        for part in field.split(","):
            if not _cron_part(part, low, high, words):
                return f"expected a field for the {name} ({low} to {high}), got {part!r} in {text!r}"
    return None


def _cron_part(part: str, low: int, high: int, words: Sequence[str]) -> bool:
    span, slash, step = part.partition("/")
    if slash and not (step.isdigit() and int(step) > 0):
        return False
    if span in ("*", "?"):
        return True
    if words or high == 31:  # days and months have words and signs of their own
        span = re.sub(r"^L(-\d+)?W?$|(?<=\d)(W|L|#[1-5])$|(?<=[A-Z])(L|#[1-5])$", "", span) or str(low)
    ends = span.split("-")
    numbers = [
        words.index(end.upper()) + low if end.upper() in words else int(end) if end.isdigit() else None for end in ends
    ]
    return len(ends) <= 2 and all(one is not None and low <= one <= high for one in numbers)
