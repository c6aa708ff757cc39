"""`apartment log` and `apartment reload`: a running service logs more or less, or starts again.

Not here: what the service does then (`services/steering.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from services import client
from services.client import Client
from services.command_line import completion
from services.command_line.options import CONFIG, Config, out
from services.config import load
from services.errors import ConfigError
from services.payloads import ServiceInfo
from services.steering import LEVELS
from services.topics import SERVICE_INFO, SERVICE_LOG_LEVEL, SERVICE_RELOAD, SERVICE_STATUS

KNOWN_S = 10.0  # until what is retained of the service is here
TOLD_S = 15.0  # its next info comes within 5 s
AGAIN_S = 60.0  # systemd waits 2 s, and a small machine imports OpenCV for some more
Service = Annotated[str, typer.Argument(autocompletion=completion.on_bus)]
Level = Annotated[str, typer.Argument(autocompletion=lambda: list(LEVELS), help=f"{', '.join(LEVELS)}.")]


def log(service: Service, level: Level, config: Config = CONFIG) -> None:
    """Make a running service log more or less, until it ends; services that share its process do so too."""
    if level not in LEVELS:
        raise ConfigError([f"level: expected of {', '.join(LEVELS)}, got {level!r}"])
    with _running(service, config) as (bus, _):
        bus.publish(SERVICE_LOG_LEVEL.message(level, service=service))
        bus.payload(
            SERVICE_INFO.name(service=service), lambda info: info.counters.get("log_level") == LEVELS[level], TOLD_S
        )
    out.print(f"{service} logs at {level}", markup=False)


def reload(service: Service, config: Config = CONFIG) -> None:
    """Check the configuration, then end a running service in good order, and wait until it has started again.

    `apartment run` or systemd starts it again; one that was started by hand with `serve` just ends.
    """
    with _running(service, config) as (bus, before):
        bus.publish(SERVICE_RELOAD.message("now", service=service))
        info = bus.payload(SERVICE_INFO.name(service=service), lambda info: info.started != before.started, AGAIN_S)
    out.print(f"{service} runs again, since {info.started}", markup=False)


@contextmanager
def _running(service: str, config: Path) -> Iterator[tuple[Client, ServiceInfo]]:
    """The bus, and what the service says of itself; TimeoutError when it is not online."""
    apartment = load(config, deep=True)
    known = [name for name, one in apartment.instances.items() if one.row.on_bus]
    if service not in known:
        raise ConfigError([f"{apartment.file}:1: services: expected of {', '.join(known)}, got {service!r}"])
    topics = [row.name(service=service) for row in (SERVICE_STATUS, SERVICE_INFO)]
    with client.connected(apartment.bus, topics) as bus:
        bus.payload(topics[0], lambda status: status == "online", KNOWN_S)
        yield bus, bus.payload(topics[1], timeout_s=KNOWN_S)
