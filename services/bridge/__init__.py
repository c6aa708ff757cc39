"""The bus and ROS 1: messages across by the rules of `config/bridge.yaml`, and back; lives through a new master.

Listens to the MQTT filters of the rules, to `diagnostics/#`, and to what the cameras say of where they look, what they
saw and where their picture is; on ROS to the topics of the rules towards MQTT. Says what the rules make of it,
`/diagnostics` once a second, frames, joints, pictures and the map, answers services, and says `diagnostics/bridge`.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from services.bridge.settings import Config
from services.runner import Post

if TYPE_CHECKING:
    from services.bridge.service import Bridge

__all__ = ["Config", "check", "start"]


def check(config: Config) -> None:
    """ConfigError with every fault of the rules; their types are checked where ROS is installed."""
    from services.bridge import program

    program.check(config)


def start(config: Config, post: Post) -> AbstractContextManager[Bridge]:
    """The service with its node; ConfigError when the rules cannot be used, or ROS is not installed.

    ROS is loaded here, not with the module.
    """
    from services.bridge import program

    return program.start(config, post)
