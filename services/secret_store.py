"""Where secrets come from: the environment, a credential file, or `secrets.yaml` outside the repository.

Never from the configuration itself, and never onto a command line, into a log or a repr (pydantic's SecretStr).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from services import document


def lookup(environment: Mapping[str, str] = os.environ) -> Callable[[str], str | None]:
    """A function from a name to its value, or None. The first of these that knows the name wins:

    1. the environment variable,
    2. the file of that name in `$CREDENTIALS_DIRECTORY` (systemd's LoadCredential),
    3. `secrets.yaml`: `$APARTMENT_SECRETS`, else `/etc/apartment/secrets.yaml` or `~/.config/apartment/secrets.yaml`.
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


def _secrets_file(environment: Mapping[str, str]) -> dict[str, str]:
    home = Path(environment.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    named = environment.get("APARTMENT_SECRETS")
    files = [Path(named)] if named else [home / "apartment/secrets.yaml", Path("/etc/apartment/secrets.yaml")]
    for file in files:
        if file.is_file():
            values = document.must(document.read(file))
            return {str(name): str(value) for name, value in (values or {}).items()}
    return {}
