"""What `watch` and `record` share: filters that are checked, and what comes on the bus, batch by batch.

Not here: what is done with it (`watch.py`, `record.py`).
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import typer

from services import client
from services.bus import Message
from services.command_line import completion
from services.config import BusSettings
from services.errors import ConfigError

LONGEST_FILTER = 1000  # bytes; MQTT has 65,535
FILTERS = typer.Argument(help="'camera/#', 'home/+/state'; all when none.", autocompletion=completion.filters)
GLANCE_S = 0.2  # a signal that comes while Python is about to wait is seen at the end of the wait only


def checked(filters: Sequence[str]) -> list[str]:
    """The filters without those that another one holds (else a message would come twice); ConfigError lists faults."""
    faults = [f"filter {one!r}: expected {why}" for one in filters if (why := _fault(one))]
    if faults:
        raise ConfigError(faults)
    wanted = list(dict.fromkeys(filters))
    return [one for one in wanted if not any(other != one and holds(other, one) for other in wanted)]


def holds(wide: str, narrow: str) -> bool:
    """Whether all that matches the narrow filter matches the wide one."""
    wanted, levels = wide.split("/"), narrow.split("/")
    if levels[0].startswith("$") and wanted[0] != levels[0]:
        return False
    for one, level in zip(wanted, levels, strict=False):
        if one == "#":
            return True
        if level == "#" or one not in ("+", level):
            return False
    return wanted[len(levels) :] in ([], ["#"]) and len(wanted) >= len(levels)


def _fault(wanted: str) -> str:
    levels = wanted.split("/")
    if not wanted or len(wanted.encode(errors="replace")) > LONGEST_FILTER:
        return f"1 to {LONGEST_FILTER} bytes, such as 'camera/#'"
    if not wanted.isprintable():
        return "text that can be printed"
    if wanted.startswith("/"):
        return "no / at its beginning: such topics never leave a service"
    if "#" in levels[:-1] or any("#" in level and level != "#" for level in levels):
        return "# as the whole last level, such as 'camera/#'"
    if any("+" in level and level != "+" for level in levels):
        return "+ as a whole level, such as 'home/+/state'"
    return ""


class Stopwatch:
    """Whether it is over: somebody stopped it, or its seconds have passed."""

    def __init__(self, seconds: float | None = None) -> None:
        self._end = None if seconds is None else time.monotonic() + seconds
        self._stopped = False

    def stop(self) -> None:
        """From any thread or signal handler."""
        self._stopped = True

    @property
    def over(self) -> bool:
        """Whether to end now."""
        return self._stopped or (self._end is not None and time.monotonic() >= self._end)


class Batches:
    """Called, it gives all that comes in batches, empty ones too, until the stopwatch says so; and forgets them."""

    def __init__(self, bus: client.Client) -> None:
        self._bus = bus

    def __call__(self, watch: Stopwatch) -> Iterator[list[Message]]:
        while not watch.over:
            came = self._bus.pump(GLANCE_S)
            self._bus.seen.clear()
            yield came

    @property
    def connected(self) -> bool:
        """Whether the broker is there."""
        return self._bus.bus.connected


@contextmanager
def listening(settings: BusSettings, filters: Sequence[str]) -> Iterator[Batches]:
    """Listens by these filters, as `checked` gives them."""
    with client.connected(settings) as bus:
        bus.subscribe(*filters)
        yield Batches(bus)
