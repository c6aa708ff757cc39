"""The mission in random flats for `make bench`: with the house's camera, and the same without it, in virtual time.

Two of the flats are repeated on real parts, beside the virtual time that they take there. The seeds repeat all of it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import mean
from typing import Any

from rich.table import Table

from tests.mission import flats, real_flat

SEEDS = range(1, 21)
REPEATED = (5, 6)  # on real parts
AGREE = (0.85, 1.15)  # real over virtual time


@dataclass(frozen=True)
class Row:
    """One flat: what the marker is at, how both missions ended and after how long, seconds."""

    seed: int
    where: str
    house: str
    house_s: float
    sighted: bool
    alone: str
    alone_s: float


@dataclass(frozen=True)
class Repeated:
    """One flat on real parts, pictures small so that they can be drawn in time."""

    seed: int
    state: str
    real_s: float
    virtual_s: float

    @property
    def ratio(self) -> float:
        """Real over virtual time."""
        return self.real_s / self.virtual_s


@dataclass(frozen=True)
class Figures:
    """All of it."""

    rows: tuple[Row, ...]
    repeated: tuple[Repeated, ...]

    def found(self, *, house: bool) -> int:
        """In how many flats the marker was found."""
        return sum((one.house if house else one.alone) == "found" for one in self.rows)

    def mean_s(self, *, house: bool) -> float:
        """Of the flats in which both find it."""
        both = [one for one in self.rows if one.house == one.alone == "found"]
        return mean(one.house_s if house else one.alone_s for one in both)

    def each_s(self, *, house: bool) -> float:
        """Seconds of all missions, also those in vain, for each marker that was found."""
        return sum(one.house_s if house else one.alone_s for one in self.rows) / self.found(house=house)


def row(seed: int) -> Row:
    """Both missions of a flat."""
    flat = flats.flat(seed)
    house, alone = flats.mission(flat, house=True), flats.mission(flat, house=False)
    where = f"{flat.model.marker(flats.TARGET).where}, {flat.model.marker(flats.TARGET).room}"
    return Row(seed, where, house.result.state, house.seconds, house.sighted, alone.result.state, alone.seconds)


def repeated(seed: int) -> Repeated:
    """A flat on real parts; peers.Missing where there is no mosquitto."""
    flat = flats.flat(seed)
    virtual = flats.mission(flat, house=True, small=True)
    with tempfile.TemporaryDirectory() as folder:
        real = real_flat.mission(flat, Path(folder))
    assert real.state == virtual.result.state, (real, virtual.result)
    return Repeated(seed, real.state, real.elapsed_s, virtual.seconds)


def figures(seeds: Iterable[int] = SEEDS, again: Iterable[int] = REPEATED) -> Figures:
    """All figures."""
    return Figures(tuple(map(row, seeds)), tuple(map(repeated, again)))


def table(found: Figures) -> Table:
    """What people read."""
    title = "mission: a marker in random flats, virtual time, with the house's camera and without"
    made = Table(
        "flat (seed)", "marker at", "with the house", "s", "seen by it", "robot alone", "s", "ratio", title=title
    )
    for one in found.rows:
        made.add_row(
            str(one.seed), one.where, one.house, f"{one.house_s:.1f}", "yes" if one.sighted else "no",
            one.alone, f"{one.alone_s:.1f}", f"{one.house_s / one.alone_s:.2f}",
        )  # fmt: skip
    count = len(found.rows)
    house, alone = (found.found(house=which) for which in (True, False))
    made.add_section()
    made.add_row("all", "found", f"{house} of {count}", "", "", f"{alone} of {count}", "", f"{house / alone:.2f}")
    for what, figure in (("mean where both find it", found.mean_s), ("time for each one found", found.each_s)):
        with_house, without = figure(house=True), figure(house=False)
        made.add_row("all", what, "", f"{with_house:.1f}", "", "", f"{without:.1f}", f"{with_house / without:.2f}")
    for again in found.repeated:
        name = f"{again.seed}, real parts"
        wanted = "{:.2f} to {:.2f} wanted, of virtual".format(*AGREE)
        made.add_row(name, wanted, again.state, f"{again.real_s:.1f}", "", "", f"{again.virtual_s:.1f}",
                     f"{again.ratio:.2f}")  # fmt: skip
    return made


def plain(found: Figures) -> Iterator[dict[str, Any]]:
    """The same for programs."""
    yield from map(asdict, found.rows)
    yield from ({**asdict(one), "ratio": one.ratio} for one in found.repeated)
