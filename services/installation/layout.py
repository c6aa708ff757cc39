"""Where everything is on a machine, and which service needs which secret."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from services import document, secret_store
from services.config import Apartment, Instance
from services.credentials.passwords import name_of
from services.supervisor import processes

GROUP = "apartment"
SYSTEM = secret_store.SYSTEM
STATE = Path("/var/lib/apartment")
BROKER = SYSTEM / "broker"
DATABASE = SYSTEM / "database"
UNITS = Path("/etc/systemd/system")
TARGET = "apartment.target"


@dataclass(frozen=True)
class Part:
    """One process: the services in it, and what it may see."""

    services: tuple[Instance, ...]
    secrets: tuple[str, ...]

    @property
    def name(self) -> str:
        """Of its unit and its user, without what both begin with."""
        return self.services[0].name if len(self.services) == 1 else self.services[0].row.group

    @property
    def unit(self) -> str:
        """The name of its unit."""
        return f"apartment-{self.name}.service"

    @property
    def user(self) -> str:
        """Who runs it, and nothing else."""
        return f"apartment-{self.name}"


def parts(apartment: Apartment) -> list[Part]:
    """The processes of a configuration, as the supervisor would start them."""
    wanted = dict(_secrets(apartment.file))
    found = []
    for names in processes(apartment, list(apartment.instances)):
        services = tuple(apartment.instances[name] for name in names)
        found.append(Part(services, tuple(dict.fromkeys(one for own in services for one in _needed(own, wanted)))))
    return found


def _needed(instance: Instance, wanted: dict[str, str]) -> Iterator[str]:
    if instance.row.on_bus:
        yield name_of(instance.name)
    section = ".".join(instance.row.section).replace("<cam>", instance.name.rpartition("-")[2])
    yield from (name for path, name in wanted.items() if path == section or path.startswith(f"{section}."))


def _secrets(file: Path) -> Iterator[tuple[str, str]]:
    """Where in the configuration which secret stands that has no value of its own there."""
    form = re.compile(r":\d+: ([^:]+): expected \$\{(\w+)\}")
    for fault in document.read(file, lambda name: None).faults:
        if match := form.search(fault):
            yield match[1], match[2]
