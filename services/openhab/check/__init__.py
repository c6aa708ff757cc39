"""Reads OpenHAB's files as strictly as OpenHAB's own grammars and validators, per release, and tells every fault. Pure.

Not here: opening files (`services/openhab/folder.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath

from services.openhab.check import across, items, persist, rules, sitemap, things
from services.openhab.check.findings import Finding, Findings
from services.openhab.versions import Version

__all__ = ["KINDS", "Finding", "check", "read_site"]

KINDS = (".items", ".things", ".sitemap", ".persist", ".rules")


def check(files: Mapping[str, str], version: Version) -> list[Finding]:
    """Every fault of the files, given by name with their texts, alone and together; by file and line."""
    _, found = read_site(files, version)
    return found


def read_site(files: Mapping[str, str], version: Version) -> tuple[across.Site, list[Finding]]:
    """The files as values, and every fault."""
    site = across.Site(version)
    all_findings = []
    for name, text in files.items():
        findings = Findings(name)
        all_findings.append(findings)
        _read(PurePath(name), text.removeprefix("\ufeff"), site, findings)
    across.check(site)
    return site, sorted(one for findings in all_findings for one in findings.found)


def _read(path: PurePath, text: str, site: across.Site, findings: Findings) -> None:
    if path.suffix == ".items":
        site.items.append((items.read(text, site.version, findings), findings))
    elif path.suffix == ".things":
        site.things.append((things.read(text, site.version, findings), findings))
    elif path.suffix == ".sitemap":
        shown = sitemap.read(text, site.version, findings)
        if shown.name and shown.name != path.stem:
            findings.warning(
                items.Reference("", 1, 1), f"expected the name of the file, {path.stem}, got {shown.name!r}"
            )
        site.sitemaps.append((shown, findings))
    elif path.suffix == ".persist":
        site.stored.append((persist.read(text, site.version, findings), findings))
    elif path.suffix == ".rules":
        site.rules.append((rules.read(text, site.version, findings), findings))
