"""What processes hold, read in /proc: memory, descriptors, threads; and which processes are left over."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from tests.small_flat import parent_of, words_of

YOUNG_S = 15.0  # a process that starts grows
LONG_S = 180.0  # in a shorter life the first scan may come late, and with it what a scan needs
GROWN = 0.5  # of its life: until then it shows what it needs
MOST = {"rss_mb": 25.0, "descriptors": 6.0, "threads": 4.0}  # beyond that


class Held(NamedTuple):
    """At a moment, by a process."""

    rss_mb: float
    descriptors: float
    threads: float


def held(pid: int) -> Held | None:
    """None when it has ended."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        return Held(
            pages * os.sysconf("SC_PAGE_SIZE") / 1e6,
            len(os.listdir(f"/proc/{pid}/fd")),
            len(os.listdir(f"/proc/{pid}/task")),
        )
    except (OSError, IndexError):
        return None


def family(roots: Iterable[int]) -> list[int]:
    """These processes and all that descend from them."""
    parents = {int(entry.name): parent_of(entry) for entry in Path("/proc").glob("[0-9]*")}
    found = list(roots)
    for pid in found:  # it grows while we walk through it
        found += [child for child, parent in parents.items() if parent == pid]
    return found


def of_apartment(state: str) -> dict[int, str]:
    """Every process that was given this state folder in its environment, with its command line."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            if f"APARTMENT_STATE={state}".encode() in (entry / "environ").read_bytes().split(b"\0"):
                found[int(entry.name)] = b" ".join(words_of(entry)).decode(errors="replace")[:200]
        except OSError:
            continue
    return found


@dataclass
class Life:
    """What a process held at most in the first half of its life, and holds now."""

    name: str
    born: float
    looks: list[tuple[float, Held]] = field(default_factory=list)

    @property
    def now(self) -> Held:
        """At the last look."""
        return self.looks[-1][1]

    @property
    def seen(self) -> float:
        """When that was."""
        return self.looks[-1][0]

    @property
    def youth(self) -> list[Held]:
        """What it held in the first half of its life, without its start."""
        grown = self.born + max(YOUNG_S + 5.0, GROWN * (self.seen - self.born))
        return [one for at, one in self.looks if self.born + YOUNG_S < at <= grown]

    @property
    def grown(self) -> dict[str, float]:
        """By how much it holds more now."""
        return {what: getattr(self.now, what) - max(getattr(one, what) for one in self.youth) for what in Held._fields}


class Vitals:
    """Follows processes by their names; `look` is called now and then."""

    def __init__(self) -> None:
        self.lives: dict[int, Life] = {}

    def look(self, pids: dict[str, int]) -> None:
        """At these processes, by name."""
        now = time.monotonic()
        for name, pid in pids.items():
            if (found := held(pid)) is None:
                continue
            self.lives.setdefault(pid, Life(name, now)).looks.append((now, found))

    @property
    def survivors(self) -> list[Life]:
        """Those who live now and have lived long enough to tell."""
        newest = max((life.seen for life in self.lives.values()), default=0.0)
        return [one for one in self.lives.values() if one.seen == newest and newest - one.born > LONG_S and one.youth]

    @property
    def leaks(self) -> list[str]:
        """Who holds more than it should."""
        return [
            f"{life.name}: {what} +{more:.1f} to {getattr(life.now, what):.1f} in {life.seen - life.born:.0f} s"
            for life in self.survivors
            for what, more in life.grown.items()
            if more > MOST[what]
        ]
