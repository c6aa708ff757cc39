"""What is known of the services, as numbers with labels. Pure.

Not here: the form that Prometheus reads, and the page (`service.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from typing import TypeVar

from services import topics
from services.bus import Message
from services.payloads import Diagnostic, ServiceInfo

V = TypeVar("V")
MOST = 2000  # services and components that are remembered; whoever may say how he fares could invent names without end


@dataclass(frozen=True)
class Number:
    """One value of a metric."""

    name: str
    labels: tuple[str, ...]
    value: float


@dataclass
class Known:
    """The newest of each; `handle` learns, `numbers` tells."""

    online: dict[str, bool] = field(default_factory=dict)
    infos: dict[str, ServiceInfo] = field(default_factory=dict)
    levels: dict[str, int] = field(default_factory=dict)
    forgotten: int = 0

    def handle(self, message: Message, now: float) -> None:
        """Learns from a message; BadMessage when it is not what the table says. An empty one takes a component away."""
        if not message.payload and topics.DIAGNOSTICS.regex.fullmatch(message.topic):
            self.levels.pop(topics.find(message.topic)[1]["component"], None)
            return
        read = topics.read(message, now)
        if read.topic is topics.SERVICE_STATUS:
            self._keep(self.online, read.levels["service"], read.payload == "online")
        elif isinstance(read.payload, ServiceInfo):
            self._keep(self.infos, read.levels["service"], read.payload)
        elif isinstance(read.payload, Diagnostic):
            self._keep(self.levels, read.levels["component"], read.payload.level)

    def _keep(self, known: dict[str, V], name: str, value: V) -> None:
        if name in known or len(known) < MOST:
            known[name] = value
        else:
            self.forgotten += 1

    def numbers(self) -> Iterator[Number]:
        """Everything, the same names always."""
        for service, online in self.online.items():
            yield Number("apartment_service_online", (service,), float(online))
        for service, info in self.infos.items():
            yield Number("apartment_service_info", (service, info.version), 1.0)
            if (started := _seconds(info.started)) is not None:
                yield Number("apartment_service_started_seconds", (service,), started)
            for counter, value in info.counters.items():
                yield Number("apartment_service_counted", (service, counter), value)
            yield Number("apartment_service_aside", (service,), float(len(info.aside)))
        for component, level in self.levels.items():
            yield Number("apartment_diagnostic_level", (component,), float(level))
        yield Number("apartment_metrics_forgotten", (), float(self.forgotten))


def _seconds(moment: str) -> float | None:
    try:
        return datetime.fromisoformat(moment).timestamp()
    except (ValueError, OverflowError):
        return None
