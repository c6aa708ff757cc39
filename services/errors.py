"""The errors of this project, named by what the runner does about them.

    ApartmentError
    ├── BadMessage    the topic or payload is not what the table says: told, counted, acknowledged, dropped
    ├── DeviceError   the camera or robot refused or is away: the failure is published, the service goes on
    ├── Unavailable   something we need is down: nothing is acknowledged or taken, the turn is tried again
    └── ConfigError   the configuration cannot be used: before the start only, all faults at once, exit 2

Anything else is a bug: the runner acknowledges nothing and the process ends with 1 (`runner.py`), in whatever thread it
comes up (`process.py`).
"""

from __future__ import annotations

from collections.abc import Iterable


def words(error: OSError) -> str:
    """What the system refused, as people read it: the file, where there is one, and why."""
    why = error.strerror or str(error)
    return why if error.filename is None else f"{error.filename}: {why}"


class ApartmentError(Exception):
    """The base of every error that this package raises on purpose."""


class BadMessage(ApartmentError):
    """A message whose topic or payload is not what the topic table says."""


class DeviceError(ApartmentError):
    """A camera or robot refused a request, or does not answer."""


class Unavailable(ApartmentError):
    """A peer that a turn cannot do without (the database) is away for the moment."""


class ConfigError(ApartmentError):
    """The configuration cannot be used; `faults` holds one line for each thing that is wrong with it."""

    def __init__(self, faults: Iterable[str]) -> None:
        self.faults: tuple[str, ...] = tuple(faults)
        super().__init__("\n".join(self.faults))


class Setting(str):
    """A fault of a setting: `path` is its keys from the file's top. In which line it stands, `document.py` knows."""

    path: tuple[str, ...]
    text: str

    def __new__(cls, path: tuple[str, ...], text: str) -> Setting:
        self = super().__new__(cls, f"{'.'.join(path)}: {text}")
        self.path, self.text = path, text
        return self


class SettingError(ConfigError):
    """One setting of a service that does not do."""

    def __init__(self, path: tuple[str, ...], text: str) -> None:
        super().__init__([Setting(path, text)])
