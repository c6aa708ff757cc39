"""The dashboard: the apartment in a browser, live, and its HTTP API.

Listens to everything that the broker lets it read. Says what people order there: `home/<item>/command`,
`camera/<cam>/order/<Key>`, `mission/<robot>/order` and whatever else its account may write.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from services.dashboard.settings import Config
from services.runner import Post

if TYPE_CHECKING:
    from services.dashboard.service import Dashboard

__all__ = ["Config", "check", "start"]


def check(config: Config) -> None:
    """ConfigError with every fault of the files that the settings name."""
    from services.dashboard import plan

    plan.check(config)


def start(config: Config, post: Post) -> AbstractContextManager[Dashboard]:
    """Runs the service until the context ends. The HTTP server is loaded here, not with the module."""
    from services.dashboard import program

    return program.start(config, post)
