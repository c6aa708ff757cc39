"""The machine itself: configuration, secrets, the folder of what is kept, disk, clock."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from services import secret_store
from services.config import Apartment
from services.credentials import strength
from services.doctor.findings import Finding, ill, well
from services.document import Fault

LEAST_FREE = 500 * 1024 * 1024  # bytes: some days of states and pictures
PART = "machine"


def faults(told: tuple[str, ...]) -> Iterator[Finding]:
    """The faults of a configuration."""
    for fault in told:
        missing = fault.partition("expected ${")[2].partition("}")[0]
        if missing:
            mend = "apartment secrets init" if missing.startswith(("BUS_", "DATABASE_")) else "apartment secrets set"
            yield ill("secrets", fault, f"{mend}{'' if mend.endswith('init') else f' {missing}'}")
        elif isinstance(fault, Fault) and fault.key == "bus.tls.ca":
            yield ill("broker", fault, "bus.tls.ca: copy ca.crt from the broker's machine")
        else:
            yield ill("configuration", fault, "change that line")


def look(apartment: Apartment, environment: Mapping[str, str], now: float) -> Iterator[Finding]:
    """Everything here that needs no network."""
    weak = strength.faults(apartment)
    for fault in weak:
        yield ill("secrets", fault, "apartment secrets init, or apartment secrets set NAME")
    if not weak:
        yield well("secrets", "passwords are there")
    yield from _modes(environment)
    yield from _state(apartment.state)
    yield from _clock(now)


def _modes(environment: Mapping[str, str]) -> Iterator[Finding]:
    named = environment.get("APARTMENT_SECRETS")
    for file in [Path(named)] if named else [secret_store.home(environment) / "secrets.yaml"]:
        if os.access(file, os.R_OK) and file.stat().st_mode & 0o077:
            yield ill("secrets", f"{file} can be read by others", f"chmod 600 {file}")


def _state(folder: Path) -> Iterator[Finding]:
    there = next(one for one in (folder.absolute(), *folder.absolute().parents) if one.exists())  # a service makes it
    try:
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        yield ill(
            PART, f"{folder} cannot be written: {error.strerror}", f"state: another folder, or chown it: {folder}"
        )
        return
    yield well(PART, f"{folder} can be written")
    yield room(shutil.disk_usage(there).free, folder)


def room(free: int, folder: Path) -> Finding:
    """Whether a disk has enough left."""
    told = f"{free // 2**20} MB free in {folder}"
    if free < LEAST_FREE:
        return ill(
            PART,
            told,
            "make room: old pictures in state/snapshots, `keep` of the section history, journalctl --vacuum-size",
        )
    return well(PART, told)


def _clock(now: float) -> Iterator[Finding]:
    newest = max(file.stat().st_mtime for file in Path(__file__).parents[1].glob("*.py"))
    yield clock(now, newest)


def clock(now: float, installed: float) -> Finding:
    """A clock before the day of the installation is wrong; a Raspberry Pi without network starts in the past."""
    if now < installed - 86400:
        return ill(PART, "the clock is in the past", "timedatectl set-ntp true, or a clock module for the Raspberry Pi")
    return well(PART, "the clock is possible")
