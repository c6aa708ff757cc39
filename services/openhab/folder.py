"""OpenHAB's configuration folder: what of it is ours, what would change, and writing it. Never touches others' files.

Ours is what begins with our mark. Not here: the texts (`generate.py`).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from services.errors import ConfigError
from services.openhab.check import KINDS, check, read_site
from services.openhab.check.across import NOWHERE
from services.openhab.generate import MARK
from services.openhab.versions import Version
from services.whole_file import write_whole

PLACES = ("things", "items", "rules", "automation/js", "sitemaps", "persistence", "html", "widgets")


@dataclass(frozen=True)
class Plan:
    """What writing would do: new texts by path, ours that go, and others' files that stand in the way."""

    folder: Path
    wanted: Mapping[str, str]
    written: tuple[str, ...]
    gone: tuple[str, ...]
    foreign: tuple[str, ...]


def plan(folder: Path, files: Mapping[str, str]) -> Plan:
    """What would change in a folder."""
    foreign = tuple(path for path in files if (folder / path).exists() and not is_ours(folder / path))
    changed = tuple(path for path, text in files.items() if path not in foreign and _read(folder / path) != text)
    return Plan(folder, files, changed, tuple(_left_over(folder, files)), foreign)


def is_ours(file: Path) -> bool:
    """Whether a file was written by us."""
    return MARK in (_read(file) or "").partition("\n")[0]


def _read(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8")
    except (FileNotFoundError, UnicodeDecodeError):
        return None


def _left_over(folder: Path, files: Mapping[str, str]) -> Iterator[str]:
    """Files of ours that are wanted no more, such as those of a camera that went."""
    for place in PLACES:
        for file in sorted((folder / place).glob("*")):
            path = f"{place}/{file.name}"
            if path not in files and file.is_file() and is_ours(file):
                yield path


def diff(plan: Plan) -> str:
    """What would change, as a unified diff; empty when nothing would."""
    parts: list[str] = []
    for path in (*plan.written, *plan.gone):
        old, new = (_read(plan.folder / path) or ""), plan.wanted.get(path, "")
        names = (f"a/{path}" if old else "/dev/null", f"b/{path}" if new else "/dev/null")
        parts += difflib.unified_diff(old.splitlines(keepends=True), new.splitlines(keepends=True), *names)
    return "".join(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in parts)


def faults(plan: Plan, version: Version) -> list[str]:
    """What OpenHAB would not take of the files that are to be written, beside others' in the folder.

    A link to a thing of OpenHAB's own pages is none: nobody sees those here.
    """
    ours = {path: text for path, text in plan.wanted.items() if path not in plan.foreign}
    found = check({**_others(plan.folder), **ours}, version)
    wrong = [one for one in found if one.severity == "error" and one.file in ours]
    return [
        f"{one.file}:{one.line}: {_head(ours[one.file], one.line)}: {one.text}"
        for one in wrong
        if not one.text.startswith(NOWHERE)
    ]


def _head(text: str, line: int) -> str:
    """The first words of the item or thing that a line is part of, which say what it is called."""
    above = [one for one in text.split("\n")[:line] if one and one[0] not in " })]"]
    return " ".join(above[-1].split()[:2]) if above else "file"


def apply(plan: Plan) -> None:
    """Writes; who reads meanwhile sees the old file or the new one, never a part."""
    for path in plan.written:
        write_whole(plan.folder / path, plan.wanted[path])
    for path in plan.gone:
        (plan.folder / path).unlink()


def texts(paths: Iterable[Path]) -> dict[str, str]:
    """The texts of files and of all of OpenHAB's files in folders; ConfigError where one cannot be read."""
    found: dict[str, str] = {}
    faults = []
    for path in paths:
        files = sorted(file for file in path.rglob("*") if file.suffix in KINDS) if path.is_dir() else [path]
        for file in files:
            try:
                found[str(file)] = file.read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError) as error:
                faults.append(
                    f"{file}:1: file: expected a readable file, got {getattr(error, 'strerror', None) or error}"
                )
    if faults:
        raise ConfigError(faults)
    return found


def _others(folder: Path) -> dict[str, str]:
    """The texts of others' files."""
    found = texts([folder]) if folder.is_dir() else {}
    return {name: text for name, text in found.items() if MARK not in text.partition("\n")[0]}


def taken(folder: Path, version: Version) -> dict[str, str]:
    """What others' files in the folder define already: names of items and UIDs of things, each with file and line."""
    site, _ = read_site(_others(folder), version)
    found: dict[str, str] = {}
    for items, findings in site.items:
        found |= {line.name: f"{findings.file}:{line.line}" for line in items.lines}
    for things, findings in site.things:
        found |= {thing.uid: f"{findings.file}:{thing.line}" for thing in things}
    return found
