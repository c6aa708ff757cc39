"""What the doctor found: a part, whether it is well, and how it is mended. Pure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at; `mend` where it is not well."""

    part: str
    good: bool
    what: str
    mend: str = ""


def well(part: str, what: str) -> Finding:
    """Nothing to do."""
    return Finding(part, True, what)


def ill(part: str, what: str, mend: str) -> Finding:
    """Something to do."""
    return Finding(part, False, what, mend)
