"""Puts the dashboard together: the plan, the HTTP server in its thread, and the service that feeds it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from services.dashboard import plan
from services.dashboard.aim import Sight
from services.dashboard.house import House
from services.dashboard.http.server import Server
from services.dashboard.service import Dashboard
from services.dashboard.settings import Config
from services.runner import Post

log = logging.getLogger(__name__)


@contextmanager
def start(config: Config, post: Post) -> Iterator[Dashboard]:
    """The service; ConfigError when a file cannot be used, OSError when it cannot listen there."""
    apartment, maps = plan.described(config)
    house = House(config, post, apartment, maps, _sights(config))
    server = Server(house)
    try:
        if not config.users:
            log.warning("no users are configured: this machine alone may open %s, without a login", server.url)
        else:
            log.info("%s, for %d users", server.url, len(config.users))
        yield Dashboard(server.spread, server.answered, server.pictured, {"url": server.url, "port": server.port})
    finally:
        server.close()


def _sights(config: Config) -> dict[str, Sight]:
    """The cameras whose picture can be clicked at: those whose mount and lens are known."""
    found = {}
    for name, section in config.camera_sections.items():
        mount, lens = section.mount, plan.lens_of(config.folder, section)
        if mount is not None and lens is not None:
            found[name] = Sight(mount, lens, tuple(plan.levels_of(config.folder, section)))
    return found
