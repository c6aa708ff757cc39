"""All of it, one part after the other."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from services import history, persistence
from services.config import load
from services.doctor import broker, machine, others, unit
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
    lets_in = False  # the database, whom it knows best; if not, nobody else has to be told the same
    for name, instance in apartment.instances.items():
        if isinstance(instance.config, persistence.Config):
            for finding in others.database(instance.config.address):
                lets_in = lets_in or finding.good
                yield finding
        elif isinstance(instance.config, history.Config) and lets_in:
            yield from others.readers(instance.config)
        elif instance.row.section[0] == "cameras":
            yield from others.camera(name.removeprefix("camera-"), instance.config)
        elif name == "bridge" and not getattr(instance.config, "simulated", False):
            own = unit.of(apartment, name)
            seen = unit.environment(own, environment)
            yield from others.ros(seen, getattr(instance.config, "master_uri", None), own)
