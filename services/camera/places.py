"""The named places, in the report's two files: `preset_position.yaml` (pan, tilt, zoom), `preset_coords.yaml` (preset).

Written so that a reader sees the old file or the new one; read again when somebody edited them by hand.
"""

from __future__ import annotations

import errno
import fcntl
import math
import os
import unicodedata
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from services import document
from services.camera.device import Reading, Refused
from services.errors import ConfigError, DeviceError
from services.payloads import Place
from services.payloads import Places as PlacesPayload

POSITIONS = "preset_position.yaml"
PRESETS = "preset_coords.yaml"
LONGEST_NAME = 80
NO_FILE = ((errno.ENOENT,), (errno.ENOTDIR,))
MOST = 500  # places; each is told to everybody, again and again
CONTROL = ("Cc", "Cs", "Zl", "Zp")  # control characters, halves of characters, and what breaks a line
NEAR_DEG = 0.6  # a reading that near to a place is at that place
NEAR_ZOOM = 0.5


def name_of(text: str) -> str:
    """A name that may stand for a place; ValueError says what is wrong with it."""
    name = text.strip()
    if not name or len(name) > LONGEST_NAME or any(unicodedata.category(one) in CONTROL for one in name):
        raise ValueError(f"expected a name of 1 to {LONGEST_NAME} characters, no control characters, got {text[:90]!r}")
    return name


class Places:
    """The places of one camera; `named` maps names to them, in the order of the file."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.named: dict[str, Place] = {}
        self._only_presets: dict[str, int] = {}  # of names that have no position: somebody else's, kept as they are
        self._read_at: tuple[object, ...] = ()
        self._fault: ConfigError | None = None
        self.reload()

    def reload(self) -> bool:
        """Reads the files when they have changed since; whether they had. ConfigError leaves the old places."""
        state = self._state()
        if state == self._read_at:
            return False
        self._read_at = state
        try:
            numbers = _numbers(_values(self.folder / PRESETS))
            self.named = _joined(_values(self.folder / POSITIONS), numbers)
        except ConfigError as error:
            self._fault = error
            raise
        self._fault = None
        self._only_presets = {name: number for name, number in numbers.items() if name not in self.named}
        return True

    def save(self, name: str, place: Place) -> None:
        """Keeps a place under this name, and writes the files; Refused when what stands there cannot be read."""
        with self._to_be_written():
            if name not in self.named and len(self.named) >= MOST:
                raise Refused(f"there are {MOST} places already: remove one")
            self._write({**self.named, name: place})

    def remove(self, name: str) -> None:
        """Forgets a place, and writes the files; Refused when there is none of that name, or as `save`."""
        with self._to_be_written():
            found = self.find(name)
            self._write({one: place for one, place in self.named.items() if one != found})

    def find(self, name: str) -> str:
        """The name as it is written: exactly, else without regard to case and blanks; Refused when there is none."""
        folded = {one.casefold(): one for one in self.named}
        found = name if name in self.named else folded.get(name.strip().casefold())
        if found is None:
            raise Refused(f"no place {name!r}; there are: {', '.join(self.named) or 'none yet'}")
        return found

    def get(self, name: str) -> Place:
        """The place of that name; Refused when there is none."""
        return self.named[self.find(name)]

    @property
    def payload(self) -> PlacesPayload:
        """As it is published."""
        return PlacesPayload(dict(self.named))

    @property
    def presets(self) -> set[int]:
        """The numbers that our files hold."""
        numbers = (place.preset for place in self.named.values())
        return {*(number for number in numbers if number is not None), *self._only_presets.values()}

    def free_preset(self, kept: Collection[int] = (), most: int = 0) -> int | None:
        """The lowest preset number that no place has, nor the camera already; None above `most` (0: not known)."""
        used = {*kept, *self.presets}
        number = next(number for number in range(1, len(used) + 2) if number not in used)
        return number if number <= most or not most else None

    def at(self, reading: Reading) -> str | None:
        """The place that the camera looks at, if it is at one."""
        for name, place in self.named.items():
            pan = abs((reading.pan - place.pan + 180) % 360 - 180)
            if max(pan, abs(reading.tilt - place.tilt)) <= NEAR_DEG and abs(reading.zoom - place.zoom) <= NEAR_ZOOM:
                return name
        return None

    def _state(self) -> tuple[object, ...]:
        return tuple(_seen(self.folder / name) for name in (POSITIONS, PRESETS))

    @contextmanager
    def _to_be_written(self) -> Iterator[None]:
        """Nobody else writes meanwhile, and what was edited by hand a moment ago is not lost."""
        self.folder.mkdir(parents=True, exist_ok=True)
        folder = os.open(self.folder, os.O_RDONLY)
        try:
            fcntl.flock(folder, fcntl.LOCK_EX)
            try:
                self.reload()
            except ConfigError as error:
                self._fault = error
            if self._fault is not None:
                raise Refused(f"nothing is saved over a file that cannot be read: {self._fault.faults[0]}")
            yield
        except OSError as error:
            raise DeviceError(f"the places cannot be written: {error.strerror}") from error
        finally:
            os.close(folder)  # which ends the lock

    def _write(self, named: dict[str, Place]) -> None:
        positions = {name: [place.pan, place.tilt, place.zoom] for name, place in named.items()}
        presets = {name: place.preset for name, place in named.items() if place.preset is not None}
        others = {name: number for name, number in self._only_presets.items() if name not in named}
        document.write(self.folder / POSITIONS, positions)
        document.write(self.folder / PRESETS, {**presets, **others})
        self.named, self._only_presets = named, others
        self._read_at = self._state()


def _seen(file: Path) -> tuple[int, ...]:
    """What changes with the file; the number of the error where it cannot be seen."""
    try:
        one = file.stat()
    except OSError as error:
        return (error.errno or 0,)
    return one.st_mtime_ns, one.st_ino, one.st_size


def _values(file: Path) -> document.Document:
    read = document.Document(file, {}) if _seen(file) in NO_FILE else document.read(file, names=True)
    if read.value is not None and not isinstance(read.value, dict):
        read.fault((), f"expected places by name, got {str(read.value)[:80]!r}")
    return read


def _numbers(presets: document.Document) -> dict[str, int]:
    """The camera's presets by name; ConfigError with file and line of every fault."""
    values: dict[str, Any] = document.must(presets) or {}
    for name, number in values.items():
        if not isinstance(number, int) or isinstance(number, bool):
            presets.fault((name,), f"expected the number of a preset, got {str(number)[:80]!r}")
    return dict(document.must(presets) or {})


def _joined(positions: document.Document, numbers: dict[str, int]) -> dict[str, Place]:
    """Both files as places; ConfigError with file and line of every fault."""
    values: dict[str, Any] = document.must(positions) or {}
    named = {name: _place(positions, name, value, numbers.get(name)) for name, value in values.items()}
    document.must(positions)
    return {name: place for name, place in named.items() if place is not None}


def _place(source: document.Document, name: str, value: Any, preset: int | None) -> Place | None:
    if isinstance(value, list) and len(value) in (2, 3) and all(_is_number(one) for one in value):
        pan, tilt, zoom = (float(one) for one in (*value, 0.0)[:3])
        return Place(pan=pan, tilt=tilt, zoom=zoom, preset=preset)
    source.fault((name,), f"expected [pan, tilt, zoom], got {str(value)[:80]!r}")
    return None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
