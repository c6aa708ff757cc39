"""Whether a configuration's passwords are there and are no example's. What a weak one is stands in `passwords.py`."""

from __future__ import annotations

import re
from collections.abc import Iterator

from pydantic import SecretStr

from services import document
from services.config import Apartment, Instance
from services.credentials.passwords import weakness

Path_ = tuple[str, ...]


def faults(apartment: Apartment) -> list[str]:
    """A line with file and line for each weak password; none for an apartment that is simulated."""
    if any(one.row.section[0] == "simulators" for one in apartment.instances.values()):
        return []
    source = document.read(apartment.file)
    told = []
    for path, user, password in _all(apartment):
        why = weakness(password.get_secret_value() if password else "", user)
        if why:
            told.append(
                f"{source.where(path)}: {document.dotted(path)}: expected a password that nobody guesses, got {why}"
            )
    return told


def _all(apartment: Apartment) -> Iterator[tuple[Path_, str, SecretStr | None]]:
    accounts = apartment.bus.accounts
    own = {name: None for name, one in apartment.instances.items() if one.row.on_bus}
    for account in {**accounts, **own}:
        yield ("bus", "accounts", account), account, accounts.get(account)
    for instance in apartment.instances.values():
        for name, value in instance.config:
            if isinstance(value, SecretStr):
                yield (*_section(instance), name), str(getattr(instance.config, "user", "")), value


def _section(instance: Instance) -> Path_:
    match = re.fullmatch(instance.row.name.replace("<cam>", "(.+)"), instance.name)
    named = match[1] if match and match.lastindex else ""
    return tuple(part.replace("<cam>", named) for part in instance.row.section)
