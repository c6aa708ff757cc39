"""The detector's times for `make bench`: beside those of OpenCV's own detector on the same frames in the same run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rich.table import Table

from tests import bounds
from tests.vision import trials

FRAMES = range(8)
PHOTOGRAPHS = range(10_000, 10_060)


@dataclass(frozen=True)
class Row:
    """One figure; `floor` of OpenCV's detector as it comes."""

    name: str
    unit: str
    value: float
    floor: float | None
    wanted: str


def rows() -> Iterator[Row]:
    """All figures."""
    ours, theirs = trials.per_megapixel(FRAMES)
    yield Row("frames of 2304x1296", "ms/megapixel", ours, theirs, f"<= {bounds.PER_MEGAPIXEL_MS:g} ms")
    yield Row("eight frames of a place", "ms", trials.a_place(1), None, f"<= {bounds.PLACE_MS:g} ms")
    for hard, name in ((False, "photographs"), (True, "hard photographs")):
        found, known, false = trials.recall(PHOTOGRAPHS, hard=hard)
        yield Row(f"markers found in {name}", "%", 100 * found, 100 * known, "")
        yield Row(f"markers invented in {name}", "", float(false), None, "0")


def table(found: list[Row]) -> Table:
    """What people read."""
    made = Table("markers in pictures", "ours", "OpenCV's", "ratio", "wanted")
    for row in found:
        floor = "" if row.floor is None else f"{row.floor:.1f}"
        ratio = f"{row.value / row.floor:.2f}" if row.floor else ""
        made.add_row(row.name, f"{row.value:.1f} {row.unit}", floor, ratio, row.wanted)
    return made
