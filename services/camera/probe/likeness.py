"""Which of the firmwares that have a name a camera is like, by the ways that were seen of it. Pure.

It is given the names: those of the simulated camera's profiles, which the camera service does not import.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

Known = Mapping[str, Mapping[str, Any]]  # name -> switch -> value
MEASURED = ("tilt_share", "position_abs_tilt_off")  # numbers of one camera, not ways of a firmware
STRANGE = 0.25  # of the ways: with more that differ it is another family; those that have names mostly differ by more


@dataclass(frozen=True)
class Likeness:
    """The nearest name, of how many ways, and in which of them the camera differs: what was seen, what is theirs."""

    name: str
    compared: int
    differs: dict[str, tuple[Any, Any]]
    known: bool  # near enough to be called that


def nearest(seen: Mapping[str, Any], known: Known) -> Likeness | None:
    """The firmware that differs in the fewest of the ways that were seen; None when there is nothing to compare."""
    ways = {key: value for key, value in seen.items() if value is not None and key not in MEASURED}
    each = [
        (name, {key: (ways[key], theirs[key]) for key in shared if ways[key] != theirs[key]}, len(shared))
        for name, theirs in known.items()
        if (shared := [key for key in ways if key in theirs])
    ]
    if not each:
        return None
    name, differs, compared = min(each, key=lambda one: len(one[1]))
    return Likeness(name, compared, differs, known=len(differs) <= STRANGE * compared)
