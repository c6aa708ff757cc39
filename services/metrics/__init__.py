"""How the services fare, for Prometheus: a page of numbers on loopback.

Listens to `service/+/status`, `service/+/info` and `diagnostics/#`; says nothing on the bus but its own status.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from services.metrics.settings import Config
from services.runner import Post

if TYPE_CHECKING:
    from services.metrics.service import Metrics

__all__ = ["Config", "start"]


@contextmanager
def start(config: Config, post: Post) -> Iterator[Metrics]:
    """The service and its page; the page's library is loaded by the process that needs it."""
    from services.metrics import service

    with service.start(config) as running:
        yield running
