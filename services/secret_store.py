"""Where secrets come from: the environment, a credential file, or `secrets.yaml` outside the repository.

Never from the configuration itself, and never onto a command line, into a log or a repr (pydantic's SecretStr).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from services import document

SYSTEM = Path("/etc/apartment")


def lookup(environment: Mapping[str, str] = os.environ) -> Callable[[str], str | None]:
    """A function from a name to its value, or None. The first of these that knows the name wins:

    1. the environment variable,
    2. the file of that name in `$CREDENTIALS_DIRECTORY` (systemd's LoadCredential),
    3. `secrets.yaml`: `$APARTMENT_SECRETS`, else in `~/.config/apartment` or `/etc/apartment` (or `secrets/` in there).
    """
    stored = _secrets_file(environment)

    def find(name: str) -> str | None:
        if name in environment:
            return environment[name]
        folder = environment.get("CREDENTIALS_DIRECTORY")
        if folder and (Path(folder) / name).is_file():
            return (Path(folder) / name).read_text(encoding="utf-8").rstrip("\n")
        return stored.get(name)

    return find


def home(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of a new installation's secrets: root's is the machine's, everybody else has one of their own."""
    return (SYSTEM if os.geteuid() == 0 else _own(environment)) / "secrets"


def _own(environment: Mapping[str, str]) -> Path:
    return Path(environment.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "apartment"


def _secrets_file(environment: Mapping[str, str]) -> dict[str, str]:
    named = environment.get("APARTMENT_SECRETS")
    places = [place / name for place in (_own(environment), SYSTEM) for name in ("", "secrets")]
    for file in [Path(named)] if named else [place / "secrets.yaml" for place in places]:
        if os.access(file, os.R_OK):  # the machine's own are root's
            values = document.must(document.read(file))
            return {str(name): str(value) for name, value in (values or {}).items()}
    return {}
