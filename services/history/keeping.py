"""How long what is kept: raw samples for a while, then their means. One small piece at a time, so that writing goes on.

Only numbers become means; what says something by its text (switches, doors, texts) is kept whole, and so is the newest
sample of every item, which restoring needs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pydantic import Field, field_validator

from services.apartment.home import Home
from services.section import Section
from services.storage import Item, Storage, keeping, reading

NUMBERS = ("Number", "Dimmer", "Rollershutter")
PIECE_S = 86_400  # of one item: 1,440 samples at one a minute
PIECE = 2000  # rows deleted at once
LATE_S = 300  # a sample may come so late: a writer that waited for the database has its times from before
UNITS_S = {"s": 1, "m": 60, "h": 3600, "d": 86_400, "w": 604_800, "y": 31_557_600}


def length_s(text: str) -> int:
    """Seconds of `5m`, `90d`, `2y`; ValueError when it is no length."""
    number, unit = text[:-1], text[-1:]
    if unit not in UNITS_S or not number.isdigit() or not int(number):
        raise ValueError(f"expected a length such as 5m, 90d or 2y, got {text!r}")
    return int(number) * UNITS_S[unit]


class Keep(Section):
    """One line: which items, how long their samples are kept (`raw`), and means by width, each with its own length."""

    items: tuple[str, ...] = Field(min_length=1)  # names, Group*, *
    raw: str
    means: dict[str, str] = Field(default={}, validate_default=True)  # width -> how long, or `forever`

    @field_validator("raw")
    @classmethod
    def is_a_length(cls, text: str) -> str:
        length_s(text)
        return text

    @field_validator("means")
    @classmethod
    def are_lengths(cls, means: dict[str, str]) -> dict[str, str]:
        for width, kept in means.items():
            if kept != "forever" and length_s(kept) < length_s(width):
                raise ValueError(f"expected a longer time than {width}, got {kept!r}")
            length_s(width)
        return means


def by_item(lines: tuple[Keep, ...], home: Home) -> dict[str, Keep]:
    """The line of every item; the last that names it counts. ValueError for a name that the home has not."""
    found: dict[str, Keep] = {}
    for line in lines:
        for word in line.items:
            names = home.named(word.replace(" ", ""))
            if names is None:
                raise ValueError(f"expected an item, Group* or *, got {word!r}")
            found.update(dict.fromkeys(names, line))
    return found


def pieces(storage: Storage, lines: Mapping[str, Keep], now: float) -> Iterator[int]:
    """One round over all items; each step does one piece and tells how many rows it was."""
    for name, item in reading.items(storage).items():
        line = lines.get(name)
        if line is not None and item.kind in NUMBERS:
            yield from _of_item(storage, item, line, int(now))


def _of_item(storage: Storage, item: Item, line: Keep, now: int) -> Iterator[int]:
    until = now - length_s(line.raw)
    for text, kept in line.means.items():
        width = length_s(text)
        oldest = 0 if kept == "forever" else max(now - length_s(kept), 0) // width * width
        closed = (now - LATE_S) // width * width
        yield from _make_means(storage, item, width, oldest, closed)
        made = reading.made(storage, item, width)
        until = min(until, made[1] if made else closed)
        if oldest:
            yield keeping.forget(storage, item, width, oldest)
    while cleared := keeping.clear(storage, item, until, PIECE, now):
        yield cleared


def _make_means(storage: Storage, item: Item, width: int, oldest: int, closed: int) -> Iterator[int]:
    """From the oldest that are wanted to the last interval that nothing is added to any more (`closed`).

    Those before the first one that there is come from samples that were brought along later.
    """
    made = reading.made(storage, item, width)
    spans = ((oldest, made[0]), (made[1], closed)) if made else ((oldest, closed),)
    for since, until in spans:
        yield from _summarised(storage, item, width, since, until)


def _summarised(storage: Storage, item: Item, width: int, since: int, until: int) -> Iterator[int]:
    """Piece by piece; gaps are stepped over."""
    at = since
    while (first := keeping.next_sample(storage, item, at)) is not None and first < until:
        begin = max(at, first // width * width)
        at = min(until, begin + max(PIECE_S // width, 1) * width)
        yield keeping.summarise(storage, item, width, begin, at)
