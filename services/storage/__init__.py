"""Where samples, sightings, scans, orders, missions, diagnostics are kept: a small contract, two databases behind it.

Not here: which value is worth keeping (`services/persistence/`), and the SQL (`mysql.py`, `sqlite.py`; the tables
are in `schema/`, one file per version). All times are whole microseconds since 1970, UTC.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from services.errors import Unavailable
from services.storage import migrate
from services.storage.address import Address, read_address

__all__ = [
    "Address", "Batch", "CameraOrder", "Diagnostic", "Item", "Mission", "Row", "Sample", "Scan", "SeenTurn", "Sighting",
    "Storage", "open_plain", "open_ready", "open_storage", "read_address", "schema_version",
]  # fmt: skip
BACKENDS = {"mysql": "services.storage.mysql", "sqlite": "services.storage.sqlite"}
VERSIONED = {  # whether there are tables of ours
    "mysql": "SHOW TABLES LIKE 'schema_version'",
    "sqlite": "SELECT 1 FROM sqlite_master WHERE name='schema_version'",
}


@dataclass(frozen=True, slots=True)
class Item:
    """An item as the database knows it; `kind` is the type without its dimension, `unit` that of all its numbers."""

    name: str
    kind: str
    unit: str | None = None
    item_id: int = 0


class Sample(NamedTuple):
    """One stored state: number, text or both (`kind.holds` says which one is the value). A tuple, as Message is."""

    item: str
    time: int
    num: float | None
    text: str | None


@dataclass(frozen=True, slots=True)
class Sighting:
    """A marker seen by a scan; `sx`, `sy`, `sz` are standard deviations in metres. Fields are the columns."""

    scan: str
    camera: str
    marker: int
    dictionary: str
    place: str | None
    stamp: int
    first_seen: int | None = None
    x: float | None = None
    y: float | None = None
    z: float | None = None
    qx: float | None = None
    qy: float | None = None
    qz: float | None = None
    qw: float | None = None
    sx: float | None = None
    sy: float | None = None
    sz: float | None = None
    distance: float | None = None
    zoom: float | None = None
    frames: int | None = None
    mode: str | None = None
    why: str | None = None


@dataclass(frozen=True, slots=True)
class Scan:
    """A scan; written at each of its states, and left alone once it has ended. Fields are the columns."""

    scan: str
    camera: str
    state: str
    targets: str
    found: str
    started: int
    ended: int | None
    frames_taken: int
    frames_analysed: int


@dataclass(frozen=True, slots=True)
class CameraOrder:
    """An order; written at each of its states, `at` is the time of the first in all. Fields are the columns."""

    order_id: str
    camera: str
    name: str
    value: str
    state: str
    error: str | None
    at: int


@dataclass(frozen=True, slots=True)
class Mission:
    """A mission; written at each of its states, and left alone once it has ended. `started` is the same in all.

    Position in the apartment, metres; `story` is JSON: [[seconds since it began, step, text], ...].
    """

    mission: str
    robot: str
    marker: int
    state: str
    reason: str | None
    place: str | None
    x: float | None
    y: float | None
    z: float | None
    seen_by: str | None
    started: int
    ended: int | None
    story: str | None


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """A change of a component's level or message; `details` is JSON. Fields are the columns."""

    component: str
    time: int
    level: int
    message: str
    details: str | None


@dataclass(frozen=True, slots=True)
class SeenTurn:
    """What keeps a redelivered message from being stored twice; see `services/persistence/seen.py`."""

    client: str
    slot: int
    turn: int
    packets: bytes


Row = Sighting | Scan | CameraOrder | Mission | Diagnostic
TABLES: dict[type[Row], str] = {
    Sighting: "sighting",
    Scan: "scan",
    CameraOrder: "camera_order",
    Mission: "mission",
    Diagnostic: "diagnostic",
}
TIMES = frozenset({"time", "stamp", "first_seen", "started", "ended", "at"})  # the columns that hold a time
FINAL_STATES = ("done", "failed", "refused", "cancelled")  # of an order; it has one of them once


