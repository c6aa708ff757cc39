"""The named places, in the report's two files: `preset_position.yaml` (pan, tilt, zoom), `preset_coords.yaml` (preset).

Written so that a reader sees the old file or the new one; read again when somebody edited them by hand.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from services import document
from services.camera.requests import Reading, Refused
from services.errors import ConfigError
from services.payloads import Place
from services.payloads import Places as PlacesPayload

POSITIONS = "preset_position.yaml"
PRESETS = "preset_coords.yaml"
LONGEST_NAME = 80
NEAR_DEG = 0.6  # a reading that near to a place is at that place
NEAR_ZOOM = 0.5


def name_of(text: str) -> str:
    """A name that may stand for a place; ValueError says what is wrong with it."""
    name = text.strip()
    if not name or len(name) > LONGEST_NAME or not name.isprintable():
        raise ValueError(f"expected a name of 1 to {LONGEST_NAME} printable characters, got {text[:90]!r}")
    return name


class Places:
    """The places of one camera; `named` maps names to them, in the order of the file."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.named: dict[str, Place] = {}
        self._read_at: tuple[int, ...] = ()
        self.reload()

    def reload(self) -> bool:
        """Reads the files when they have changed since; whether they had. ConfigError leaves the old places."""
        state = self._state()
        if state == self._read_at:
            return False
        self._read_at = state
        self.named = _joined(_values(self.folder / POSITIONS), _values(self.folder / PRESETS), self.folder)
        return True

    def save(self, name: str, place: Place) -> None:
        """Keeps a place under this name, and writes the files."""
        self._write({**self.named, name: place})

    def remove(self, name: str) -> None:
        """Forgets a place, and writes the files; Refused when there is none of that name."""
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

    def free_preset(self) -> int:
        """The lowest preset number that no place has."""
        used = {place.preset for place in self.named.values()}
        return next(number for number in range(1, len(used) + 2) if number not in used)

    def at(self, reading: Reading) -> str | None:
        """The place that the camera looks at, if it is at one."""
        for name, place in self.named.items():
            pan = abs((reading.pan - place.pan + 180) % 360 - 180)
            if max(pan, abs(reading.tilt - place.tilt)) <= NEAR_DEG and abs(reading.zoom - place.zoom) <= NEAR_ZOOM:
                return name
        return None

    def _state(self) -> tuple[int, ...]:
        files = (self.folder / POSITIONS, self.folder / PRESETS)
        return tuple(file.stat().st_mtime_ns if file.exists() else 0 for file in files)

    def _write(self, named: dict[str, Place]) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        document.write(
            self.folder / POSITIONS, {name: [place.pan, place.tilt, place.zoom] for name, place in named.items()}
        )
        document.write(
            self.folder / PRESETS,
            {name: place.preset for name, place in named.items() if place.preset is not None},
        )
        self.named = named
        self._read_at = self._state()


def _values(file: Path) -> document.Document:
    return document.read(file) if file.exists() else document.Document(file, {})


def _joined(positions: document.Document, presets: document.Document, folder: Path) -> dict[str, Place]:
    """Both files as places; ConfigError with file and line of every fault."""
    for source in (positions, presets):
        if source.value is not None and not isinstance(source.value, dict):
            source.fault((), f"expected places by name, got {str(source.value)[:80]!r}")
    faults = [*positions.faults, *presets.faults]
    if faults:
        raise ConfigError(faults)
    numbers = presets.value or {}
    named = {str(name): _place(positions, name, value, numbers) for name, value in (positions.value or {}).items()}
    if positions.faults:
        raise ConfigError(positions.faults)
    return {name: place for name, place in named.items() if place is not None}


def _place(source: document.Document, name: Any, value: Any, numbers: dict[Any, Any]) -> Place | None:
    number = numbers.get(name)
    if isinstance(value, list) and len(value) in (2, 3) and all(_is_number(one) for one in value):
        pan, tilt, zoom = (float(one) for one in (*value, 0.0)[:3])
        return Place(pan=pan, tilt=tilt, zoom=zoom, preset=number if isinstance(number, int) else None)
    source.fault((name,), f"expected [pan, tilt, zoom], got {str(value)[:80]!r}")
    return None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
