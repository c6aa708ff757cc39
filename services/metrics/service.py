"""The service behind the page: learns from the bus, and tells whoever asks by HTTP.

Not here: which numbers (`numbers.py`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from prometheus_client import CollectorRegistry, MetricsHandler
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.registry import Collector

from services import topics
from services.bus import Message
from services.http_doors import Doors, Visitor
from services.metrics.numbers import Known, Number
from services.metrics.settings import Config

ASKERS = 8  # connections of one address: Prometheus and a few who look

MEANINGS = {
    "apartment_service_online": ("whether a service is there", ("service",)),
    "apartment_service_info": ("1, with its version", ("service", "version")),
    "apartment_service_started_seconds": ("since when it runs, seconds since 1970", ("service",)),
    "apartment_service_counted": ("what it counted since then", ("service", "counter")),
    "apartment_service_aside": ("messages put aside since they crashed it", ("service",)),
    "apartment_diagnostic_level": ("0 well, 1 warning, 2 error, 3 stale", ("component",)),
    "apartment_metrics_forgotten": ("messages about names beyond the most that are kept", ()),
}


class Page(Collector):
    """What is asked for; `shown` is replaced as a whole, since the page is read from another thread."""

    def __init__(self) -> None:
        self.shown: tuple[Number, ...] = ()

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """See `prometheus_client`."""
        shown = self.shown
        for name, (meaning, labels) in MEANINGS.items():
            family = GaugeMetricFamily(name, meaning, labels=labels)
            for number in shown:
                if number.name == name:
                    family.add_metric(number.labels, number.value)
            yield family


class Metrics:
    """The service; see `services.runner.Service`."""

    subscribes = (topics.SERVICE_STATUS.filter, topics.SERVICE_INFO.filter, topics.DIAGNOSTICS.filter)

    def __init__(self, page: Page, addresses: dict[str, Any]) -> None:
        self.due: float | None = None
        self.counters: Counter[str] = Counter()
        self.addresses = addresses
        self._known, self._page = Known(), page

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """Learns how somebody fares."""
        self.due = now
        self._known.handle(message, now)
        return ()

    def tick(self, now: float) -> Iterable[Message]:
        """Shows what was learnt in this turn."""
        self.due = None
        self._page.shown = tuple(self._known.numbers())
        return ()


@contextmanager
def start(config: Config) -> Iterator[Metrics]:
    """The page answers until the end of the block."""
    page, registry = Page(), CollectorRegistry()
    registry.register(page)
    server = Doors(config.host, config.port, type("Asker", (Visitor, MetricsHandler), {"registry": registry}), ASKERS)
    server.begin()
    try:
        yield Metrics(page, {"metrics": f"http://{config.host}:{server.server_port}/metrics"})
    finally:
        server.close()