@dataclass(slots=True)
class Batch:
    """What is written in one transaction. Writing the same batch again changes nothing.

    The session's bookkeeping (`mqtt_session.seen`) belongs to the same transaction and will be one more field.
    """

    samples: list[Sample] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    seen: SeenTurn | None = None

    def __len__(self) -> int:
        return len(self.samples) + len(self.rows)

    def extend(self, other: Batch) -> None:
        """Adds all of another batch behind this one."""
        self.samples += other.samples
        self.rows += other.rows

    def halves(self) -> tuple[Batch, Batch]:
        """The rows in two, to find the one that a database refuses; `seen` is in neither."""
        s, r = (len(self.samples) + 1) // 2, len(self.rows) // 2
        return Batch(self.samples[:s], self.rows[:r]), Batch(self.samples[s:], self.rows[r:])


class Storage(Protocol):
    """One open database. Used from one thread.

    Every call may raise Unavailable; the storage is then to be closed and another opened. Opening it brings the
    tables up to date; ConfigError says why it cannot be used at all (accounts, character set, a newer schema).
    """

    dialect: str  # a key of BACKENDS
    deadlocks: int  # transactions that had to give way to another, and were repeated

    @property
    def items(self) -> Mapping[str, Item]:
        """The items that are known, by name."""
        ...

    def read(self, statement: str) -> list[tuple[Any, ...]]:
        """The rows of a query in the database's own SQL."""
        ...

    def change(self, *statements: str) -> int:
        """Runs statements in one transaction; how many rows the last of them changed."""
        ...

    def quote(self, text: str) -> str:
        """A text as a literal of the database's SQL."""
        ...

    def remake_views(self) -> None:
        """Makes the views with OpenHAB's layout anew: somebody may have changed or lost them."""

    def seen(self, client: str) -> list[SeenTurn]:
        """What a writer's last turns handled, in no order."""
        ...

    def add_items(self, items: Iterable[Item]) -> None:
        """Makes items and their views; of one that is there the kind follows, and a missing unit is filled in."""

    def write(self, batch: Batch) -> None:
        """Writes all of it in one transaction, or nothing. Its items are known.

        BadMessage when the database refuses a value; which one, the halves of the batch tell.
        """

    def last(self, item: str) -> Sample | None:
        """The newest sample of an item."""
        ...

    def last_values(self) -> dict[str, Sample]:
        """The newest sample of every item that has one."""
        ...

    def last_diagnostics(self) -> dict[str, Diagnostic]:
        """The newest row of every component."""
        ...

    def samples(
        self, item: str, *, since: int | None = None, until: int | None = None, limit: int | None = None
    ) -> list[Sample]:
        """The samples of `since <= time < until`, oldest first; with `limit` the newest so many of them."""
        ...

    def sightings(self, marker: int, limit: int) -> list[Sighting]:
        """Where a marker was seen, newest first."""
        ...

    def note(self, client: str, name: str, value: int) -> None:
        """Keeps a number of a writer's own."""

    def noted(self, client: str, name: str) -> int | None:
        """The number that was kept; None when none was."""
        ...

    def close(self) -> None:
        """Ends the connection."""


def open_storage(address: Address | str, folder: Path = Path()) -> Storage:
    """Opens the database of an address (`address.py` tells its forms); a relative file starts from `folder`.

    ConfigError when it cannot be used, Unavailable when it is away; waits CONNECT_TIMEOUT_S (5 s) at most for it.
    """
    if isinstance(address, str):
        address = read_address(address, folder=folder)
    storage: Storage = import_module(BACKENDS[address.dialect]).open_address(address)
    return storage


def open_plain(address: Address) -> Storage:
    """Opens a database that is not ours, or as its administrator: only `read`, `change`, `quote` and `close` work."""
    storage: Storage = import_module(BACKENDS[address.dialect]).open_plain(address)
    return storage


def open_ready(address: Address) -> Storage:
    """Opens it as somebody who is not the writer: nothing is made, learnt or brought up to date.

    The calls of `open_plain` work, and those that read. Unavailable until the writer has made the tables ready.
    """
    storage = open_plain(address)
    try:
        newest, found = max(migrate.versions(address.dialect)), schema_version(storage)
        if found < newest:
            raise Unavailable(f"the tables are of version {found}, not {newest} yet: the writer brings them up to date")
        if found > newest:
            raise migrate.too_new(found, newest)
    except BaseException:
        storage.close()
        raise
    return storage


def schema_version(storage: Storage) -> int:
    """The version of the tables; 0 where there are none yet."""
    there = storage.read(VERSIONED[storage.dialect])
    return int(storage.read("SELECT COALESCE(MAX(version), 0) FROM schema_version")[0][0]) if there else 0
