"""All of it, one part after the other."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from services import persistence
from services.config import load
from services.doctor import broker, machine, others
from services.doctor.findings import Finding, well
from services.errors import ConfigError


def examine(config: Path, environment: Mapping[str, str]) -> Iterator[Finding]:
    """Everything that the configuration uses; with a faulty one nothing but its faults."""
    try:
        apartment = load(config, None, environment, deep=True)
    except ConfigError as error:
        yield from machine.faults(error.faults)
        return
    yield well("configuration", f"{config}: {', '.join(apartment.instances)}")
    yield from machine.look(apartment, environment, time.time())
    yield from broker.look(apartment.bus)
    for name, instance in apartment.instances.items():
        if isinstance(instance.config, persistence.Config):
            yield from others.database(instance.config.address)
        elif instance.row.section[0] == "cameras":
            yield from others.camera(name.removeprefix("camera-"), instance.config)
        elif name == "bridge" and not getattr(instance.config, "simulated", False):
            yield from others.ros(environment)
