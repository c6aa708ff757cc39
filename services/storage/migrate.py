"""The versions of the schema: one file each in `schema/`, applied in order. Not here: how a database runs them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from importlib import resources

from services.errors import ConfigError


def versions(dialect: str) -> dict[int, list[str]]:
    """The statements of each version, `schema/<dialect>_<number>.sql`, in order."""
    found = {}
    for file in resources.files("services.storage").joinpath("schema").iterdir():
        if match := re.fullmatch(rf"{dialect}_(\d+)\.sql", file.name):
            found[int(match[1])] = statements(file.read_text(encoding="utf-8"))
    return dict(sorted(found.items()))


def statements(script: str) -> list[str]:
    """The statements of a script whose texts contain neither `;` nor `--`."""
    bare = re.sub(r"--[^\n]*", "", script)
    return [statement.strip() for statement in bare.split(";") if statement.strip()]


def migrate(dialect: str, current: int, apply: Callable[[int, list[str]], None]) -> None:
    """Applies what is newer than `current`; ConfigError when the database is newer than this program."""
    known = versions(dialect)
    newest = max(known)
    if current > newest:
        raise too_new(current, newest)
    for version, script in known.items():
        if version > current:
            apply(version, script)


def too_new(current: int, newest: int) -> ConfigError:
    """What an older program says of a database that a newer one has brought up to date."""
    return ConfigError([f"the database has schema version {current}, this program knows {newest}: update it"])


def back(dialect: str, current: int, to: int) -> Iterator[tuple[int, list[str]]]:
    """The versions to take back, newest first, each with its statements; ConfigError when one has no way back."""
    folder = resources.files("services.storage").joinpath("schema")
    for version in range(current, to, -1):
        file = folder.joinpath(f"{dialect}_{version:03d}_down.sql")
        if not file.is_file():
            raise ConfigError([f"schema version {version} cannot be taken back"])
        yield version, statements(file.read_text(encoding="utf-8"))
