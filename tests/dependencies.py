"""Which Python packages the apartment brings, and under which licences: `python -m tests.dependencies` writes the page.

From the packages' own metadata, as installed here; without versions, which a new installation may have others of.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageMetadata, distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "dependencies.md"
HEAD = """\
# Dependencies and their licences

Written by `python -m tests.dependencies` from what the packages say of themselves; a test keeps it up to date and lets
in no licence that would bind whoever passes the apartment on. Debian's packages (mosquitto, MariaDB, ROS, GStreamer,
Chromium) are met as programs of their own and are not part of it; `av` and `opencv-contrib-python-headless` carry
FFmpeg (LGPL-2.1) as libraries of their own.

`make sbom` writes `build/sbom.cdx.json`, all of this with versions as CycloneDX; `make audit` asks the package index
for known weaknesses of exactly these versions, and fails where the index cannot tell: some mirrors serve packages
without advisories. The dashboard's own libraries stand beside them with their licences
(`services/dashboard/static/`).
"""
# What permits to pass on without conditions on our own code.
FREE = ("MIT", "MIT-0", "BSD-2-Clause", "BSD-3-Clause", "0BSD", "Apache-2.0", "ISC", "PSF-2.0", "MPL-2.0", "Zlib",
        "CC0-1.0", "EPL-2.0")  # fmt: skip
NAMES = {  # older metadata says it in words
    "mit": "MIT", "mit license": "MIT", "bsd license": "BSD-3-Clause", "bsd-3-clause": "BSD-3-Clause",
    "apache software license": "Apache-2.0", "apache 2.0": "Apache-2.0", "apache-2.0": "Apache-2.0",
    "isc license (iscl)": "ISC", "mozilla public license 2.0 (mpl 2.0)": "MPL-2.0", "gplv2": "GPL-2.0-only",
}  # fmt: skip
TOLD = {"axe-playwright-python": "MIT"}  # says nothing in its metadata; its licence file does
ONLY_FOR_TESTS = ("GPL-2.0-only",)  # run by the tests as a program that tries ours, never passed on


@dataclass(frozen=True)
class Package:
    """One package, and who brings it (empty: we ourselves)."""

    name: str
    licence: str
    via: str


def extra(name: str) -> list[str]:
    """The requirements of an extra of ours; `` for those that everybody has."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found: list[str] = project["optional-dependencies"][name] if name else project["dependencies"]
    return found


def closure(wanted: Iterable[str]) -> list[Package]:
    """These packages and all that they bring, by name."""
    found: dict[str, Package] = {}
    waiting = [(Requirement(text), "") for text in wanted]
    for requirement, via in waiting:  # it grows while we walk through it
        name = canonicalize_name(requirement.name)
        if name in found:
            continue
        brought = distribution(requirement.name)
        found[name] = Package(name, licence(name, brought.metadata), via)
        waiting += [(one, name) for one in _needed(brought.requires or (), requirement.extras)]
    return [found[name] for name in sorted(found)]


def _needed(texts: Iterable[str], extras: set[str]) -> Iterator[Requirement]:
    for one in map(Requirement, texts):
        if one.marker is None or any(one.marker.evaluate({"extra": name}) for name in (*extras, "")):
            yield one


def licence(name: str, metadata: PackageMetadata) -> str:
    """As SPDX writes it; `unknown: ...` where that cannot be said."""
    if name in TOLD:
        return TOLD[name]
    if expression := metadata.get("License-Expression"):
        return str(expression)
    classes = [one for one in metadata.get_all("Classifier") or () if one.startswith("License ::")]
    words = [str(metadata.get("License") or ""), *(one.rpartition(" :: ")[2] for one in classes)]
    known = [NAMES[word.lower()] for word in words if word.lower() in NAMES]
    return known[0] if known else f"unknown: {words}"


def permitted(licence: str, allowed: Iterable[str] = FREE) -> bool:
    """Whether a licence asks for nothing that we do not want: one of several `OR`, each of several `AND`."""
    several = [part.split(" AND ") for part in licence.strip("()").split(" OR ")]
    return any(all(one.strip(" ()") in allowed for one in parts) for parts in several)


def page() -> str:
    """The text of the page."""
    own = closure([*extra(""), *extra("embedded")])
    more = [one for one in closure(extra("dev")) if one.name not in {known.name for known in own}]
    return f"{HEAD}\n## What runs\n\n{_table(own)}\n## What only the tests need\n\n{_table(more)}"


def _table(packages: list[Package]) -> str:
    rows = "".join(f"| {one.name} | {one.licence} | {one.via} |\n" for one in packages)
    return f"| Package | Licence | Brought by |\n| --- | --- | --- |\n{rows}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    sys.stdout.write(f"{PAGE}\n")
