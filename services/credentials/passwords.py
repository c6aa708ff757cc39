"""Which passwords an installation has, how new ones are made, and which ones anybody would guess.

Not here: the files that they stand in, `folder.py`.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from services import access, document

BYTES = 24  # of chance: 192 bits, 32 letters
SHORTEST = 8  # the least that a camera's firmware asks for; ours are longer
FEWEST_SIGNS = 5  # different ones in it
PEOPLES = ("CAMERA_", "OPENHAB_")  # made elsewhere (in the camera, in OpenHAB), so not by us
KNOWN = (
    "password", "passwort", "secret", "changeme", "change_me", "admin", "administrator", "invented", "example",
    "only-simulated", "letmein", "qwerty", "qwertyuiop", "12345678", "123456789", "1234567890", "11111111", "openhab",
    "openhabian", "mosquitto", "raspberry", "apartment", "smartapartment", "default", "iloveyou", "abc12345",
)  # fmt: skip


def name_of(account: str) -> str:
    """The name under which the password of an account at the broker is kept: `BUS_CAMERA_IP1_PASSWORD`."""
    return f"BUS_{account.upper().replace('-', '_')}_PASSWORD"


def names(file: Path) -> tuple[list[str], list[str]]:
    """What a configuration wants: secrets that we make (of the broker's accounts too), and those that people bring."""
    asked: dict[str, None] = {}

    def note(name: str) -> None:
        asked[name] = None

    source = document.read(file, note)
    wanted = [name for name in asked if any(f"expected ${{{name}}}" in fault for fault in source.faults)]
    ours = {name_of(account): None for account in access.accounts(cameras(source.value))}
    ours |= {"DATABASE_ROOT_PASSWORD": None}  # of a database in a container; a system's own asks for none
    ours |= {name: None for name in wanted if not name.startswith(PEOPLES)}
    return list(ours), [name for name in wanted if name.startswith(PEOPLES)]


def cameras(value: Any) -> list[str]:
    """The names of the cameras in a configuration as it was read."""
    named = value.get("cameras") if isinstance(value, dict) else None
    return [str(name) for name in named] if isinstance(named, dict) else []


def made(wanted: Iterable[str]) -> dict[str, str]:
    """New random passwords, of letters that need no quoting anywhere."""
    return {name: secrets.token_urlsafe(BYTES) for name in wanted}


def weakness(password: str, user: str = "") -> str | None:
    """Why a password is no good, in words that do not tell it; None when it will do."""
    plain = password.lower().strip()
    if not password:
        return "none"
    if len(password) < SHORTEST:
        return f"one of {len(password)} signs"
    if len(set(password)) < FEWEST_SIGNS:
        return f"one of {len(set(password))} different signs"
    if plain in KNOWN or plain.rstrip("0123456789!?.") in KNOWN:
        return "one from every list of passwords, or from an example"
    if user and user.lower() in plain and len(plain) < len(user) + SHORTEST:
        return "the name of the account"
    return None
